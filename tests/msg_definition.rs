//! The Rust structs equal the `.msg` files field by field, and the type hashes equal those that ROS 2 publishes.

use std::fmt;

use govtwin_bag::msg::definition::{Count, Definition, closure_of, parse_schema, schema_of, text_of};
use govtwin_bag::msg::service::{Service, Trigger};
use govtwin_bag::msg::simulation::{
    GetSimulationState, GetSimulatorFeatures, ResetSimulation, SetSimulationState, StepSimulation,
};
use govtwin_bag::msg::type_hash::{hash_of, type_hash};
use govtwin_bag::msg::upkeep::{GetLoggerLevels, GetTypeDescription, SetLoggerLevels};
use govtwin_bag::msg::{
    EsvState, FluidPressure, GovernorCommand, Header, Interface, JointState, ServoState, Time, TwinStatus, UnitVerdict,
};
use serde::de::{DeserializeOwned, DeserializeSeed, Deserializer, SeqAccess, Visitor};

/// Writes down what a type asks its decoder for: `[header: {…}, opening: float64]`.
#[derive(Default)]
struct Shape(String);

#[derive(Debug)]
struct Never(String);

impl fmt::Display for Never {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for Never {}

impl serde::de::Error for Never {
    fn custom<T: fmt::Display>(message: T) -> Self {
        Self(message.to_string())
    }
}

struct Fields<'a> {
    shape: &'a mut Shape,
    names: &'static [&'static str],
}

impl<'de> SeqAccess<'de> for Fields<'_> {
    type Error = Never;

    fn next_element_seed<T: DeserializeSeed<'de>>(&mut self, seed: T) -> Result<Option<T::Value>, Never> {
        let Some((name, rest)) = self.names.split_first() else { return Ok(None) };
        self.names = rest;
        self.shape.0.push_str(&format!("{name}: "));
        let value = seed.deserialize(&mut *self.shape)?;
        self.shape.0.push_str("; ");
        Ok(Some(value))
    }
}

struct One<'a>(&'a mut Shape, bool);

impl<'de> SeqAccess<'de> for One<'_> {
    type Error = Never;

    fn next_element_seed<T: DeserializeSeed<'de>>(&mut self, seed: T) -> Result<Option<T::Value>, Never> {
        if std::mem::replace(&mut self.1, true) { Ok(None) } else { seed.deserialize(&mut *self.0).map(Some) }
    }
}

macro_rules! leaves {
    ($($method:ident => $name:literal, $visit:ident($value:expr);)+) => {$(
        fn $method<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Never> {
            self.0.push_str($name);
            visitor.$visit($value)
        }
    )+};
}

impl<'de> Deserializer<'de> for &mut Shape {
    type Error = Never;

    leaves! {
        deserialize_bool => "bool", visit_bool(false);
        deserialize_i8 => "int8", visit_i8(0);
        deserialize_i16 => "int16", visit_i16(0);
        deserialize_i32 => "int32", visit_i32(0);
        deserialize_i64 => "int64", visit_i64(0);
        deserialize_u8 => "uint8", visit_u8(0);
        deserialize_u16 => "uint16", visit_u16(0);
        deserialize_u32 => "uint32", visit_u32(0);
        deserialize_u64 => "uint64", visit_u64(0);
        deserialize_f32 => "float32", visit_f32(0.0);
        deserialize_f64 => "float64", visit_f64(0.0);
        deserialize_string => "string", visit_str("");
        deserialize_str => "string", visit_str("");
    }

    fn deserialize_struct<V: Visitor<'de>>(
        self,
        _: &'static str,
        names: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Never> {
        self.0.push('{');
        let value = visitor.visit_seq(Fields { shape: self, names })?;
        self.0.push('}');
        Ok(value)
    }

    fn deserialize_seq<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Never> {
        let value = visitor.visit_seq(One(self, false))?;
        self.0.push_str("[]");
        Ok(value)
    }

    fn deserialize_any<V: Visitor<'de>>(self, _: V) -> Result<V::Value, Never> {
        Err(Never("a wire type asked for something that no .msg file can say".into()))
    }

    serde::forward_to_deserialize_any! {
        i128 u128 char bytes byte_buf option unit unit_struct newtype_struct tuple tuple_struct map enum identifier
        ignored_any
    }
}

fn shape_of_struct<T: DeserializeOwned>() -> String {
    let mut shape = Shape::default();
    T::deserialize(&mut shape).unwrap();
    shape.0
}

fn shape_of_definition(definition: &Definition, all: &[Definition]) -> String {
    let mut shape = String::from("{");
    for field in &definition.fields {
        let base = match all.iter().find(|other| other.type_name == field.base) {
            Some(nested) => shape_of_definition(nested, all),
            None => field.base.clone(),
        };
        let count = match field.count {
            Count::One => "",
            Count::Any => "[]",
            Count::Exactly(_) | Count::AtMost(_) => panic!("no wire type has {field:?}"),
        };
        shape.push_str(&format!("{}: {base}{count}; ", field.name));
    }
    shape + "}"
}

fn check<T: Interface>() {
    let closure = closure_of(T::TYPE_NAME).unwrap();
    assert_eq!(shape_of_struct::<T>(), shape_of_definition(&closure[0], &closure), "{}", T::TYPE_NAME);
}

fn check_service<S: Service>() {
    let shape = |half: &Definition| {
        let mut all = vec![half.clone()];
        for name in half.dependencies() {
            all.extend(closure_of(name).unwrap());
        }
        match half.fields.is_empty() {
            true => "{structure_needs_at_least_one_member: uint8; }".to_owned(),
            false => shape_of_definition(half, &all),
        }
    };
    let [request, response] = S::definitions().unwrap();
    assert_eq!(shape_of_struct::<S::Request>(), shape(&request), "{}", S::TYPE_NAME);
    assert_eq!(shape_of_struct::<S::Response>(), shape(&response), "{}", S::TYPE_NAME);
}

#[test]
fn structs_equal_their_definitions_in_order_type_and_name() {
    check::<GovernorCommand>();
    check::<EsvState>();
    check::<ServoState>();
    check::<TwinStatus>();
    check::<UnitVerdict>();
    check_service::<Trigger>();
    check_service::<GetSimulatorFeatures>();
    check_service::<GetSimulationState>();
    check_service::<SetSimulationState>();
    check_service::<StepSimulation>();
    check_service::<ResetSimulation>();
    check_service::<GetLoggerLevels>();
    check_service::<SetLoggerLevels>();
    check_service::<GetTypeDescription>();
    check::<FluidPressure>();
    check::<JointState>();
    assert_eq!(shape_of_struct::<Time>(), "{sec: int32; nanosec: uint32; }");
    assert_eq!(shape_of_struct::<Header>(), "{stamp: {sec: int32; nanosec: uint32; }; frame_id: string; }");
}

#[test]
fn constants_equal_those_of_the_message() {
    let esv = &closure_of("governor_msgs/msg/EsvState").unwrap()[0];
    let constants: Vec<_> =
        esv.constants.iter().map(|one| (one.base.as_str(), one.name.as_str(), one.value.as_str())).collect();
    let shutdown = EsvState::SHUTDOWN.to_string();
    let normal = EsvState::NORMAL.to_string();
    assert_eq!(constants, [("uint8", "SHUTDOWN", shutdown.as_str()), ("uint8", "NORMAL", normal.as_str())]);
    for other in ["governor_msgs/msg/GovernorCommand", "governor_msgs/msg/ServoState"] {
        assert!(closure_of(other).unwrap()[0].constants.is_empty());
    }
}

#[test]
fn the_package_generates_exactly_the_messages_that_the_crate_knows() {
    let cmake = include_str!("../msg/governor_msgs/CMakeLists.txt");
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("msg/governor_msgs/msg");
    let mut files: Vec<String> =
        std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    files.sort();
    let listed: Vec<&str> =
        cmake.lines().filter_map(|line| line.trim().strip_prefix("\"msg/")?.strip_suffix('"')).collect();
    assert_eq!(listed, files);
    for file in files {
        let name = format!("governor_msgs/msg/{}", file.strip_suffix(".msg").unwrap());
        assert!(text_of(&name).is_ok(), "{name}");
    }
}

/// Hashes as `ros2 topic info --verbose` prints them on Jazzy; those of `governor_msgs` by `rosbags`.
#[test]
fn type_hashes_equal_the_published_ones() {
    for (name, hash) in [
        ("std_msgs/msg/String", "df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18"),
        ("builtin_interfaces/msg/Time", "b106235e25a4c5ed35098aa0a61a3ee9c9b18d197f398b0e4206cea9acf9c197"),
        ("std_msgs/msg/Header", "f49fb3ae2cf070f793645ff749683ac6b06203e41c891e17701b1cb597ce6a01"),
        ("rosgraph_msgs/msg/Clock", "692f7a66e93a3c83e71765d033b60349ba68023a8c689a79e48078bcb5c58564"),
        ("diagnostic_msgs/msg/DiagnosticArray", "5a8a36efb05fb25070fa0fb3810290c0e6cd4862b54a8fb975a1ee8dc55a333e"),
        ("diagnostic_msgs/msg/DiagnosticStatus", "b0e3e692ea2d54a8af2f4ef1930e81556a2db55216b771f8a7d2724ed47bf0e4"),
        ("rcl_interfaces/msg/Log", "e28ce254ca8abc06abf92773b74602cdbf116ed34fbaf294fb9f81da9f318eac"),
        ("rcl_interfaces/msg/ParameterEvent", "043e627780fcad87a22d225bc2a037361dba713fca6a6b9f4b869a5aa0393204"),
        ("rcl_interfaces/msg/LoggerLevel", "95785cc42f048ab4f395af65035aeaf2181d8e1c7a44edb8ad4558445fdb43c0"),
        (
            "rcl_interfaces/msg/SetLoggerLevelsResult",
            "9316e5e679a5b72d2dd7fd80c539bae9e106fa0890a06dc5da3a8177a3ff6909",
        ),
        (
            "type_description_interfaces/msg/FieldType",
            "a70b6dd919645a03a3586f7f821defbc886ea3e531a1d95cc0f380a3973ccaa6",
        ),
        ("type_description_interfaces/msg/Field", "c0b01379cd4226281285ccaf6be46653968f855f7c5e41614ff5d7a854efef7c"),
        ("sensor_msgs/msg/FluidPressure", "22dfb2b145a0bd5a31a1ac3882a1b32148b51d9b2f3bab250290d66f3595bc32"),
        ("sensor_msgs/msg/JointState", "a13ee3a330e346c9d87b5aa18d24e11690752bd33a0350f11c5882bc9179260e"),
        ("governor_msgs/msg/GovernorCommand", "2ca93afe4a8d6a6fee83a453a093c0436f5e0f6f085a48ffa3ac2ab84a041274"),
        ("governor_msgs/msg/EsvState", "c2807f993dead37833f7729188d2ef90c78d187a4b82c755b74de4f01be7c349"),
        ("governor_msgs/msg/ServoState", "06d452295e172d11450635c43e0c961291182a6e6292761bee01039fc89907cd"),
    ] {
        assert_eq!(type_hash(name).unwrap(), format!("RIHS01_{hash}"), "{name}");
    }
}

/// Fixed arrays and bounded ones, by two standard types that have them.
#[test]
fn hashes_know_arrays_and_bounds() {
    let imu = "std_msgs/Header header\ngeometry_msgs/Quaternion orientation\nfloat64[9] orientation_covariance\n\
        geometry_msgs/Vector3 angular_velocity\nfloat64[9] angular_velocity_covariance\n\
        geometry_msgs/Vector3 linear_acceleration\nfloat64[9] linear_acceleration_covariance\n\
        ===\nMSG: geometry_msgs/Quaternion\nfloat64 x 0\nfloat64 y 0\nfloat64 z 0\nfloat64 w 1\n\
        ===\nMSG: geometry_msgs/Vector3\nfloat64 x\nfloat64 y\nfloat64 z\n\
        ===\nMSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id\n\
        ===\nMSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n";
    let solid = "uint8 BOX=1\nuint8 SPHERE=2\nuint8 type\nfloat64[<=3] dimensions\ngeometry_msgs/Polygon polygon\n\
        ===\nMSG: geometry_msgs/Polygon\nPoint32[] points\n\
        ===\nMSG: geometry_msgs/Point32\nfloat32 x\nfloat32 y\nfloat32 z\n";
    for (name, schema, hash) in [
        ("sensor_msgs/msg/Imu", imu, "7d9a00ff131080897a5ec7e26e315954b8eae3353c3f995c55faf71574000b5b"),
        ("shape_msgs/msg/SolidPrimitive", solid, "2802a15190aadc3f496584df4b0b4c5824d8a0b31aaef839faa75bc34dda38ac"),
    ] {
        assert_eq!(hash_of(&parse_schema(name, schema).unwrap()), format!("RIHS01_{hash}"), "{name}");
    }
}

#[test]
fn a_schema_holds_every_dependency_once() {
    let schema = schema_of("sensor_msgs/msg/JointState").unwrap();
    let rule = "=".repeat(80);
    assert_eq!(schema.lines().filter(|line| *line == rule).count(), 2);
    assert!(schema.contains(&format!("{rule}\nMSG: std_msgs/Header\n")));
    assert!(schema.contains(&format!("{rule}\nMSG: builtin_interfaces/Time\n")));
    let parsed = parse_schema("sensor_msgs/msg/JointState", &schema).unwrap();
    assert_eq!(parsed, closure_of("sensor_msgs/msg/JointState").unwrap());
}

#[test]
fn a_definition_that_cannot_be_read_is_shown() {
    for line in ["float64", "float64[x] a", "float64 two-words", "float64[ a"] {
        let error = Definition::parse("a/msg/B", line).unwrap_err();
        assert!(error.to_string().contains(line), "{error}");
    }
    assert!(text_of("a/msg/B").unwrap_err().to_string().contains("a/msg/B"));
}
