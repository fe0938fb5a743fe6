//! One parameter of a file: a bare number, or a value with its tolerance, unit and source.

use crate::parameters::{ENTRIES, ParameterEntry, Tolerance};
use crate::params::suggest::nearest;
use crate::params::yaml::Node;

use super::{Mapping, Merge, get, name_of, section_of, unit_words};

/// Attributes of one parameter.
const KEYS: [&str; 6] = ["value", "tol", "abs", "log", "unit", "source"];
/// A share or a logarithm beyond this is no information about a value.
const LARGEST_SPREAD: f64 = 3.0;

impl Merge<'_> {
    pub(super) fn parameter(&mut self, section: &str, name: &str, node: &Node) {
        let path = [section, name];
        let found = ENTRIES.iter().zip(0..).find(|(entry, _)| section_of(entry) == section && name_of(entry) == name);
        let Some((entry, index)) = found else {
            return self.problem(&path, format!("unknown key; {}", hint(section, name)));
        };
        let index: usize = index;
        let before = self.problems.len();
        let range = (entry.min, entry.max);
        let old = self.sheet.unit.tolerances.get(index).copied().flatten();
        let (value, tolerance, source) = match node {
            Node::Map(map) => {
                self.attributes(&path, map, &KEYS);
                self.unit(&path, map, entry.unit);
                let value = get(map, "value").and_then(|value| self.number(&path, value, entry.unit, range));
                (value, self.tolerance(&path, map, entry, old), self.source(&path, map))
            }
            other => (self.number(&path, other, entry.unit, range), old, None),
        };
        if self.problems.len() > before {
            return;
        }
        if let Some(value) = value {
            (entry.set)(&mut self.sheet.unit.parameters, value);
        }
        if let Some(slot) = self.sheet.unit.tolerances.get_mut(index) {
            *slot = tolerance;
        }
        if matches!(tolerance, Some(Tolerance::Relative(_))) && (entry.get)(&self.sheet.unit.parameters) == 0.0 {
            return self.problem(&path, "a share of 0 is 0; give `tol` in the value's own unit and add `abs: true`");
        }
        self.record(&path, source);
    }

    /// The tolerance after this file: `old` if the file does not state it.
    fn tolerance(
        &mut self,
        path: &[&str; 2],
        map: &Mapping,
        entry: &ParameterEntry,
        old: Option<Tolerance>,
    ) -> Option<Tolerance> {
        let absolute = self.flag(path, map, "abs");
        let logarithmic = self.flag(path, map, "log");
        let Some(node) = get(map, "tol") else {
            if absolute || logarithmic {
                self.problem(path, "`abs` and `log` say how to read `tol`, which is missing; add it");
            }
            return old;
        };
        if *node == Node::Null {
            return None;
        }
        let path = [path[0], path[1], "tol"];
        if absolute && logarithmic {
            self.problem(&path, "`abs: true` and `log: true` exclude each other; keep one");
            return old;
        }
        let (unit, largest) = if absolute { (entry.unit, entry.max - entry.min) } else { ("1", LARGEST_SPREAD) };
        let spread = self.number(&path, node, unit, (0.0, largest))?;
        if spread == 0.0 {
            self.problem(&path, "a tolerance of 0 says nothing; `tol: ~` takes a tolerance away");
        }
        Some(match (absolute, logarithmic) {
            (true, _) => Tolerance::Absolute(spread),
            (_, true) => Tolerance::LogNormal(spread),
            _ => Tolerance::Relative(spread),
        })
    }
}

fn hint(section: &str, name: &str) -> String {
    let names = || ENTRIES.iter().filter(|entry| section_of(entry) == section).map(name_of);
    // The exact name in another section is a likelier slip than a like name in this one.
    let elsewhere = ENTRIES.iter().find(|entry| name_of(entry) == name);
    let near = elsewhere.or_else(|| {
        let near = nearest(name, names())?;
        ENTRIES.iter().find(|entry| section_of(entry) == section && name_of(entry) == near)
    });
    match near {
        Some(entry) => format!("did you mean `{}`{}?", entry.key, unit_words(entry.unit)),
        None => format!("{section} has {}", names().collect::<Vec<_>>().join(", ")),
    }
}
