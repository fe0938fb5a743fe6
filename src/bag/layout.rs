//! Where the numbers lie in messages of any type: a walk over CDR bytes along the type's schema.

use super::topic::TopicInfo;
use crate::msg::definition::{Count, Definition, closure_of, parse_schema};
use crate::msg::{Time, type_hash};

/// Types nested deeper than this are a circle, which no message can be.
const DEEPEST: usize = 24;

/// Types with more fields than this, those of nested types included, are not walked.
const MOST_FIELDS: usize = 10_000;

/// One step of the walk.
#[derive(Clone, Debug, PartialEq)]
enum Node {
    /// A value without interest, of this size in bytes.
    Skip(usize),
    /// A floating-point number of this size with the number of its name.
    Float {
        size: usize,
        name: usize,
    },
    Text,
    Struct(Vec<Node>),
    Many(Count, Box<Node>),
}

/// How the bytes of a type are laid out.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Layout {
    root: Node,
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
        let mut build = Build { types: &types, names: vec![], fields: 0 };
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
        let mut walk = Walk { body, at: 0, little: *order == 1 };
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

/// A layout in the making.
struct Build<'a> {
    types: &'a [Definition],
    names: Vec<String>,
    fields: usize,
}

impl Build<'_> {
    fn structure(&mut self, definition: &Definition, path: &str, depth: usize) -> Option<Node> {
        let mut nodes = vec![];
        for field in &definition.fields {
            self.fields += 1;
            if depth > DEEPEST || self.fields > MOST_FIELDS {
                return None;
            }
            let path = if path.is_empty() { field.name.clone() } else { format!("{path}.{}", field.name) };
            let one = match field.base.as_str() {
                "bool" | "byte" | "char" | "int8" | "uint8" => Node::Skip(1),
                "int16" | "uint16" => Node::Skip(2),
                "int32" | "uint32" => Node::Skip(4),
                "int64" | "uint64" => Node::Skip(8),
                "float32" | "float64" => {
                    self.names.push(path);
                    Node::Float { size: if field.base == "float32" { 4 } else { 8 }, name: self.names.len() - 1 }
                }
                "string" => Node::Text,
                nested => {
                    let types = self.types;
                    let nested = types.iter().find(|definition| definition.type_name == nested)?;
                    self.structure(nested, &path, depth + 1)?
                }
            };
            nodes.push(if field.count == Count::One { one } else { Node::Many(field.count, Box::new(one)) });
        }
        if nodes.is_empty() {
            // An empty structure has one byte on the wire.
            nodes.push(Node::Skip(1));
        }
        Some(Node::Struct(nodes))
    }
}

#[derive(Clone, Copy)]
struct Walk<'a> {
    body: &'a [u8],
    at: usize,
    little: bool,
}

impl<'a> Walk<'a> {
    /// The next value of a size, aligned to it.
    fn take(&mut self, size: usize) -> Option<&'a [u8]> {
        let start = self.at.checked_next_multiple_of(size)?;
        self.bytes(start, size)
    }

    fn bytes(&mut self, start: usize, len: usize) -> Option<&'a [u8]> {
        let end = start.checked_add(len)?;
        let bytes = self.body.get(start..end)?;
        self.at = end;
        Some(bytes)
    }

    fn word(&mut self) -> Option<u32> {
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

    fn over(&mut self, node: &Node, on_float: &mut dyn FnMut(usize, f64)) -> Option<()> {
        match node {
            Node::Skip(size) => drop(self.take(*size)?),
            Node::Float { size, name } => on_float(*name, self.float(*size)?),
            Node::Text => {
                let len = self.word()?;
                self.bytes(self.at, usize::try_from(len).ok()?)?;
            }
            Node::Struct(nodes) => {
                for node in nodes {
                    self.over(node, on_float)?;
                }
            }
            Node::Many(count, node) => {
                let count = match count {
                    Count::Exactly(count) => *count,
                    _ => u64::from(self.word()?),
                };
                match **node {
                    // Pictures and point clouds are not walked byte by byte.
                    Node::Skip(size) if count > 0 => {
                        self.take(size)?;
                        let rest = usize::try_from(count - 1).ok()?.checked_mul(size)?;
                        self.bytes(self.at, rest)?;
                    }
                    _ => {
                        // Every turn takes at least a byte, so the bytes bound the turns.
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
