//! The only file that knows the YAML library: text in, a plain tree with line numbers out.

use std::collections::BTreeMap;

use serde_yaml::Value;

use govtwin_files::check_yaml;

/// A YAML value, reduced to what parameter files use.
#[derive(Clone, Debug, PartialEq)]
pub enum Node {
    /// Nothing, `~` or `null`.
    Null,
    /// `true` or `false`.
    Bool(bool),
    /// Any number, `.nan` and `.inf` included.
    Number(f64),
    /// Text, quoted or not.
    Text(String),
    /// A list; labels have them, parameter files do not.
    List(Vec<Node>),
    /// Keys and values in the order of the file.
    Map(Vec<(String, Node)>),
}

impl Node {
    /// What it is, in a reader's words.
    pub fn describe(&self) -> String {
        match self {
            Self::Null => "nothing".to_owned(),
            Self::Bool(value) => format!("the truth value {value}"),
            Self::Number(value) => format!("the number {value}"),
            Self::Text(text) => format!("the text \"{}\"", shorten(text)),
            Self::List(_) => "a list".to_owned(),
            Self::Map(_) => "a mapping".to_owned(),
        }
    }
}

/// The value of a key in a mapping.
pub fn get<'n>(map: &'n [(String, Node)], key: &str) -> Option<&'n Node> {
    map.iter().find(|(known, _)| known == key).map(|(_, node)| node)
}

/// Text in quotes: YAML's double-quoted text is a superset of JSON's.
pub fn quoted(text: &str) -> String {
    serde_json::Value::from(text).to_string()
}

fn shorten(text: &str) -> String {
    const LONGEST: usize = 40;
    let mut short: String = text.chars().take(LONGEST).flat_map(char::escape_debug).collect();
    if text.chars().nth(LONGEST).is_some() {
        short.push('…');
    }
    short
}

/// A parsed file.
#[derive(Clone, Debug)]
pub struct Document {
    /// Top level of the file.
    pub root: Node,
    lines: BTreeMap<Vec<String>, usize>,
}

impl Document {
    /// The text of a key at the top of the file.
    pub fn text(&self, key: &str) -> Option<&str> {
        let Node::Map(map) = &self.root else { return None };
        map.iter().find_map(|(known, node)| match node {
            Node::Text(text) if known == key => Some(text.as_str()),
            _ => None,
        })
    }

    /// Line of a key given by its path, counted from 1; of the nearest parent where the key shares a line.
    pub fn line(&self, path: &[&str]) -> Option<usize> {
        let path: Vec<String> = path.iter().map(|key| (*key).to_owned()).collect();
        (1..=path.len()).rev().find_map(|length| self.lines.get(path.get(..length)?).copied())
    }
}

/// Text that is not YAML, or more of it than is read.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SyntaxError {
    /// Where, counted from 1.
    pub line: Option<usize>,
    /// What is wrong.
    pub message: String,
}

/// Parses one document.
///
/// # Errors
/// Where the text is no YAML.
pub fn parse(text: &str) -> Result<Document, SyntaxError> {
    check_yaml(text).map_err(|error| SyntaxError { line: None, message: error.to_string() })?;
    match serde_yaml::from_str::<Value>(text) {
        Ok(value) => Ok(Document { root: convert(value), lines: locate(text) }),
        Err(error) => {
            let line = error.location().map(|location| location.line());
            Err(SyntaxError { line, message: format!("this is not YAML: {error}") })
        }
    }
}

fn convert(value: Value) -> Node {
    match value {
        Value::Null => Node::Null,
        Value::Bool(value) => Node::Bool(value),
        Value::Number(value) => Node::Number(value.as_f64().unwrap_or(f64::NAN)),
        Value::String(text) => Node::Text(text),
        Value::Sequence(items) => Node::List(items.into_iter().map(convert).collect()),
        Value::Mapping(mapping) => {
            Node::Map(mapping.into_iter().map(|(key, value)| (key_text(&key), convert(value))).collect())
        }
        Value::Tagged(tagged) => Node::Text(tagged.tag.to_string()),
    }
}

fn key_text(key: &Value) -> String {
    match key {
        Value::String(text) => text.clone(),
        Value::Number(number) => number.to_string(),
        Value::Bool(value) => value.to_string(),
        other => convert(other.clone()).describe(),
    }
}

/// Paths and lines of all keys that begin a line.
///
/// The YAML library keeps no positions of values, so indentation is followed here. Keys inside braces
/// have no line of their own; [`Document::line`] then answers with the line of their parent.
fn locate(text: &str) -> BTreeMap<Vec<String>, usize> {
    let mut open: Vec<(usize, String)> = Vec::new();
    let mut found = BTreeMap::new();
    for (index, line) in text.lines().enumerate() {
        let content = line.trim_start();
        let Some((key, _)) = content.split_once(':') else { continue };
        if content.starts_with('#') {
            continue;
        }
        let indent = line.len() - content.len();
        while open.last().is_some_and(|(outer, _)| *outer >= indent) {
            open.pop();
        }
        open.push((indent, key.trim().trim_matches(['"', '\'']).to_owned()));
        // Of a key that stands twice the first line counts.
        found.entry(open.iter().map(|(_, key)| key.clone()).collect()).or_insert(index + 1);
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_know_their_lines() {
        let document = parse("# head\na:\n  b: 1\n\n  c: {d: 2}\n'e': x\n").unwrap();
        assert_eq!(document.line(&["a"]), Some(2));
        assert_eq!(document.line(&["a", "b"]), Some(3));
        assert_eq!(document.line(&["a", "c", "d"]), Some(5));
        assert_eq!(document.line(&["e"]), Some(6));
        assert_eq!(document.line(&["z"]), None);
    }

    #[test]
    fn syntax_errors_name_the_line() {
        let error = parse("a: 1\nb: [1, 2\nc: 3\n").unwrap_err();
        assert!(error.line.is_some(), "{error:?}");
    }

    #[test]
    fn a_key_given_twice_is_an_error() {
        let error = parse("a:\n  b: 1\n  b: 2\n").unwrap_err();
        assert!(error.message.contains("duplicate"), "{error:?}");
    }
}
