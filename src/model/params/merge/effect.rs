//! One effect of a file, read by its specification in the catalogue or by the owner's own.

use crate::effects::{CATALOGUE, EffectSpec, Scaling, find_in};
use crate::parameters::EffectSetting;
use crate::params::yaml::Node;

use super::{Merge, get};

/// How far outside its range on this unit an effect that goes with the unit's size may be: a fit changes the parameters that determine the unit's size, and the file
/// that it writes must be read.
const REFITTED: f64 = 10.0;

impl Merge<'_> {
    pub(super) fn effect(&mut self, section: &str, id: &str, node: &Node) {
        match node {
            Node::Map(map) if get(map, "expression").is_some() || get(map, "at").is_some() => {
                self.own_effect(section, id, map);
            }
            _ => self.effect_of(CATALOGUE, section, id, node),
        }
    }

    /// The catalogue is an argument so that tests can bring their own.
    fn effect_of(&mut self, catalogue: &[EffectSpec], section: &str, id: &str, node: &Node) {
        let path = [section, id];
        let found = catalogue.iter().find(|spec| spec.id == id);
        let Some(spec) = found.or_else(|| find_in(&self.sheet.unit, id)) else {
            let own = self.sheet.unit.own_effects.iter().map(|own| own.id.clone()).collect::<Vec<_>>();
            let known = catalogue.iter().map(|spec| spec.id).chain(own.iter().map(String::as_str));
            return self.unknown_effect(&path, known);
        };
        let known: Vec<&str> = spec.parameters.iter().map(|parameter| parameter.name).collect();
        let Node::Map(map) = node else {
            let found = node.describe();
            return self.problem(&path, format!("expected its parameters ({}), found {found}", known.join(", ")));
        };
        let before = self.problems.len();
        self.attributes(&path, map, &known);
        let mut values = Vec::with_capacity(known.len());
        for parameter in spec.parameters {
            let parameter = parameter.on(&self.sheet.unit.parameters);
            let path = [section, id, parameter.name];
            // The end of a fixed range is itself, which no sum of differences gives back to the last bit.
            let [low, high] = [parameter.min, parameter.max].map(|end| match parameter.scaling {
                Scaling::Fixed => end,
                _ => parameter.neutral + REFITTED * (end - parameter.neutral),
            });
            values.extend(match get(map, parameter.name) {
                Some(node) => self.number(&path, node, parameter.unit, (low, high)),
                None => Some(parameter.neutral),
            });
        }
        if self.problems.len() == before {
            self.set_effect(EffectSetting { id: id.to_owned(), values });
            self.record(&path, None);
        }
    }

    /// Applies an effect, replacing a setting of the files below; an owner's definition is kept beside its setting.
    pub(super) fn set_effect(&mut self, setting: EffectSetting) {
        let unit = &mut self.sheet.unit;
        unit.effects.retain(|known| known.id != setting.id);
        if let Some(at) = unit.own_effects.iter().position(|own| own.id == setting.id) {
            let own = unit.own_effects.remove(at);
            unit.own_effects.push(own);
        }
        unit.effects.push(setting);
    }

    fn unknown_effect<'k>(&mut self, path: &[&str], known: impl Iterator<Item = &'k str>) {
        let known: Vec<&str> = known.collect();
        let near = path.last().and_then(|id| crate::params::nearest(id, known.iter().copied()));
        let hint = near.map_or_else(
            || format!("known are {}; an effect of your own needs `at` and `expression`", known.join(", ")),
            |near| format!("did you mean `{near}`?"),
        );
        self.problem(path, format!("unknown key; {hint}"));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::{EffectDefinition, EffectLaw, EffectParameter, Stage};
    use crate::params::sheet::Sheet;
    use crate::params::yaml;

    const CATALOGUE: &[EffectSpec] = &[EffectSpec::new(EffectDefinition {
        id: "backlash",
        stage: Stage::Servomotor,
        source: "",
        parameters: &[
            EffectParameter {
                name: "width_pu",
                unit: "pu",
                neutral: 0.0,
                min: 0.0,
                max: 0.1,
                typical: 0.01,
                scaling: Scaling::Fixed,
                doc: "",
            },
            EffectParameter {
                name: "delay_s",
                unit: "s",
                neutral: 0.0,
                min: 0.0,
                max: 1.0,
                typical: 0.1,
                scaling: Scaling::Fixed,
                doc: "",
            },
        ],
        apply: &EffectLaw(|_, _| {}),
    })];

    fn read(text: &str) -> (Vec<EffectSetting>, Vec<String>) {
        let document = yaml::parse(text).unwrap();
        let Node::Map(effects) = &document.root else { panic!("no effects in {text}") };
        let mut sheet = Sheet::blank();
        let (source, problems) = (String::new(), Vec::new());
        let mut merge = Merge { document: &document, file: None, sheet: &mut sheet, source, problems };
        for (id, node) in effects {
            merge.effect_of(CATALOGUE, "effects", id, node);
        }
        let problems = merge.problems.iter().map(ToString::to_string).collect();
        (sheet.unit.effects, problems)
    }

    #[test]
    fn what_is_not_given_is_neutral() {
        let (effects, problems) = read("backlash: {delay_s: 0.5}");
        assert_eq!(problems, Vec::<String>::new());
        assert_eq!(effects, [EffectSetting { id: "backlash".to_owned(), values: vec![0.0, 0.5] }]);
    }

    #[test]
    fn the_ends_of_every_range_are_read() {
        for spec in crate::effects::CATALOGUE {
            for parameter in spec.parameters {
                for end in [parameter.min, parameter.max] {
                    let text = format!("effects: {{{}: {{{}: {end:?}}}}}", spec.id, parameter.name);
                    let read = crate::params::sheet_over_reference(&text, std::path::Path::new("unit.yaml"));
                    assert_eq!(read.map(|sheet| sheet.unit.effects.len()), Ok(1), "{text}");
                }
            }
        }
    }

    #[test]
    fn slips_are_named() {
        let (effects, problems) = read("backlsh: {}\nbacklash: {width_pu: 2, delay: 0.1}");
        assert!(effects.is_empty());
        assert_eq!(
            problems,
            [
                "effects.backlsh: unknown key; did you mean `backlash`?",
                "effects.backlash.delay: unknown key; did you mean `delay_s`?",
                "effects.backlash.width_pu: 2.0 pu is outside the physical range, 0.0 to 0.1 pu",
            ]
        );
    }
}
