//! REP-2016 type hashes (RIHS01): by which ROS 2 since Iron distinguishes two definitions of one name.

use std::collections::BTreeMap;

use super::definition::{Count, Definition, DefinitionError, Field, closure_of};
use super::upkeep::{DescribedField, FieldType, TypeDescription};
use govtwin_files::digest::sha256;

/// The hash of a type that the crate carries, as `RIHS01_` and 64 hexadecimal digits.
///
/// # Errors
/// On a type that the crate does not carry.
pub fn type_hash(type_name: &str) -> Result<String, DefinitionError> {
    Ok(hash_of(&closure_of(type_name)?))
}

/// The hash of a type with its dependencies, the type first.
///
/// It is SHA-256 over the JSON of `type_description_interfaces/TypeDescription` with the separators
/// `, ` and `: `, referenced types sorted by name, default values and comments left out.
pub fn hash_of(closure: &[Definition]) -> String {
    let Some((own, referenced)) = closure.split_first() else { return String::new() };
    let mut referenced: Vec<&Definition> = referenced.iter().collect();
    referenced.sort_by(|a, b| a.type_name.cmp(&b.type_name));
    let own = description(own);
    let referenced = referenced.into_iter().map(description).collect::<Vec<_>>().join(", ");
    let json = format!("{{\"type_description\": {own}, \"referenced_type_descriptions\": [{referenced}]}}");
    format!("RIHS01_{}", sha256(json))
}

fn description(definition: &Definition) -> String {
    let mut fields = definition.fields.iter().map(field).collect::<Vec<_>>().join(", ");
    if fields.is_empty() {
        // An empty structure is not allowed in C; the IDL generator puts this member in.
        fields = field(&Field {
            name: "structure_needs_at_least_one_member".into(),
            base: "uint8".into(),
            string_bound: 0,
            count: Count::One,
        });
    }
    format!("{{\"type_name\": \"{}\", \"fields\": [{fields}]}}", definition.type_name)
}

fn field(field: &Field) -> String {
    let FieldType { type_id, capacity, string_capacity, nested_type_name } = field_type(field);
    format!(
        "{{\"name\": \"{}\", \"type\": {{\"type_id\": {type_id}, \"capacity\": {capacity}, \"string_capacity\": \
         {string_capacity}, \"nested_type_name\": \"{nested_type_name}\"}}}}",
        field.name
    )
}

/// A field's type in the numbers of `type_description_interfaces`.
pub fn field_type(field: &Field) -> FieldType {
    let (series, capacity) = match field.count {
        Count::One => (0, 0),
        Count::Exactly(count) => (48, count),
        Count::AtMost(bound) => (96, bound),
        Count::Any => (144, 0),
    };
    let nested_type_name = if field.base.contains('/') { field.base.clone() } else { String::new() };
    let type_id = base_id(&field.base, field.string_bound > 0) + series;
    FieldType { type_id, capacity, string_capacity: field.string_bound, nested_type_name }
}

/// A described type and all that it is made of as `.msg` texts by name, without comments, constants and defaults.
pub fn texts_of(description: &TypeDescription) -> BTreeMap<String, String> {
    let all = std::iter::once(&description.type_description).chain(&description.referenced_type_descriptions);
    all.map(|one| (one.type_name.clone(), one.fields.iter().map(line_of).collect())).collect()
}

/// The line of a `.msg` text of a described field.
fn line_of(field: &DescribedField) -> String {
    let FieldType { type_id, capacity, string_capacity, nested_type_name } = &field.r#type;
    let (base, string) = match type_id % 48 {
        2 => ("int8", false),
        3 => ("uint8", false),
        4 => ("int16", false),
        5 => ("uint16", false),
        6 => ("int32", false),
        7 => ("uint32", false),
        8 => ("int64", false),
        9 => ("uint64", false),
        10 => ("float32", false),
        11 => ("float64", false),
        15 => ("bool", false),
        16 => ("byte", false),
        17 => ("string", false),
        18 => ("wstring", false),
        21 => ("string", true),
        22 => ("wstring", true),
        _ => (nested_type_name.as_str(), false),
    };
    let bound = if string { format!("<={string_capacity}") } else { String::new() };
    let count = match type_id / 48 {
        0 => String::new(),
        1 => format!("[{capacity}]"),
        2 => format!("[<={capacity}]"),
        _ => "[]".to_owned(),
    };
    format!("{base}{bound}{count} {}\n", field.name)
}

/// Numbers of `type_description_interfaces/msg/FieldType`.
fn base_id(base: &str, bounded: bool) -> u8 {
    match (base, bounded) {
        ("int8", _) => 2,
        // `char` in a .msg file is an alias of uint8.
        ("uint8" | "char", _) => 3,
        ("int16", _) => 4,
        ("uint16", _) => 5,
        ("int32", _) => 6,
        ("uint32", _) => 7,
        ("int64", _) => 8,
        ("uint64", _) => 9,
        ("float32", _) => 10,
        ("float64", _) => 11,
        ("long double", _) => 12,
        ("wchar", _) => 14,
        ("bool", _) => 15,
        ("byte", _) => 16,
        ("string", false) => 17,
        ("wstring", false) => 18,
        ("string", true) => 21,
        ("wstring", true) => 22,
        _ => 1, // a nested type
    }
}
