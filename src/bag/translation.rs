//! Messages of a known type in another layout, such as an older version of it, read by the names of their fields.
//!
//! Each channel of a bag has a schema of its own, so that one topic may hold messages of two versions of a type. A message is read by the schema
//! of its own channel: fields may stand in another order, be of another size, or be joined by further fields. A field that is missing makes the
//! layout unusable, and the bag is refused by its name.

use std::collections::BTreeMap;

use super::field::{FieldReader, FieldValue};
use super::topic::TopicInfo;
use crate::msg::definition::{Count, Definition, closure_of};

/// The head of a CDR message in little-endian order.
const HEAD: [u8; 4] = [0, 1, 0, 0];

/// Turns messages of a channel's own layout into those of the type that this crate knows.
#[derive(Clone, Debug)]
pub(super) struct Translation {
    reader: FieldReader,
    expected: Vec<Definition>,
}

impl Translation {
    /// For the messages of a topic whose definition differs from the known one of its type.
    ///
    /// # Errors
    /// In words, where a field that is needed is missing in the topic's definition, or is something else there.
    pub(super) fn new(topic: &TopicInfo) -> Result<Self, String> {
        let reader = FieldReader::new(topic)?;
        let expected = closure_of(&topic.type_name).map_err(|error| error.to_string())?;
        let root = expected.first().ok_or("a type without fields")?;
        let mut paths = vec![];
        leaves(&expected, root, "", &mut paths).ok_or("a type with arrays")?;
        for (path, base) in &paths {
            let found = reader.base_of(path).ok_or_else(|| format!("field `{path}` is missing"))?;
            if (*base == "string") != (found == "string") {
                return Err(format!("field `{path}` is a `{found}`, expected a `{base}`"));
            }
        }
        Ok(Self { reader, expected })
    }

    /// The message in the known layout; none where its bytes are not of its own.
    pub(super) fn of(&self, data: &[u8]) -> Option<Vec<u8>> {
        let values: BTreeMap<String, FieldValue> = self.reader.leaves(data).into_iter().collect();
        let mut body = vec![];
        self.write(self.expected.first()?, "", &values, &mut body)?;
        Some([&HEAD[..], &body].concat())
    }

    fn write(
        &self,
        definition: &Definition,
        path: &str,
        values: &BTreeMap<String, FieldValue>,
        body: &mut Vec<u8>,
    ) -> Option<()> {
        for field in &definition.fields {
            let path = below(path, &field.name);
            if let Some(nested) = self.expected.iter().find(|one| one.type_name == field.base) {
                self.write(nested, &path, values, body)?;
                continue;
            }
            match values.get(&path)? {
                FieldValue::Text(text) => {
                    align(body, 4);
                    body.extend((u32::try_from(text.len()).ok()? + 1).to_le_bytes());
                    body.extend(text.as_bytes());
                    body.push(0);
                }
                FieldValue::Number(number) => put(&field.base, *number, body)?,
            }
        }
        Some(())
    }
}

fn below(path: &str, name: &str) -> String {
    if path.is_empty() { name.to_owned() } else { format!("{path}.{name}") }
}

/// The values of a type by their paths, with their primitive types; none where the type has arrays.
fn leaves<'a>(
    types: &'a [Definition],
    definition: &'a Definition,
    path: &str,
    found: &mut Vec<(String, &'a str)>,
) -> Option<()> {
    for field in &definition.fields {
        if field.count != Count::One {
            return None;
        }
        let path = below(path, &field.name);
        match types.iter().find(|one| one.type_name == field.base) {
            Some(nested) => leaves(types, nested, &path, found)?,
            None => found.push((path, &field.base)),
        }
    }
    Some(())
}

fn align(body: &mut Vec<u8>, size: usize) {
    body.resize(body.len().next_multiple_of(size), 0);
}

/// A number as a primitive type; none where it has no room in it.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "checked to lie in the type")]
fn put(base: &str, number: f64, body: &mut Vec<u8>) -> Option<()> {
    let within = |least: f64, most: f64| (least..=most).contains(&number) && number.fract() == 0.0;
    match base {
        "float64" => {
            align(body, 8);
            body.extend(number.to_le_bytes());
        }
        "float32" => {
            align(body, 4);
            body.extend((number as f32).to_le_bytes());
        }
        "int32" if within(f64::from(i32::MIN), f64::from(i32::MAX)) => {
            align(body, 4);
            body.extend((number as i32).to_le_bytes());
        }
        "uint32" if within(0.0, f64::from(u32::MAX)) => {
            align(body, 4);
            body.extend((number as u32).to_le_bytes());
        }
        "uint8" | "bool" | "byte" | "char" if within(0.0, f64::from(u8::MAX)) => body.push(number as u8),
        _ => return None,
    }
    Some(())
}
