//! One effect of a file, read by its specification in the catalogue.

use crate::effects::{CATALOGUE, EffectSpec};
use crate::parameters::EffectSetting;
use crate::params::yaml::Node;

use super::{Merge, get};

impl Merge<'_> {
    pub(super) fn effect(&mut self, section: &str, id: &str, node: &Node) {
        self.effect_of(CATALOGUE, section, id, node);
    }

    /// The catalogue is an argument so that tests can bring their own.
    fn effect_of(&mut self, catalogue: &[EffectSpec], section: &str, id: &str, node: &Node) {
        let path = [section, id];
        let Some(spec) = catalogue.iter().find(|spec| spec.id == id) else {
            return self.unknown(&path, catalogue.iter().map(|spec| spec.id));
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
            let path = [section, id, parameter.name];
            values.extend(match get(map, parameter.name) {
                Some(node) => self.number(&path, node, parameter.unit, (parameter.min, parameter.max)),
                None => Some(parameter.neutral),
            });
        }
        if self.problems.len() == before {
            let effects = &mut self.sheet.unit.effects;
            effects.retain(|setting| setting.id != id);
            effects.push(EffectSetting { id: id.to_owned(), values });
            self.record(&path, None);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::{EffectParameter, Stage};
    use crate::params::sheet::Sheet;
    use crate::params::yaml;

    const CATALOGUE: &[EffectSpec] = &[EffectSpec {
        id: "backlash",
        stage: Stage::Servomotor,
        source: "",
        parameters: &[
            EffectParameter { name: "width_pu", unit: "pu", neutral: 0.0, min: 0.0, max: 0.1, typical: 0.01, doc: "" },
            EffectParameter { name: "delay_s", unit: "s", neutral: 0.0, min: 0.0, max: 1.0, typical: 0.1, doc: "" },
        ],
        apply: |_, _| {},
    }];

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
