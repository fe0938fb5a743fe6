//! Message definitions: the `.msg` texts of every wire type, and a reader of that language.

use std::fmt::{self, Write};

/// A type's name and the text below `msg/standard`.
macro_rules! standard {
    ($name:literal) => {
        ($name, include_str!(concat!("../../../msg/standard/", $name, ".msg")))
    };
}

/// The texts that this crate carries, by full name. The standard ones are common interfaces of ROS 2
/// without their comments; those of `governor_msgs` are the very files that the package installs.
const TEXTS: &[(&str, &str)] = &[
    ("builtin_interfaces/msg/Time", "int32 sec\nuint32 nanosec\n"),
    ("std_msgs/msg/Header", "builtin_interfaces/Time stamp\nstring frame_id\n"),
    ("std_msgs/msg/String", "string data\n"),
    ("std_msgs/msg/Bool", "bool data\n"),
    ("std_msgs/msg/Float32", "float32 data\n"),
    ("std_msgs/msg/Float64", "float64 data\n"),
    ("std_msgs/msg/Int8", "int8 data\n"),
    ("std_msgs/msg/Int16", "int16 data\n"),
    ("std_msgs/msg/Int32", "int32 data\n"),
    ("std_msgs/msg/Int64", "int64 data\n"),
    ("std_msgs/msg/UInt8", "uint8 data\n"),
    ("std_msgs/msg/UInt16", "uint16 data\n"),
    ("std_msgs/msg/UInt32", "uint32 data\n"),
    ("std_msgs/msg/UInt64", "uint64 data\n"),
    (
        "control_msgs/msg/DynamicJointState",
        "std_msgs/Header header\nstring[] joint_names\nInterfaceValue[] interface_values\n",
    ),
    ("control_msgs/msg/InterfaceValue", "string[] interface_names\nfloat64[] values\n"),
    ("rosgraph_msgs/msg/Clock", "builtin_interfaces/Time clock\n"),
    ("sensor_msgs/msg/FluidPressure", "std_msgs/Header header\nfloat64 fluid_pressure\nfloat64 variance\n"),
    (
        "sensor_msgs/msg/JointState",
        "std_msgs/Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\nfloat64[] effort\n",
    ),
    ("governor_msgs/msg/GovernorCommand", include_str!("../../../msg/governor_msgs/msg/GovernorCommand.msg")),
    ("governor_msgs/msg/EsvState", include_str!("../../../msg/governor_msgs/msg/EsvState.msg")),
    ("governor_msgs/msg/ServoState", include_str!("../../../msg/governor_msgs/msg/ServoState.msg")),
    ("governor_msgs/msg/FaultSize", include_str!("../../../msg/governor_msgs/msg/FaultSize.msg")),
    ("governor_msgs/msg/TwinStatus", include_str!("../../../msg/governor_msgs/msg/TwinStatus.msg")),
    ("governor_msgs/msg/UnitVerdict", include_str!("../../../msg/governor_msgs/msg/UnitVerdict.msg")),
    standard!("diagnostic_msgs/msg/DiagnosticArray"),
    standard!("diagnostic_msgs/msg/DiagnosticStatus"),
    standard!("diagnostic_msgs/msg/KeyValue"),
    standard!("rcl_interfaces/msg/Log"),
    standard!("rcl_interfaces/msg/LoggerLevel"),
    standard!("rcl_interfaces/msg/Parameter"),
    standard!("rcl_interfaces/msg/ParameterEvent"),
    standard!("rcl_interfaces/msg/ParameterValue"),
    standard!("rcl_interfaces/msg/SetLoggerLevelsResult"),
    standard!("simulation_interfaces/msg/Result"),
    standard!("simulation_interfaces/msg/SimulationState"),
    standard!("simulation_interfaces/msg/SimulatorFeatures"),
    standard!("type_description_interfaces/msg/Field"),
    standard!("type_description_interfaces/msg/FieldType"),
    standard!("type_description_interfaces/msg/IndividualTypeDescription"),
    standard!("type_description_interfaces/msg/KeyValue"),
    standard!("type_description_interfaces/msg/TypeDescription"),
    standard!("type_description_interfaces/msg/TypeSource"),
];

/// The line between a definition and each of its dependencies in a `ros2msg` schema.
const SEPARATOR: &str = "================================================================================";

/// A longer schema is none: the largest of ROS 2 with all they refer to have some 50 kB.
const LONGEST_SCHEMA_BYTES: usize = 1 << 20;

/// More types than this are not those of one message.
const MOST_TYPES: usize = 500;

/// Why a definition could not be read.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum DefinitionError {
    /// The crate carries no such definition.
    #[error("no definition of `{0}` is known")]
    Unknown(String),
    /// A line is neither a field nor a constant.
    #[error("`{type_name}`: expected `type name` or `type NAME=value`, found `{line}`")]
    Line {
        /// The type in whose definition the line is.
        type_name: String,
        /// The line.
        line: String,
    },
    /// More types than any message is made of.
    #[error("`{0}`: expected at most {MOST_TYPES} types that it is made of, found more")]
    Many(String),
    /// More text than any message needs.
    #[error("`{type_name}`: expected a schema of at most {LONGEST_SCHEMA_BYTES} bytes, found {found_bytes}")]
    Long {
        /// The type.
        type_name: String,
        /// Length of its schema, bytes.
        found_bytes: usize,
    },
}

/// How many values a field holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Count {
    /// One value.
    One,
    /// Exactly so many: `[n]`.
    Exactly(u64),
    /// At most so many: `[<=n]`.
    AtMost(u64),
    /// Any number: `[]`.
    Any,
}

/// One field of a message.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Field {
    /// Name of the field.
    pub name: String,
    /// Primitive name, or `package/msg/Type`.
    pub base: String,
    /// Longest string in bytes for a bounded `string<=n`; 0 where unbounded.
    pub string_bound: u64,
    /// How many values.
    pub count: Count,
}

/// One constant of a message.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Constant {
    /// Name of the constant.
    pub name: String,
    /// Primitive type.
    pub base: String,
    /// The text of its value.
    pub value: String,
}

/// A message definition: fields and constants in file order.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Definition {
    /// `package/msg/Type`.
    pub type_name: String,
    /// Fields in wire order.
    pub fields: Vec<Field>,
    /// Constants; they are not on the wire.
    pub constants: Vec<Constant>,
}

impl Definition {
    /// Reads one definition. Names without a package are of the same package.
    ///
    /// # Errors
    /// On a line that is neither a field nor a constant.
    pub fn parse(type_name: &str, text: &str) -> Result<Self, DefinitionError> {
        let package = type_name.split('/').next().unwrap_or_default();
        let mut definition = Self { type_name: full_name(type_name, package), fields: vec![], constants: vec![] };
        for line in text.lines() {
            let fault = || DefinitionError::Line { type_name: type_name.into(), line: line.trim().into() };
            let Some((kind, rest)) = split_word(line) else { continue };
            let (name, after) = split_word(rest).ok_or_else(fault)?;
            let constant = (name.split_once('=')).map(|(name, _)| name).or(after.starts_with('=').then_some(name));
            if let Some(name) = constant {
                let (_, value) = rest.split_once('=').ok_or_else(fault)?;
                let value = if kind.starts_with("string") { value } else { without_comment(value) };
                let constant = Constant { name: name.trim().into(), base: kind.into(), value: value.trim().to_owned() };
                definition.constants.push(constant);
            } else {
                definition.fields.push(field(kind, name, package).ok_or_else(fault)?);
            }
        }
        Ok(definition)
    }

    /// The types that the fields name, primitives left out.
    pub fn dependencies(&self) -> impl Iterator<Item = &str> {
        self.fields.iter().map(|field| field.base.as_str()).filter(|base| base.contains('/'))
    }
}

/// The first word of a line that is not a comment, and what follows it.
fn split_word(text: &str) -> Option<(&str, &str)> {
    let text = text.trim_start();
    let word = text.split([' ', '\t', '#']).next().filter(|word| !word.is_empty())?;
    Some((word, text[word.len()..].trim_start()))
}

fn without_comment(text: &str) -> &str {
    text.split('#').next().unwrap_or_default()
}

/// Reads `type[count] name`.
fn field(kind: &str, name: &str, package: &str) -> Option<Field> {
    let is_name = name.chars().all(|letter| letter.is_ascii_alphanumeric() || letter == '_');
    if !is_name || name.is_empty() {
        return None;
    }
    let (kind, count) = match kind.strip_suffix(']').map(|kind| kind.rsplit_once('[')) {
        None => (kind, Count::One),
        Some(None) => return None,
        Some(Some((kind, ""))) => (kind, Count::Any),
        Some(Some((kind, count))) => match count.strip_prefix("<=") {
            Some(bound) => (kind, Count::AtMost(bound.parse().ok()?)),
            None => (kind, Count::Exactly(count.parse().ok()?)),
        },
    };
    let (kind, string_bound) = match kind.split_once("<=") {
        Some((kind, bound)) => (kind, bound.parse().ok()?),
        None => (kind, 0),
    };
    let is_base = kind.chars().all(|letter| letter.is_ascii_alphanumeric() || "_/".contains(letter));
    is_base.then(|| Field { name: name.into(), base: full_name(kind, package), string_bound, count })
}

/// `Header` in `std_msgs`, `std_msgs/Header` and `std_msgs/msg/Header` all become the last; primitives stay.
pub fn full_name(name: &str, package: &str) -> String {
    match name.split('/').collect::<Vec<_>>()[..] {
        [package, kind] => format!("{package}/msg/{kind}"),
        [kind] if kind.starts_with(|letter: char| letter.is_ascii_uppercase()) => format!("{package}/msg/{kind}"),
        _ => name.to_owned(),
    }
}

/// The `.msg` text that the crate carries for a type.
///
/// # Errors
/// On a type that the crate does not carry.
pub fn text_of(type_name: &str) -> Result<&'static str, DefinitionError> {
    let found = TEXTS.iter().find(|(name, _)| *name == type_name);
    found.map(|(_, text)| *text).ok_or_else(|| DefinitionError::Unknown(type_name.to_owned()))
}

/// Every type whose text the crate carries.
pub fn known() -> impl Iterator<Item = &'static str> {
    TEXTS.iter().map(|(name, _)| *name)
}

/// A type and everything that it depends on, each once, the type first, in the order of first use.
///
/// # Errors
/// On a type that the crate does not carry.
pub fn closure_of(type_name: &str) -> Result<Vec<Definition>, DefinitionError> {
    closure_with(type_name, &carried)
}

/// The same with texts from elsewhere, by full name.
///
/// # Errors
/// On a type without text, a text that cannot be read, or more types than one message is made of.
pub fn closure_with(
    type_name: &str,
    text: &dyn Fn(&str) -> Result<String, DefinitionError>,
) -> Result<Vec<Definition>, DefinitionError> {
    let mut found = vec![Definition::parse(type_name, &text(type_name)?)?];
    let mut next = 0;
    while let Some(definition) = found.get(next) {
        let wanted: Vec<String> = definition.dependencies().map(str::to_owned).collect();
        for name in wanted {
            if found.iter().all(|definition| definition.type_name != name) {
                if found.len() == MOST_TYPES {
                    return Err(DefinitionError::Many(type_name.to_owned()));
                }
                found.push(Definition::parse(&name, &text(&name)?)?);
            }
        }
        next += 1;
    }
    Ok(found)
}

fn carried(type_name: &str) -> Result<String, DefinitionError> {
    text_of(type_name).map(str::to_owned)
}

/// The whole `ros2msg` schema of a type: its text, then each dependency after a line of 80 `=`.
///
/// # Errors
/// On a type that the crate does not carry.
pub fn schema_of(type_name: &str) -> Result<String, DefinitionError> {
    schema_with(type_name, &carried)
}

/// The same with texts from elsewhere, by full name.
///
/// # Errors
/// As [`closure_with`].
pub fn schema_with(
    type_name: &str,
    text: &dyn Fn(&str) -> Result<String, DefinitionError>,
) -> Result<String, DefinitionError> {
    let mut schema = text(type_name)?;
    for dependency in closure_with(type_name, text)?.iter().skip(1) {
        let name = dependency.type_name.replace("/msg/", "/");
        let text = text(&dependency.type_name)?;
        let end = if schema.ends_with('\n') { "" } else { "\n" };
        // Writing to a `String` cannot fail.
        let _ = write!(schema, "{end}{SEPARATOR}\nMSG: {name}\n{text}");
    }
    if schema.len() > LONGEST_SCHEMA_BYTES {
        return Err(DefinitionError::Long { type_name: type_name.to_owned(), found_bytes: schema.len() });
    }
    Ok(schema)
}

/// Reads a whole `ros2msg` schema into the type and its dependencies, the type first.
///
/// # Errors
/// On a line that is neither a field nor a constant, and on a schema that is longer than any should be.
pub fn parse_schema(type_name: &str, schema: &str) -> Result<Vec<Definition>, DefinitionError> {
    if schema.len() > LONGEST_SCHEMA_BYTES {
        return Err(DefinitionError::Long { type_name: type_name.to_owned(), found_bytes: schema.len() });
    }
    let mut parts = vec![(type_name.to_owned(), String::new())];
    let mut lines = schema.lines();
    while let Some(line) = lines.next() {
        if line.len() >= 3 && line.trim_end().bytes().all(|byte| byte == b'=') {
            let name = lines.next().and_then(|line| line.strip_prefix("MSG:")).unwrap_or_default();
            parts.push((name.trim().to_owned(), String::new()));
        } else if let Some((_, text)) = parts.last_mut() {
            text.push_str(line);
            text.push('\n');
        }
    }
    parts.iter().map(|(name, text)| Definition::parse(name, text)).collect()
}

/// The first way in which two readings of one type differ on the wire, in words; `None` where they agree.
///
/// Both lists begin with the type and hold its dependencies in any order. Constants and comments
/// are not on the wire.
pub fn difference(expected: &[Definition], found: &[Definition]) -> Option<String> {
    let mut pairs = vec![(expected.first()?, found.first()?)];
    for (place, definition) in expected.iter().enumerate().skip(1) {
        // Of a name that is defined twice the first definition counts, on both sides.
        let named = |other: &&Definition| other.type_name == definition.type_name;
        let known = expected[..place].iter().any(|other| named(&other));
        pairs.extend(found.iter().skip(1).find(named).filter(|_| !known).map(|other| (definition, other)));
    }
    for (expected, found) in pairs {
        for place in 0..expected.fields.len().max(found.fields.len()) {
            let (wanted, there) = (expected.fields.get(place), found.fields.get(place));
            if wanted != there {
                let show =
                    |field: Option<&Field>| field.map_or_else(|| "nothing".to_owned(), |field| format!("`{field}`"));
                return Some(format!(
                    "field {} of `{}` is {}, expected {}",
                    place + 1,
                    expected.type_name,
                    show(there),
                    show(wanted)
                ));
            }
        }
    }
    None
}

impl fmt::Display for Field {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.base)?;
        if self.string_bound > 0 {
            write!(f, "<={}", self.string_bound)?;
        }
        match self.count {
            Count::One => {}
            Count::Exactly(count) => write!(f, "[{count}]")?,
            Count::AtMost(bound) => write!(f, "[<={bound}]")?,
            Count::Any => f.write_str("[]")?,
        }
        write!(f, " {}", self.name)
    }
}
