//! Numbers of messages of any type by their paths, such as `/joint_states.position[servomotor]`.

use super::layout::Walk;
use super::topic::TopicInfo;
use crate::msg::Time;
use crate::msg::definition::{Count, Definition, Field, closure_of, parse_schema};

/// Types nested deeper than this are a circle, which no message can be.
const DEEPEST: usize = 24;
/// An array with more elements is no list of signals: only so many of it are listed.
const MOST_LISTED: u64 = 64;
/// Steps of a walk for each byte of a message.
const STEPS_PER_BYTE: usize = 32;

/// What a field holds.
#[derive(Clone, Debug, PartialEq)]
pub enum FieldValue {
    /// A number; truth values are 0 and 1.
    Number(f64),
    /// Text.
    Text(String),
}

/// The path of a value: `/topic.field.field[index]`, the index a number or, where names stand beside the array, a name.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FieldPath {
    /// The topic.
    pub topic: String,
    steps: Vec<FieldStep>,
}

#[derive(Clone, Debug, PartialEq, Eq)]
struct FieldStep {
    name: String,
    index: Option<Index>,
}

#[derive(Clone, Debug, PartialEq, Eq)]
enum Index {
    Number(u64),
    Name(String),
}

impl FieldPath {
    /// Reads a path.
    ///
    /// # Errors
    /// In words, where it is none.
    pub fn parse(text: &str) -> Result<Self, String> {
        let wanted = || format!("expected /topic.field or /topic.field[index], found `{text}`");
        let (topic, fields) = text.split_once('.').ok_or_else(wanted)?;
        if !topic.starts_with('/') || topic.len() < 2 {
            return Err(wanted());
        }
        // A name in brackets may hold a dot.
        let mut steps = vec![];
        let mut rest = fields;
        loop {
            let end = rest.find(['.', '[']).unwrap_or(rest.len());
            let (name, after) = rest.split_at(end);
            let (index, after) = match after.strip_prefix('[') {
                Some(inside) => {
                    let (index, after) = inside.split_once(']').ok_or_else(wanted)?;
                    (Some(index.parse().map_or_else(|_| Index::Name(index.to_owned()), Index::Number)), after)
                }
                None => (None, after),
            };
            if name.is_empty() {
                return Err(wanted());
            }
            steps.push(FieldStep { name: name.to_owned(), index });
            match after.strip_prefix('.') {
                Some(next) => rest = next,
                None if after.is_empty() => break,
                None => return Err(wanted()),
            }
        }
        Ok(Self { topic: topic.to_owned(), steps })
    }
}

/// Finds values in the messages of one topic.
#[derive(Clone, Debug)]
pub struct FieldReader {
    types: Vec<Definition>,
    stamped: bool,
}

impl FieldReader {
    /// For the messages of a topic.
    ///
    /// # Errors
    /// In words, where their definition is not known.
    pub fn new(topic: &TopicInfo) -> Result<Self, String> {
        if topic.encoding != "cdr" {
            return Err(format!("its messages are encoded as `{}`, expected `cdr`", topic.encoding));
        }
        let schema = std::str::from_utf8(&topic.schema).ok().filter(|_| topic.schema_encoding == "ros2msg");
        let types = match schema.map(|schema| parse_schema(&topic.type_name, schema)) {
            Some(Ok(types)) => types,
            _ => closure_of(&topic.type_name).map_err(|_| {
                format!("the bag holds no `ros2msg` definition of `{}`, by which its fields are found", topic.type_name)
            })?,
        };
        let stamped = types.first().and_then(|first| first.fields.first()).is_some_and(|first| {
            first.count == Count::One
                && ["std_msgs/msg/Header", "builtin_interfaces/msg/Time"].contains(&first.base.as_str())
        });
        Ok(Self { types, stamped })
    }

    /// Whether messages of this type can hold the path.
    ///
    /// # Errors
    /// In words, with the fields there are, where they cannot.
    pub fn check(&self, path: &FieldPath) -> Result<(), String> {
        let mut definition = self.types.first().ok_or("it has no fields")?;
        for (depth, step) in path.steps.iter().enumerate() {
            let type_name = &definition.type_name;
            let Some(field) = definition.fields.iter().find(|field| field.name == step.name) else {
                let names: Vec<&str> = definition.fields.iter().map(|field| field.name.as_str()).collect();
                return Err(format!("`{type_name}` has no field `{}`; it has {}", step.name, names.join(", ")));
            };
            match (field.count == Count::One, &step.index) {
                (true, Some(_)) => return Err(format!("`{}` is no array; leave out its index", step.name)),
                (false, None) => {
                    return Err(format!(
                        "`{}` is an array; name an element, `{0}[0]`, or by its name in the message, `{0}[NAME]`",
                        step.name
                    ));
                }
                _ => {}
            }
            let last = depth + 1 == path.steps.len();
            let nested = self.nested(&field.base);
            match nested {
                Some(nested) if last => {
                    let names: Vec<&str> = nested.fields.iter().map(|field| field.name.as_str()).collect();
                    return Err(format!("`{}` is a structure; go on with one of {}", step.name, names.join(", ")));
                }
                Some(nested) => definition = nested,
                None if last && (size_of(&field.base).is_some() || field.base == "string") => {}
                None if last => return Err(format!("`{}` is a `{}`, which is no number", step.name, field.base)),
                None => return Err(format!("`{}` is a `{}` and has no fields", step.name, field.base)),
            }
        }
        Ok(())
    }

    /// The primitive type at a path of plain names, `header.stamp.sec`; none where there is no single value.
    pub(super) fn base_of(&self, path: &str) -> Option<&str> {
        let mut definition = self.types.first()?;
        let mut names = path.split('.').peekable();
        while let Some(name) = names.next() {
            let field = definition.fields.iter().find(|field| field.name == name && field.count == Count::One)?;
            match self.nested(&field.base) {
                Some(nested) => definition = nested,
                None => return names.peek().is_none().then_some(field.base.as_str()),
            }
        }
        None
    }

    fn nested(&self, base: &str) -> Option<&Definition> {
        self.types.iter().find(|definition| definition.type_name == base)
    }

    /// The time of a message by its own header, ns; none if it has none, or 0.
    pub fn stamp_ns(&self, data: &[u8]) -> Option<i64> {
        if !self.stamped {
            return None;
        }
        let mut walk = Walk::over_message(data, 0)?;
        let time = Time { sec: walk.word()?.cast_signed(), nanosec: walk.word()? };
        time.nanos().filter(|time_ns| *time_ns != 0)
    }

    /// The value at a path; none where this message does not hold it.
    pub fn value(&self, path: &FieldPath, data: &[u8]) -> Option<FieldValue> {
        let mut found = None;
        self.visit(data, Some(path), &mut |_, value| found = Some(value))?;
        found
    }

    /// The value at a path, and what the message itself calls it, where the path names an element by its number and names stand beside it. A name that
    /// stands there twice comes without a value.
    pub fn element(&self, path: &FieldPath, data: &[u8]) -> (Option<FieldValue>, Option<String>) {
        let (mut found, mut called) = (None, None);
        let twice = self.visit(data, Some(path), &mut |name, value| {
            called = Some(name.to_owned()).filter(|name| !name.is_empty());
            found = Some(value);
        });
        let Some(twice) = twice else { return (None, None) };
        if twice.is_empty() { (found, called) } else { (None, Some(twice)) }
    }

    /// Every number and text of a message with its path below the topic, such as `position[servomotor]`.
    pub fn leaves(&self, data: &[u8]) -> Vec<(String, FieldValue)> {
        let mut found = vec![];
        let whole = self.visit(data, None, &mut |path, value| found.push((path.to_owned(), value)));
        if whole.is_some() { found } else { vec![] }
    }

    /// None where the message is cut short, else the name of the path that stands there twice, empty where none does.
    fn visit(&self, data: &[u8], path: Option<&FieldPath>, on_leaf: &mut OnLeaf<'_>) -> Option<String> {
        let steps = STEPS_PER_BYTE.saturating_mul(data.len().saturating_add(2));
        let walk = Walk::over_message(data, steps)?;
        let wanted = path.map(|path| path.steps.as_slice());
        let mut visit = Visit { reader: self, walk, names: vec![], twice: String::new(), on_leaf };
        visit.structure(self.types.first()?, wanted, "", 0)?;
        Some(visit.twice)
    }
}

type OnLeaf<'a> = dyn FnMut(&str, FieldValue) + 'a;

/// A walk over one message.
struct Visit<'a, 'b> {
    reader: &'a FieldReader,
    walk: Walk<'a>,
    /// Lists of texts that were passed in the structures that are open, by which elements are named.
    names: Vec<Vec<String>>,
    /// A name of the path that stands twice in its list.
    twice: String,
    on_leaf: &'b mut OnLeaf<'b>,
}

impl<'a> Visit<'a, '_> {
    /// Over a structure; `wanted` are the steps of a path that leads into it, none where all is wanted, empty where nothing is.
    fn structure(
        &mut self,
        definition: &'a Definition,
        wanted: Option<&[FieldStep]>,
        path: &str,
        depth: usize,
    ) -> Option<()> {
        if depth > DEEPEST {
            return None;
        }
        let open = self.names.len();
        for field in &definition.fields {
            let step = wanted.and_then(|steps| steps.first()).filter(|step| step.name == field.name);
            let below: Option<&[FieldStep]> = match wanted {
                None => None,
                Some(steps) if step.is_some() => Some(&steps[1..]),
                Some(_) => Some(&[]),
            };
            let all_or_this = wanted.is_none() || step.is_some();
            let here = if path.is_empty() { field.name.clone() } else { format!("{path}.{}", field.name) };
            self.field(field, (all_or_this, step, below), &here, depth)?;
        }
        if definition.fields.is_empty() {
            // An empty structure has one byte on the wire.
            self.walk.take(1)?;
        }
        self.names.truncate(open);
        Some(())
    }

    fn field(
        &mut self,
        field: &'a Field,
        (wanted, step, below): (bool, Option<&FieldStep>, Option<&[FieldStep]>),
        path: &str,
        depth: usize,
    ) -> Option<()> {
        let count = match field.count {
            Count::One => return self.one(&field.base, wanted, below, path, depth),
            Count::Exactly(count) => count,
            _ => u64::from(self.walk.word()?),
        };
        if !wanted && let Some(size) = size_of(&field.base).filter(|_| count > 0) {
            // Pictures and point clouds are not walked byte by byte.
            self.walk.take(size)?;
            return self.walk.skip(usize::try_from(count - 1).ok()?.checked_mul(size)?);
        }
        if field.base == "string" && !wanted {
            let mut names = vec![];
            for _ in 0..count {
                names.push(self.walk.text()?.to_owned());
            }
            self.names.push(names);
            return Some(());
        }
        let index = match step.and_then(|step| step.index.as_ref()) {
            Some(Index::Number(index)) => Some(*index),
            Some(Index::Name(name)) => {
                let of = |names: &Vec<String>| {
                    (0..).zip(names).filter(|(_, known)| *known == name).map(|(k, _)| k).collect()
                };
                let places: Vec<u64> =
                    self.names.iter().rev().map(of).find(|places: &Vec<u64>| !places.is_empty()).unwrap_or_default();
                if places.len() > 1 {
                    self.twice.clone_from(name);
                }
                Some(if let [place] = places[..] { place } else { u64::MAX })
            }
            None => None,
        };
        let numbered = matches!(step.and_then(|step| step.index.as_ref()), Some(Index::Number(_)));
        let mut texts = vec![];
        for k in 0..count {
            let this = wanted && index.is_none_or(|index| index == k) && (step.is_some() || k < MOST_LISTED);
            let name = || {
                let names = self.names.last().filter(|names| names.len() as u64 == count)?;
                let name = names.get(usize::try_from(k).ok()?)?;
                Some(name).filter(|_| numbered || names.iter().filter(|other| *other == name).count() == 1)
            };
            let here = match (this, step.is_some()) {
                (false, _) => String::new(),
                (true, true) => name().filter(|_| numbered).cloned().unwrap_or_default(),
                (true, false) => name().map_or_else(|| format!("{path}[{k}]"), |name| format!("{path}[{name}]")),
            };
            if field.base == "string" && step.is_none() {
                texts.push(self.walk.text()?.to_owned());
            } else {
                self.one(&field.base, this, if this { below } else { Some(&[]) }, &here, depth)?;
            }
        }
        if !texts.is_empty() {
            self.names.push(texts);
        }
        Some(())
    }

    fn one(
        &mut self,
        base: &'a str,
        wanted: bool,
        below: Option<&[FieldStep]>,
        path: &str,
        depth: usize,
    ) -> Option<()> {
        self.walk.step()?;
        if let Some(size) = size_of(base) {
            let value = self.walk.number(base, size)?;
            if wanted {
                (self.on_leaf)(path, FieldValue::Number(value));
            }
        } else if base == "string" {
            let text = self.walk.text()?;
            if wanted {
                (self.on_leaf)(path, FieldValue::Text(text.to_owned()));
            }
        } else {
            let nested = self.reader.nested(base)?;
            self.structure(nested, below, path, depth + 1)?;
        }
        Some(())
    }
}

/// Bytes of a primitive number.
fn size_of(base: &str) -> Option<usize> {
    Some(match base {
        "bool" | "byte" | "char" | "int8" | "uint8" => 1,
        "int16" | "uint16" => 2,
        "int32" | "uint32" | "float32" => 4,
        "int64" | "uint64" | "float64" => 8,
        _ => return None,
    })
}

#[cfg(test)]
mod tests;
