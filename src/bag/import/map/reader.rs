//! Values of a map by their kinds: texts, numbers, pairs, letters; what is none of them is gathered with its line.

use govtwin_model::params::yaml::{Document, Node, get};
use govtwin_model::params::{FileProblem, nearest};

pub(super) type Pairs = [(String, Node)];

/// Reads what stands below the keys, and gathers what is wrong.
pub(super) struct Reader<'a> {
    pub(super) document: &'a Document,
    pub(super) problems: Vec<FileProblem>,
}

impl<'a> Reader<'a> {
    pub(super) fn say(&mut self, path: &[&str], message: impl Into<String>) {
        let line = self.document.line(path);
        self.problems.push(FileProblem { line, key: path.join("."), message: message.into() });
    }

    pub(super) fn expected(&mut self, path: &[&str], expected: &str, found: &Node) {
        self.say(path, format!("expected {expected}, found {}", found.describe()));
    }

    /// The pairs below a key; keys that are not known are problems.
    pub(super) fn pairs(
        &mut self,
        node: &'a Node,
        path: &[&str],
        known: impl Iterator<Item = &'static str>,
    ) -> &'a Pairs {
        let Node::Map(pairs) = node else {
            self.expected(path, "keys and values", node);
            return &[];
        };
        let known: Vec<&str> = known.collect();
        for (key, _) in pairs.iter().filter(|(key, _)| !known.contains(&key.as_str())) {
            let hint = match nearest(key, known.iter().copied()) {
                Some(near) => format!("did you mean `{near}`?"),
                None => format!("expected one of {}", known.join(", ")),
            };
            let path: Vec<&str> = path.iter().copied().chain([key.as_str()]).collect();
            self.say(&path, format!("there is no such key; {hint}"));
        }
        pairs
    }

    pub(super) fn text(&mut self, pairs: &'a Pairs, path: &[&str], key: &str) -> Option<String> {
        match get(pairs, key)? {
            Node::Text(text) => Some(text.clone()),
            Node::Number(number) => Some(number.to_string()),
            Node::Bool(value) => Some(value.to_string()),
            Node::Null => None,
            other => {
                self.expected(&with(path, key), "a text", other);
                None
            }
        }
    }

    pub(super) fn number(&mut self, pairs: &'a Pairs, path: &[&str], key: &str) -> Option<f64> {
        match get(pairs, key)? {
            Node::Number(number) if number.is_finite() => Some(*number),
            other => {
                self.expected(&with(path, key), "a number", other);
                None
            }
        }
    }

    pub(super) fn positive(&mut self, pairs: &'a Pairs, path: &[&str], key: &str) -> Option<f64> {
        let number = self.number(pairs, path, key)?;
        if number > 0.0 {
            return Some(number);
        }
        self.say(&with(path, key), format!("expected a number above 0, found {number}"));
        None
    }

    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "checked to be a small whole number")]
    pub(super) fn line_number(&mut self, pairs: &'a Pairs, path: &[&str], key: &str) -> Option<u64> {
        let number = self.number(pairs, path, key)?;
        if number.fract() == 0.0 && (0.0..1e6).contains(&number) {
            return Some(number as u64);
        }
        self.say(&with(path, key), format!("expected the number of a line, counted from 1, found {number}"));
        None
    }

    pub(super) fn pair(&mut self, pairs: &'a Pairs, path: &[&str], key: &str) -> Option<[f64; 2]> {
        let node = get(pairs, key)?;
        if let Node::List(items) = node
            && let [Node::Number(from), Node::Number(to)] = items[..]
            && from.is_finite()
            && to.is_finite()
        {
            return Some([from, to]);
        }
        self.expected(&with(path, key), "two numbers, `[from, to]`", node);
        None
    }

    /// One character; `tab` and `space` go by name.
    pub(super) fn letter(&mut self, pairs: &'a Pairs, path: &[&str], key: &str, allowed: &str) -> Option<char> {
        let text = self.text(pairs, path, key)?;
        let letter = match text.as_str() {
            "tab" | "\\t" => '\t',
            "space" => ' ',
            other => {
                let mut letters = other.chars();
                match (letters.next(), letters.next()) {
                    (Some(letter), None) => letter,
                    _ => '\0',
                }
            }
        };
        if letter != '\0' && (allowed.is_empty() || allowed.contains(letter)) && letter.is_ascii() {
            return Some(letter);
        }
        let allowed: Vec<String> = allowed.chars().map(|letter| format!("`{letter}`")).collect();
        let expected = if allowed.is_empty() { "one character, `tab` or `space`".into() } else { allowed.join(" or ") };
        self.say(&with(path, key), format!("expected {expected}, found `{text}`"));
        None
    }

    /// A text, or a list of them.
    pub(super) fn texts(&mut self, pairs: &'a Pairs, path: &[&str], key: &str) -> Vec<String> {
        let one = |node: &Node| match node {
            Node::Text(text) => Some(text.clone()),
            Node::Number(number) => Some(number.to_string()),
            Node::Bool(value) => Some(value.to_string()),
            _ => None,
        };
        let Some(node) = get(pairs, key) else { return vec![] };
        let found: Option<Vec<String>> = match node {
            Node::List(items) => items.iter().map(one).collect(),
            other => one(other).map(|text| vec![text]),
        };
        if found.is_none() {
            self.expected(&with(path, key), "a text, or a list of texts", node);
        }
        found.unwrap_or_default()
    }
}

pub(super) fn with<'a>(path: &[&'a str], key: &'a str) -> Vec<&'a str> {
    path.iter().copied().chain([key]).collect()
}
