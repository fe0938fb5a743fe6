//! An effect of the owner's in a file: where it acts, its expression, its parameters.

use crate::effects::own::{self, OwnError};
use crate::parameters::{EffectSetting, OwnEffect, OwnParameter};
use crate::params::suggest::nearest;
use crate::params::yaml::Node;

use super::{Mapping, Merge, get};

/// Attributes of a definition.
const KEYS: [&str; 5] = ["at", "stage", "doc", "expression", "parameters"];
/// Attributes of one of its parameters.
const PARAMETER_KEYS: [&str; 7] = ["unit", "neutral", "min", "max", "typical", "value", "doc"];
/// Any number that a file can hold.
const ANY: (f64, f64) = (f64::MIN, f64::MAX);

impl Merge<'_> {
    pub(super) fn own_effect(&mut self, section: &str, id: &str, map: &Mapping) {
        let path = [section, id];
        let before = self.problems.len();
        self.attributes(&path, map, &KEYS);
        let mut own = OwnEffect {
            id: id.to_owned(),
            doc: self.words(&[section, id, "doc"], map).unwrap_or_default(),
            at: self.words(&[section, id, "at"], map).unwrap_or_default(),
            stage: self.words(&[section, id, "stage"], map).unwrap_or_default(),
            expression: self.words(&[section, id, "expression"], map).unwrap_or_default(),
            parameters: Vec::new(),
        };
        for (key, text) in [("at", &own.at), ("expression", &own.expression)] {
            if text.is_empty() && self.problems.len() == before {
                self.problem(&path, format!("an effect of your own needs `{key}`"));
            }
        }
        let mut values = Vec::new();
        match get(map, "parameters") {
            Some(Node::Map(parameters)) => {
                for (name, node) in parameters {
                    let read = self.own_parameter([section, id, "parameters", name], node);
                    if let Some((parameter, value)) = read {
                        own.parameters.push(parameter);
                        values.push(value);
                    }
                }
            }
            _ => self.problem(&path, "an effect of your own needs `parameters`, each with `min`, `max` and `typical`"),
        }
        if self.problems.len() > before {
            return;
        }
        if let Err(error) = own::spec(&own) {
            let key: Vec<&str> =
                path.into_iter().chain(error.key().split('.')).filter(|part| !part.is_empty()).collect();
            return self.problem(&key, with_hint(&error));
        }
        self.sheet.unit.own_effects.retain(|known| known.id != own.id);
        self.sheet.unit.own_effects.push(own);
        self.set_effect(EffectSetting { id: id.to_owned(), values });
        self.record(&path, None);
    }

    fn own_parameter(&mut self, path: [&str; 4], node: &Node) -> Option<(OwnParameter, f64)> {
        let name = path[3];
        let Node::Map(map) = node else {
            let found = node.describe();
            self.problem(&path, format!("expected `{{unit: …, min: …, max: …, typical: …}}`, found {found}"));
            return None;
        };
        for (key, _) in map.iter().filter(|(key, _)| !PARAMETER_KEYS.contains(&key.as_str())) {
            self.unknown(&[path[0], path[1], path[2], name, key], PARAMETER_KEYS);
        }
        let text = |merge: &mut Self, key| merge.words(&[path[0], path[1], path[2], name, key], map);
        let unit = match get(map, "unit") {
            // `unit: 1` is how people write that there is none.
            Some(Node::Number(1.0)) => "1".to_owned(),
            _ => text(self, "unit").unwrap_or_else(|| "1".to_owned()),
        };
        let doc = text(self, "doc").unwrap_or_default();
        let number = |merge: &mut Self, key, range| {
            let path = [path[0], path[1], path[2], name, key];
            get(map, key).map(|node| merge.number(&path, node, &unit, range))
        };
        let neutral = number(self, "neutral", ANY).unwrap_or(Some(0.0))?;
        let [min, max, typical] = ["min", "max", "typical"].map(|key| {
            number(self, key, ANY).unwrap_or_else(|| {
                self.problem(&path, format!("needs `{key}`: a fit must know how far it may go and with what step"));
                None
            })
        });
        let (min, max, typical) = (min?, max?, typical?);
        let value = number(self, "value", (min, max)).unwrap_or(Some(neutral))?;
        Some((OwnParameter { name: name.to_owned(), unit, neutral, min, max, typical, doc }, value))
    }

    /// The text under the last key of a path.
    fn words(&mut self, path: &[&str], map: &Mapping) -> Option<String> {
        match get(map, path.last()?)? {
            Node::Text(text) => Some(text.split_whitespace().collect::<Vec<_>>().join(" ")),
            Node::Number(number) => Some(number.to_string()),
            other => {
                let found = other.describe();
                self.problem(path, format!("takes text, not {found}"));
                None
            }
        }
    }
}

/// What is wrong, with the nearest known word where there is one.
fn with_hint(error: &OwnError) -> String {
    let near = match error {
        OwnError::Unknown { found, known, .. } => nearest(found, known.iter().copied()),
        OwnError::Name { found, known } => nearest(found, known.iter().map(String::as_str)),
        OwnError::At { .. } => None,
    };
    match (near, error) {
        (Some(near), OwnError::Unknown { found, .. } | OwnError::Name { found, .. }) => {
            format!("`{found}` is not known here; did you mean `{near}`?")
        }
        _ => error.to_string(),
    }
}
