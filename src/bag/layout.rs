//! Where the numbers lie in messages of any type: a walk over CDR bytes along the type's schema.

use std::collections::BTreeMap;

use super::topic::TopicInfo;
use crate::msg::definition::{Count, Definition, closure_of, parse_schema};
use crate::msg::{Time, type_hash};

/// Types nested deeper than this are a circle, which no message can be.
const DEEPEST: usize = 24;

/// Types with more fields than this, those of nested types included, are not walked.
const MOST_FIELDS: usize = 10_000;

/// The names of all fields of a type together, with those of the fields that they are nested in, have at most so many bytes.
const LONGEST_NAMES_BYTES: usize = 1 << 20;

/// Steps of a walk for each byte of a message: one for every value, and for every structure round it.
const STEPS_PER_BYTE: usize = DEEPEST + 8;

/// One step of the walk.
#[derive(Clone, Debug, PartialEq)]
enum WalkStep {
    /// A value without interest, of this size in bytes.
    Skip(usize),
    /// A floating-point number of this size with the number of its name.
    Float {
        size: usize,
        name: usize,
    },
    Text,
    Struct(Vec<WalkStep>),
    Many(Count, Box<WalkStep>),
}

/// How the bytes of a type are laid out.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Layout {
    root: WalkStep,
    /// Paths of the floating-point fields, `pose.position.x`.
    names: Vec<String>,
    /// The message begins with a time: its own, or that of its header.
    stamped: bool,
    /// REP-2016 hash of the schema.
    pub(super) type_hash: String,
}

impl Layout {
    /// Reads the layout off a topic's schema, or off the definition that this crate carries.
    pub(super) fn of(topic: &TopicInfo) -> Option<Self> {
        if topic.encoding != "cdr" {
            return None;
        }
        let schema = std::str::from_utf8(&topic.schema).ok().filter(|_| topic.schema_encoding == "ros2msg");
        let types = schema
            .and_then(|schema| parse_schema(&topic.type_name, schema).ok())
            .or_else(|| closure_of(&topic.type_name).ok())?;
        // Of a name that is defined twice the first definition counts.
        let by_name = types.iter().rev().map(|definition| (definition.type_name.as_str(), definition)).collect();
        let mut build = LayoutBuild { types: by_name, names: vec![], fields: 0, names_bytes: 0 };
        let root = build.structure(types.first()?, "", 0)?;
        let names = build.names;
        let first = types.first()?.fields.first();
        let stamped = first.is_some_and(|first| {
            first.count == Count::One
                && ["std_msgs/msg/Header", "builtin_interfaces/msg/Time"].contains(&first.base.as_str())
        });
        Some(Self { root, names, stamped, type_hash: type_hash::hash_of(&types) })
    }

    pub(super) fn names(&self) -> &[String] {
        &self.names
    }

    pub(super) fn is_stamped(&self) -> bool {
        self.stamped
    }

    /// Walks over a message, hands on each floating-point number with the number of its name, and
    /// gives the stamp. `None` where the bytes are not of this layout.
    #[expect(
        clippy::option_option,
        reason = "bytes may be of this layout or not, and the layout may have a stamp or not"
    )]
    pub(super) fn walk(&self, data: &[u8], on_float: &mut dyn FnMut(usize, f64)) -> Option<Option<Time>> {
        let [0, order @ (0 | 1), _, _, body @ ..] = data else { return None };
        let mut walk = Walk { body, at: 0, little: *order == 1, steps_left: steps(body.len()) };
        let stamp = if self.stamped {
            let mut head = Walk { ..walk };
            let [sec, nanosec] = [head.word()?, head.word()?];
            Some(Time { sec: sec.cast_signed(), nanosec })
        } else {
            None
        };
        walk.over(&self.root, on_float)?;
        Some(stamp)
    }
}

/// The most steps of a walk over so many bytes. A layout that takes more has elements without a byte, of which a message may state
/// any number.
fn steps(bytes: usize) -> usize {
    STEPS_PER_BYTE.saturating_mul(bytes.saturating_add(2))
}

/// A layout in the making.
struct LayoutBuild<'a> {
    types: BTreeMap<&'a str, &'a Definition>,
    names: Vec<String>,
    fields: usize,
    names_bytes: usize,
}

impl<'a> LayoutBuild<'a> {
    fn structure(&mut self, definition: &'a Definition, path: &str, depth: usize) -> Option<WalkStep> {
        let mut nodes = vec![];
        for field in &definition.fields {
            self.fields += 1;
            self.names_bytes = self.names_bytes.saturating_add(path.len() + field.name.len());
            if depth > DEEPEST || self.fields > MOST_FIELDS || self.names_bytes > LONGEST_NAMES_BYTES {
                return None;
            }
            let path = if path.is_empty() { field.name.clone() } else { format!("{path}.{}", field.name) };
            let one = match field.base.as_str() {
                "bool" | "byte" | "char" | "int8" | "uint8" => WalkStep::Skip(1),
                "int16" | "uint16" => WalkStep::Skip(2),
                "int32" | "uint32" => WalkStep::Skip(4),
                "int64" | "uint64" => WalkStep::Skip(8),
                "float32" | "float64" => {
                    self.names.push(path);
                    WalkStep::Float { size: if field.base == "float32" { 4 } else { 8 }, name: self.names.len() - 1 }
                }
                "string" => WalkStep::Text,
                nested => {
                    let nested = *self.types.get(nested)?;
                    self.structure(nested, &path, depth + 1)?
                }
            };
            nodes.push(if field.count == Count::One { one } else { WalkStep::Many(field.count, Box::new(one)) });
        }
        if nodes.is_empty() {
            // An empty structure has one byte on the wire.
            nodes.push(WalkStep::Skip(1));
        }
        Some(WalkStep::Struct(nodes))
    }
}

#[derive(Clone, Copy)]
pub(super) struct Walk<'a> {
    body: &'a [u8],
    at: usize,
    little: bool,
    steps_left: usize,
}

impl<'a> Walk<'a> {
    /// Begins at the first value of a message, with so many steps to go; none where the message has no CDR head.
    pub(super) fn over_message(data: &'a [u8], steps_left: usize) -> Option<Self> {
        let [0, order @ (0 | 1), _, _, body @ ..] = data else { return None };
        Some(Walk { body, at: 0, little: *order == 1, steps_left })
    }

    /// One step less to go.
    pub(super) fn step(&mut self) -> Option<()> {
        self.steps_left = self.steps_left.checked_sub(1)?;
        Some(())
    }

    /// Passes over bytes.
    pub(super) fn skip(&mut self, len: usize) -> Option<()> {
        self.bytes(self.at, len).map(drop)
    }

    /// A text without its closing zero; what is no UTF-8 is no text.
    pub(super) fn text(&mut self) -> Option<&'a str> {
        self.step()?;
        let len = usize::try_from(self.word()?).ok()?;
        let bytes = self.bytes(self.at, len)?;
        std::str::from_utf8(bytes.strip_suffix(&[0]).unwrap_or(bytes)).ok()
    }

    /// A primitive number of a type and its size; truth values are 0 and 1.
    pub(super) fn number(&mut self, base: &str, size: usize) -> Option<f64> {
        if base.starts_with("float") {
            return self.float(size);
        }
        let bytes = self.take(size)?;
        let mut wide = [0; 8];
        for (k, byte) in bytes.iter().enumerate() {
            wide[if self.little { k } else { size - 1 - k }] = *byte;
        }
        let unsigned = u64::from_le_bytes(wide);
        let shift = 64 - 8 * size;
        let is_signed = base.starts_with("int");
        Some(if is_signed { ((unsigned << shift).cast_signed() >> shift) as f64 } else { unsigned as f64 })
    }

    /// The next value of a size, aligned to it.
    pub(super) fn take(&mut self, size: usize) -> Option<&'a [u8]> {
        let start = self.at.checked_next_multiple_of(size)?;
        self.bytes(start, size)
    }

    fn bytes(&mut self, start: usize, len: usize) -> Option<&'a [u8]> {
        let end = start.checked_add(len)?;
        let bytes = self.body.get(start..end)?;
        self.at = end;
        Some(bytes)
    }

    pub(super) fn word(&mut self) -> Option<u32> {
        let bytes = self.take(4)?.try_into().ok()?;
        Some(if self.little { u32::from_le_bytes(bytes) } else { u32::from_be_bytes(bytes) })
    }

    fn float(&mut self, size: usize) -> Option<f64> {
        let bytes = self.take(size)?;
        if size == 4 {
            let bytes = bytes.try_into().ok()?;
            Some(f64::from(if self.little { f32::from_le_bytes(bytes) } else { f32::from_be_bytes(bytes) }))
        } else {
            let bytes = bytes.try_into().ok()?;
            Some(if self.little { f64::from_le_bytes(bytes) } else { f64::from_be_bytes(bytes) })
        }
    }

    fn over(&mut self, node: &WalkStep, on_float: &mut dyn FnMut(usize, f64)) -> Option<()> {
        self.steps_left = self.steps_left.checked_sub(1)?;
        match node {
            WalkStep::Skip(size) => drop(self.take(*size)?),
            WalkStep::Float { size, name } => on_float(*name, self.float(*size)?),
            WalkStep::Text => {
                let len = self.word()?;
                self.bytes(self.at, usize::try_from(len).ok()?)?;
            }
            WalkStep::Struct(nodes) => {
                for node in nodes {
                    self.over(node, on_float)?;
                }
            }
            WalkStep::Many(count, node) => {
                let count = match count {
                    Count::Exactly(count) => *count,
                    _ => u64::from(self.word()?),
                };
                match **node {
                    // Pictures and point clouds are not walked byte by byte.
                    WalkStep::Skip(size) if count > 0 => {
                        self.take(size)?;
                        let rest = usize::try_from(count - 1).ok()?.checked_mul(size)?;
                        self.bytes(self.at, rest)?;
                    }
                    _ => {
                        // Bytes bound the turns, and steps those that take none.
                        for _ in 0..count {
                            self.over(node, on_float)?;
                        }
                    }
                }
            }
        }
        Some(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn layout(schema: &str) -> Option<Layout> {
        Layout::of(&TopicInfo {
            type_name: "p/msg/A".into(),
            encoding: "cdr".into(),
            schema_encoding: "ros2msg".into(),
            schema: schema.as_bytes().into(),
            ..TopicInfo::default()
        })
    }

    #[test]
    fn elements_without_a_byte_cost_no_more_steps_than_the_message_has_bytes() {
        for schema in [
            "E[18446744073709551615] a\n===\nMSG: p/E\nuint8[0] x\n",
            "E[] a\n===\nMSG: p/E\nfloat64[0] x\n",
            "E[4000000000] a\n===\nMSG: p/E\nF[4000000000] x\n===\nMSG: p/F\nG[0] x\n===\nMSG: p/G\nfloat64 x\n",
        ] {
            let layout = layout(schema).unwrap();
            let message = [&[0, 1, 0, 0][..], &[0xff; 4]].concat();
            let mut walk = Walk { body: &message[4..], at: 0, little: true, steps_left: steps(4) };
            assert!(steps(4) < 1000 && walk.over(&layout.root, &mut |_, _| ()).is_none(), "{schema}");
            assert_eq!(walk.steps_left, 0, "{schema}: ended by its steps");
            assert_eq!(layout.walk(&message, &mut |_, _| ()), None);
        }
        // Structures in structures have all the steps that their bytes need.
        let deep: String = (0..20).map(|k| format!("===\nMSG: p/T{k}\nT{}[] x\n", k + 1)).collect();
        let layout = layout(&format!("T0[] x\n{deep}===\nMSG: p/T20\nfloat64[] x\n")).unwrap();
        let message = [&[0, 1, 0, 0][..], &[1, 0, 0, 0].repeat(21), &[2, 0, 0, 0], &[0; 16]].concat();
        let mut found = 0;
        assert_eq!(layout.walk(&message, &mut |_, _| found += 1), Some(None));
        assert_eq!(found, 2);
    }

    #[test]
    fn schemas_that_unfold_without_end_are_not_walked() {
        let long = "x".repeat(100_000);
        let fields = |count: usize| (0..count).map(|k| format!("E a{k}\n")).collect::<String>();
        assert!(layout(&format!("E {long}\n===\nMSG: p/E\n{}===\nMSG: p/F\nfloat64 b\n", fields(0))).is_some());
        let names = (0..11).map(|k| format!("float64 {long}{k}\n")).collect::<String>();
        assert!(layout(&names).is_none(), "names of more than a megabyte");
        assert!(layout(&format!("{}===\nMSG: p/E\nfloat64 b\n", fields(6000))).is_none(), "too many fields");
        assert!(layout("A a\n").is_none(), "a circle");
        let error = parse_schema("p/msg/A", &"#\n".repeat(600_000)).unwrap_err().to_string();
        assert!(error.contains("at most 1048576 bytes, found 1200000"), "{error}");
    }
}
