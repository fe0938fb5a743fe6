//! Applies one file to a sheet, and collects everything that is wrong with it.

mod effect;
mod own_effect;
mod parameter;
mod recorded;
mod sensor;

use std::path::Path;

use crate::parameters::{ENTRIES, ParameterEntry};

use super::consistency;
use super::error::FileProblem;
use super::number::{number_text, quantity_text};
use super::sheet::{Origin, Sheet};
use super::suggest::nearest;
use super::yaml::{Document, Node, get};

/// Keys at the top of a file beside the sections of parameters.
const TOP_KEYS: [&str; 6] = ["name", "base", "source", "sensors", "effects", "recorded"];

/// Lays `document` over `sheet`; returns every problem.
pub(super) fn merge(document: &Document, file: Option<&Path>, sheet: &mut Sheet) -> Vec<FileProblem> {
    let source = document.text("source").unwrap_or_default().to_owned();
    let mut merge = Merge { document, file, sheet, source, problems: Vec::new() };
    merge.file();
    merge.consistency();
    // In the order of the file; what has no line comes last.
    merge.problems.sort_by_key(|problem| problem.line.unwrap_or(usize::MAX));
    merge.problems
}

/// Whether a file holds a section that only parameter files have.
pub(super) fn has_sections(document: &Document) -> bool {
    let Node::Map(map) = &document.root else { return false };
    let known = || sections().chain(["base", "sensors", "effects", "recorded"]);
    map.iter().any(|(key, _)| known().any(|known| known == key))
}

struct Merge<'a> {
    document: &'a Document,
    file: Option<&'a Path>,
    sheet: &'a mut Sheet,
    /// What the file names as the source of all its values.
    source: String,
    problems: Vec<FileProblem>,
}

impl Merge<'_> {
    fn problem(&mut self, path: &[&str], message: impl Into<String>) {
        let line = self.document.line(path);
        self.problems.push(FileProblem { line, key: path.join("."), message: message.into() });
    }

    fn unknown<'k>(&mut self, path: &[&str], known: impl IntoIterator<Item = &'k str>) {
        self.unknown_or(path, known, "");
    }

    /// The same; where no known key is near, `more` follows those known.
    fn unknown_or<'k>(&mut self, path: &[&str], known: impl IntoIterator<Item = &'k str>, more: &str) {
        let known: Vec<&str> = known.into_iter().collect();
        let near = path.last().and_then(|name| nearest(name, known.iter().copied()));
        let known = || format!("known are {}{more}", known.join(", "));
        let hint = near.map_or_else(known, |near| format!("did you mean `{near}`?"));
        self.problem(path, format!("unknown key; {hint}"));
    }

    fn record(&mut self, path: &[&str], source: Option<&str>) {
        let origin = Origin {
            file: self.file.map(Path::to_path_buf),
            line: self.document.line(path),
            source: source.unwrap_or(&self.source).to_owned(),
        };
        self.sheet.origins.insert(path.join("."), origin);
    }

    fn file(&mut self) {
        let document = self.document;
        let map = match &document.root {
            Node::Null => return,
            Node::Map(map) => map,
            other => {
                let found = other.describe();
                return self.problem(&[], format!("a parameter file holds sections such as `oil:`; this is {found}"));
            }
        };
        // Ranges of effects go with the unit's size.
        let (effects, unit): (Vec<_>, Vec<_>) = map.iter().partition(|(key, _)| key.as_str() == "effects");
        for (key, node) in unit.into_iter().chain(effects) {
            match (key.as_str(), node) {
                ("name", Node::Text(name)) => self.sheet.name.clone_from(name),
                ("base" | "source", Node::Text(_)) => {}
                ("name" | "base" | "source", other) => {
                    let found = other.describe();
                    self.problem(&[key], format!("takes text, not {found}"));
                }
                ("sensors", node) => self.section(key, node, Self::sensor),
                ("effects", node) => self.section(key, node, Self::effect),
                ("recorded", node) => self.section(key, node, Self::recorded),
                (section, node) if sections().any(|known| known == section) => {
                    self.section(key, node, Self::parameter);
                }
                _ => self.unknown_section(key),
            }
        }
    }

    fn section(&mut self, section: &str, node: &Node, each: fn(&mut Self, &str, &str, &Node)) {
        match node {
            Node::Map(map) => map.iter().for_each(|(name, value)| each(self, section, name, value)),
            other => {
                let found = other.describe();
                self.problem(&[section], format!("holds keys with values, one a line and indented; this is {found}"));
            }
        }
    }

    fn unknown_section(&mut self, key: &str) {
        // A parameter written without its section is the likelier slip where its name is exact.
        match ENTRIES.iter().find(|entry| name_of(entry) == key || entry.key == key) {
            Some(entry) => {
                let (section, name) = (section_of(entry), name_of(entry));
                self.problem(&[key], format!("unknown key; write `{name}:` indented below `{section}:`"));
            }
            None => self.unknown(&[key], sections().chain(TOP_KEYS)),
        }
    }

    /// A number within `min` and `max`.
    fn number(&mut self, path: &[&str], node: &Node, unit: &str, (min, max): (f64, f64)) -> Option<f64> {
        let Node::Number(value) = *node else {
            let hint = match node {
                Node::Text(_) => "; write the number alone, without quotes, unit or separators",
                Node::Null => "; write one, or remove the key to keep what lies below this file",
                _ => "",
            };
            self.problem(path, format!("expected a number{}, found {}{hint}", unit_words(unit), node.describe()));
            return None;
        };
        if (min..=max).contains(&value) {
            return Some(value);
        }
        let range = format!("{} to {}", number_text(min), quantity_text(max, unit));
        self.problem(path, format!("{} is outside the physical range, {range}", quantity_text(value, unit)));
        None
    }

    /// Refuses a unit that is not the expected one.
    fn unit(&mut self, path: &[&str], map: &Mapping, expected: &str) {
        let found = match get(map, "unit") {
            None => return,
            Some(Node::Text(text)) if text == expected => return,
            Some(Node::Number(number)) if number.to_string() == expected => return,
            Some(other) => other.describe(),
        };
        let hint = "nothing is converted here, so convert the value and write that unit";
        self.problem(path, format!("expected the unit \"{expected}\", found {found}; {hint}"));
    }

    fn flag(&mut self, path: &[&str; 2], map: &Mapping, key: &str) -> bool {
        match get(map, key) {
            None => false,
            Some(Node::Bool(value)) => *value,
            Some(other) => {
                let found = other.describe();
                self.problem(&[path[0], path[1], key], format!("takes true or false, not {found}"));
                false
            }
        }
    }

    fn source<'n>(&mut self, path: &[&str; 2], map: &'n Mapping) -> Option<&'n str> {
        match get(map, "source")? {
            Node::Text(text) => Some(text),
            other => {
                let found = other.describe();
                self.problem(&[path[0], path[1], "source"], format!("takes text, not {found}"));
                None
            }
        }
    }

    /// Refuses attributes that are not known.
    fn attributes(&mut self, path: &[&str; 2], map: &Mapping, known: &[&str]) {
        for (key, _) in map.iter().filter(|(key, _)| !known.contains(&key.as_str())) {
            self.unknown(&[path[0], path[1], key], known.iter().copied());
        }
    }

    /// Values that are each in range but do not go together.
    fn consistency(&mut self) {
        for conflict in consistency::conflicts(&self.sheet.unit.parameters) {
            // A value that was refused was not taken over, so a conflict over it would be about another number.
            let refused = |key: &&str| self.problems.iter().any(|problem| problem.key.starts_with(*key));
            if conflict.keys.iter().any(refused) {
                continue;
            }
            let line = conflict.keys.iter().find_map(|key| {
                let origin = self.sheet.origins.get(*key)?;
                if origin.file.as_deref() == self.file { origin.line } else { None }
            });
            self.problems.push(FileProblem { line, key: conflict.keys.join(", "), message: conflict.message });
        }
    }
}

type Mapping = [(String, Node)];

pub(super) fn section_of(entry: &ParameterEntry) -> &'static str {
    entry.key.split_once('.').map_or("", |(section, _)| section)
}

pub(super) fn name_of(entry: &ParameterEntry) -> &'static str {
    entry.key.split_once('.').map_or("", |(_, name)| name)
}

/// The sections of parameters, in order, each once.
fn sections() -> impl Iterator<Item = &'static str> {
    let mut last = "";
    ENTRIES.iter().map(section_of).filter(move |section| std::mem::replace(&mut last, section) != *section)
}

fn unit_words(unit: &str) -> String {
    if unit == "1" { " without unit".to_owned() } else { format!(" in {unit}") }
}
