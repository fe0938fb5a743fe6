//! One effect of a file, read by its specification in the catalogue or by the owner's own.

use crate::effects::{CATALOGUE, Scaling, find_in};
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
            _ => self.known_effect(section, id, node),
        }
    }

    fn known_effect(&mut self, section: &str, id: &str, node: &Node) {
        let path = [section, id];
        let Some(spec) = find_in(&self.sheet.unit, id) else {
            let own: Vec<String> = self.sheet.unit.own_effects.iter().map(|own| own.id.clone()).collect();
            let known = CATALOGUE.iter().map(|spec| spec.id).chain(own.iter().map(String::as_str));
            return self.unknown_or(&path, known, "; an effect of your own needs `at` and `expression`");
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
}
