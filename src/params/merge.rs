//! Lays what one file says over a sheet, and collects everything that is wrong with it.

use std::path::Path;

use crate::effects::{CATALOGUE, EffectSpec};
use crate::parameters::{ENTRIES, EffectSetting, Entry, Sensor, Tolerance};

use super::error::Problem;
use super::sheet::{Origin, SENSOR_ENTRIES, SensorEntry, Sheet};
use super::suggest::nearest;
use super::yaml::{Document, Node};

/// Keys at the top of a file beside the sections of parameters.
const TOP_KEYS: [&str; 5] = ["name", "base", "source", "sensors", "effects"];
/// Attributes of one parameter.
const PARAMETER_KEYS: [&str; 6] = ["value", "tol", "abs", "log", "unit", "source"];
/// Attributes of one transducer.
const SENSOR_KEYS: [&str; 4] = ["noise", "step", "unit", "source"];
/// A share or a logarithm beyond this says nothing about a value any more.
const LARGEST_SPREAD: f64 = 3.0;

/// Lays `document` over `sheet`; returns every problem, in the order of the file.
pub(super) fn merge(document: &Document, file: Option<&Path>, sheet: &mut Sheet) -> Vec<Problem> {
    let mut merge = Merge { document, file, sheet, source: String::new(), problems: Vec::new() };
    merge.file();
    merge.problems
}

struct Merge<'a> {
    document: &'a Document,
    file: Option<&'a Path>,
    sheet: &'a mut Sheet,
    /// What the file names as the source of all its values.
    source: String,
    problems: Vec<Problem>,
}

impl Merge<'_> {
    fn problem(&mut self, path: &[&str], message: impl Into<String>) {
        let line = self.document.line(path);
        self.problems.push(Problem { line, key: path.join("."), message: message.into() });
    }

    fn unknown(&mut self, path: &[&str], hint: &str) {
        self.problem(path, format!("unknown key; {hint}"));
    }

    fn record(&mut self, path: &[&str], source: Option<String>) {
        let origin = Origin {
            file: self.file.map(Path::to_path_buf),
            line: self.document.line(path),
            source: source.unwrap_or_else(|| self.source.clone()),
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
        // The source of all values comes first, wherever in the file it stands.
        for (key, node) in map {
            match (key.as_str(), node) {
                ("source", Node::Text(text)) => self.source.clone_from(text),
                ("name", Node::Text(text)) => self.sheet.name.clone_from(text),
                ("base", Node::Text(_)) => {}
                ("source" | "name" | "base", other) => {
                    let found = other.describe();
                    self.problem(&[key], format!("takes text, not {found}"));
                }
                _ => {}
            }
        }
        for (key, node) in map {
            match key.as_str() {
                "name" | "base" | "source" => {}
                "sensors" => self.section(key, node, Self::sensor),
                "effects" => self.section(key, node, Self::effect),
                section if sections().any(|known| known == section) => self.section(key, node, Self::parameter),
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
        if let Some(entry) = ENTRIES.iter().find(|entry| name_of(entry) == key || entry.key == key) {
            let (section, name) = (section_of(entry), name_of(entry));
            return self.unknown(&[key], &format!("write `{name}:` indented below `{section}:`"));
        }
        let hint = nearest(key, sections().chain(TOP_KEYS)).map_or_else(
            || format!("known are {}", sections().chain(TOP_KEYS).collect::<Vec<_>>().join(", ")),
            |near| format!("did you mean `{near}`?"),
        );
        self.unknown(&[key], &hint);
    }

    fn parameter(&mut self, section: &str, name: &str, node: &Node) {
        let path = [section, name];
        let found =
            ENTRIES.iter().enumerate().find(|(_, entry)| section_of(entry) == section && name_of(entry) == name);
        let Some((index, entry)) = found else {
            return self.unknown(&path, &parameter_hint(section, name));
        };
        let before = self.problems.len();
        let (value, source) = match node {
            Node::Map(map) => {
                self.attributes(&path, map, &PARAMETER_KEYS);
                self.unit(&path, get(map, "unit"), entry.unit);
                let value = get(map, "value").map(|value| (value, ["value"]));
                let value = value.map(|(value, _)| self.number(&path, value, entry));
                let tolerance = self.tolerance(&path, map, entry);
                if let (Some(tolerance), true) = (tolerance, self.problems.len() == before)
                    && let Some(slot) = self.sheet.unit.tolerances.get_mut(index)
                {
                    *slot = tolerance;
                }
                (value.flatten(), self.text(&path, map, "source"))
            }
            other => (self.number(&path, other, entry), None),
        };
        if self.problems.len() > before {
            return;
        }
        if let Some(value) = value {
            (entry.set)(&mut self.sheet.unit.parameters, value);
        }
        self.record(&path, source);
    }

    /// A number in an entry's range.
    fn number(&mut self, path: &[&str], node: &Node, entry: &Entry) -> Option<f64> {
        self.ranged(path, node, entry.unit, entry.min, entry.max)
    }

    fn ranged(&mut self, path: &[&str], node: &Node, unit: &str, min: f64, max: f64) -> Option<f64> {
        let what = unit_words(unit);
        let Node::Number(value) = *node else {
            let hint = match node {
                Node::Text(_) => "; write the number alone, without quotes, unit or separators",
                Node::Null => "; write one, or remove the key to keep what it overlays",
                _ => "",
            };
            self.problem(path, format!("expected a number{what}, found {}{hint}", node.describe()));
            return None;
        };
        if !(min..=max).contains(&value) {
            self.problem(
                path,
                format!("{value}{unit} is outside the physical range, {min} to {max}{unit}", unit = unit_suffix(unit)),
            );
            return None;
        }
        Some(value)
    }

    /// `None` where the file does not speak of it; `Some(None)` where it takes the tolerance away.
    fn tolerance(&mut self, path: &[&str; 2], map: &[(String, Node)], entry: &Entry) -> Option<Option<Tolerance>> {
        let absolute = self.flag(path, map, "abs");
        let logarithmic = self.flag(path, map, "log");
        let kind = match (absolute, logarithmic) {
            (true, true) => {
                self.problem(path, "`abs: true` and `log: true` exclude each other; keep one");
                return None;
            }
            (true, false) => "abs",
            (false, true) => "log",
            (false, false) => "",
        };
        let Some(node) = get(map, "tol") else {
            if !kind.is_empty() {
                self.problem(path, format!("`{kind}: true` says how to read `tol`, which is missing; add it"));
            }
            return None;
        };
        if *node == Node::Null {
            return Some(None);
        }
        let path = [path[0], path[1], "tol"];
        let (unit, max) = if absolute { (entry.unit, entry.max - entry.min) } else { ("1", LARGEST_SPREAD) };
        let spread = self.ranged(&path, node, unit, 0.0, max)?;
        if spread == 0.0 {
            self.problem(&path, "a tolerance of 0 allows nothing; write `tol: ~` for a value that is known exactly");
            return None;
        }
        Some(Some(match kind {
            "abs" => Tolerance::Absolute(spread),
            "log" => Tolerance::LogNormal(spread),
            _ => Tolerance::Relative(spread),
        }))
    }

    fn sensor(&mut self, section: &str, name: &str, node: &Node) {
        let path = [section, name];
        let Some(entry) = SENSOR_ENTRIES.iter().find(|entry| entry.name == name) else {
            let hint = nearest(name, SENSOR_ENTRIES.iter().map(|entry| entry.name)).map_or_else(
                || format!("known are {}", list(SENSOR_ENTRIES.iter().map(|entry| entry.name))),
                |near| format!("did you mean `{near}`?"),
            );
            return self.unknown(&path, &hint);
        };
        let Node::Map(map) = node else {
            let found = node.describe();
            return self.problem(&path, format!("expected `{{noise: …, step: …}}` in {}, found {found}", entry.unit));
        };
        let before = self.problems.len();
        self.attributes(&path, map, &SENSOR_KEYS);
        self.unit(&path, get(map, "unit"), entry.unit);
        let source = self.text(&path, map, "source");
        let old = (entry.get)(&self.sheet.unit.sensors);
        let noise = self.sensor_value(entry, &[section, name, "noise"], map).unwrap_or(old.noise);
        let step = self.sensor_value(entry, &[section, name, "step"], map).unwrap_or(old.step);
        if self.problems.len() == before {
            (entry.set)(&mut self.sheet.unit.sensors, Sensor { noise, step });
            self.record(&path, source);
        }
    }

    fn sensor_value(&mut self, entry: &SensorEntry, path: &[&str; 3], map: &[(String, Node)]) -> Option<f64> {
        let node = get(map, path[2])?;
        self.ranged(path, node, entry.unit, 0.0, entry.max)
    }

    fn effect(&mut self, section: &str, id: &str, node: &Node) {
        self.effect_of(CATALOGUE, section, id, node);
    }

    /// Reads one effect by its specification; the catalogue is an argument so that tests can bring their own.
    fn effect_of(&mut self, catalogue: &[EffectSpec], section: &str, id: &str, node: &Node) {
        let path = [section, id];
        let Some(spec) = catalogue.iter().find(|spec| spec.id == id) else {
            let hint = nearest(id, catalogue.iter().map(|spec| spec.id)).map_or_else(
                || match catalogue {
                    [] => "this version knows no effects yet; remove it".to_owned(),
                    _ => format!("known are {}", list(catalogue.iter().map(|spec| spec.id))),
                },
                |near| format!("did you mean `{near}`?"),
            );
            return self.problem(&path, format!("unknown effect; {hint}"));
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
            let value = match get(map, parameter.name) {
                Some(node) => self.ranged(&path, node, parameter.unit, parameter.min, parameter.max),
                None => Some(parameter.neutral),
            };
            values.extend(value);
        }
        if self.problems.len() == before {
            let effects = &mut self.sheet.unit.effects;
            effects.retain(|setting| setting.id != id);
            effects.push(EffectSetting { id: id.to_owned(), values });
            self.record(&path, None);
        }
    }

    fn attributes(&mut self, path: &[&str; 2], map: &[(String, Node)], known: &[&str]) {
        for (key, _) in map.iter().filter(|(key, _)| !known.contains(&key.as_str())) {
            let hint = nearest(key, known.iter().copied()).map_or_else(
                || format!("known here are {}", known.join(", ")),
                |near| format!("did you mean `{near}`?"),
            );
            self.unknown(&[path[0], path[1], key], &hint);
        }
    }

    fn unit(&mut self, path: &[&str], found: Option<&Node>, expected: &str) {
        let found = match found {
            None => return,
            Some(Node::Text(text)) if text == expected => return,
            Some(Node::Number(number)) if number.to_string() == expected => return,
            Some(Node::Text(text)) => format!("\"{text}\""),
            Some(other) => other.describe(),
        };
        self.problem(
            path,
            format!(
                "expected the unit \"{expected}\", found {found}; convert the value, units are never converted here"
            ),
        );
    }

    fn flag(&mut self, path: &[&str; 2], map: &[(String, Node)], key: &str) -> bool {
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

    fn text(&mut self, path: &[&str; 2], map: &[(String, Node)], key: &str) -> Option<String> {
        match get(map, key)? {
            Node::Text(text) => Some(text.clone()),
            other => {
                let found = other.describe();
                self.problem(&[path[0], path[1], key], format!("takes text, not {found}"));
                None
            }
        }
    }
}

fn get<'n>(map: &'n [(String, Node)], key: &str) -> Option<&'n Node> {
    map.iter().find(|(known, _)| known == key).map(|(_, node)| node)
}

fn section_of(entry: &Entry) -> &'static str {
    entry.key.split_once('.').map_or("", |(section, _)| section)
}

fn name_of(entry: &Entry) -> &'static str {
    entry.key.split_once('.').map_or("", |(_, name)| name)
}

/// The sections of parameters, in order, each once.
fn sections() -> impl Iterator<Item = &'static str> {
    let mut last = "";
    ENTRIES.iter().map(section_of).filter(move |section| std::mem::replace(&mut last, section) != *section)
}

fn parameter_hint(section: &str, name: &str) -> String {
    let here = || ENTRIES.iter().filter(|entry| section_of(entry) == section);
    let elsewhere = ENTRIES.iter().find(|entry| name_of(entry) == name);
    let near = elsewhere.or_else(|| {
        let near = nearest(name, here().map(name_of))?;
        here().find(|entry| name_of(entry) == near)
    });
    match near {
        Some(entry) => format!("did you mean `{}`{}?", entry.key, unit_words(entry.unit)),
        None => format!("{section} has {}", list(here().map(name_of))),
    }
}

fn list<'a>(names: impl Iterator<Item = &'a str>) -> String {
    names.collect::<Vec<_>>().join(", ")
}

fn unit_words(unit: &str) -> String {
    if unit == "1" { " without unit".to_owned() } else { format!(" in {unit}") }
}

fn unit_suffix(unit: &str) -> String {
    if unit == "1" { String::new() } else { format!(" {unit}") }
}
