//! Units in names: a quantity that is a plain number says its unit where it is used.

use govtwin_model::effects::CATALOGUE;
use govtwin_model::parameters::ENTRIES;

use super::source::Source;

/// Endings that are units.
const UNITS: &[&str] = &[
    "m", "m2", "m3", "m_s", "m_s2", "m3_s", "m3_s_pa", "pa", "pa_s", "1_pa", "n", "n_m", "n_s_m", "kg", "kg_m3", "s",
    "ms", "us", "ns", "hz", "rad_s", "pu", "pu_s", "1_s", "w", "j", "px", "percent",
];

/// Endings of numbers that have no unit.
const PLAIN: &[&str] = &["ratio", "share", "gain", "excess", "exponent", "coefficient", "count", "probability"];

/// Symbols that the unit of a composite coefficient is written with, in its doc comment.
const SYMBOLS: &[&str] = &["m", "m²", "m³", "s", "s²", "Pa", "N", "kg", "rad", "Hz", "W", "J", "K", "pu", "1"];

/// Places whose numbers have no unit of their own.
const ELSEWHERE: &[(&str, &str)] = &[
    ("src/bag/chain.rs", "positions in pu and speeds in pu/s, sums of both"),
    ("src/bag/chain/", "positions in pu and speeds in pu/s, sums of both"),
    ("src/bag/channel.rs", "numbers of any channel, in the unit of its signal"),
    ("src/bag/correlation.rs", "numbers of any two channels, in the units of their signals"),
    ("src/bag/evidence.rs", "numbers of any channel, in the unit of its signal"),
    ("src/bag/import/", "values are in the unit that a map states for them"),
    ("src/bag/msg.rs", "names are those of the messages, which state the units"),
    ("src/commands/", "fields are flags, whose help names the unit"),
    ("src/correction/", "corrections, ranges and bands are in the unit of the signal that is corrected"),
    (
        "src/diagnosis/",
        "residuals are in the unit of their signal, costs and likelihoods have none, sizes are in the unit of their effect",
    ),
    ("src/lab/", "shares and means of what is counted; errors in the unit of what is compared"),
    ("src/model/metrics.rs", "errors are in the unit of what is compared"),
    ("src/model/replay/", "errors are in the unit of what is compared"),
    ("src/pages/", "places on paper, and values in the unit of their axis"),
];

/// Fields of one number that say their unit neither in the name nor, for composite coefficients, in the doc comment.
pub fn field_breaches(sources: &[Source]) -> Vec<String> {
    let in_scope =
        |source: &&Source| source.path.starts_with("src/") && !ELSEWHERE.iter().any(|(place, _)| source.is_at(place));
    sources.iter().filter(in_scope).flat_map(file_breaches).collect()
}

struct Field<'a> {
    line: usize,
    name: &'a str,
    scalar: bool,
    doc: &'a str,
}

fn file_breaches(source: &Source) -> Vec<String> {
    let mut breaches = Vec::new();
    let mut open: Option<Vec<Field>> = None;
    let mut doc = "";
    for (index, line) in source.text.lines().enumerate() {
        let code = line.trim();
        if code.contains("struct ") && code.ends_with('{') && !code.starts_with("//") && !code.contains('$') {
            open = Some(Vec::new());
        } else if let Some(fields) = &mut open {
            if let Some(text) = code.strip_prefix("///") {
                doc = text.trim();
            } else if code.starts_with('}') {
                // A row of a table of mixed quantities carries its unit beside its values.
                let mixed = fields.iter().any(|field| field.name == "unit");
                let unsaid = |field: &&Field| field.scalar && !mixed && !says_unit(field);
                breaches.extend(
                    fields
                        .iter()
                        .filter(unsaid)
                        .map(|field| format!("{}:{}: `{}` does not say its unit", source.path, field.line, field.name)),
                );
                open = None;
            } else if let Some((left, right)) = code.split_once(": ") {
                let name = left.rsplit(' ').next().unwrap_or(left);
                let scalar = matches!(right.trim_end_matches(','), "f64" | "Option<f64>" | "f32" | "Option<f32>");
                fields.push(Field { line: index + 1, name, scalar, doc });
                doc = "";
            }
        }
    }
    breaches
}

fn says_unit(field: &Field) -> bool {
    let ends = |ending: &&str| field.name == *ending || field.name.ends_with(&format!("_{ending}"));
    UNITS.iter().any(|unit| field.name.ends_with(&format!("_{unit}"))) || PLAIN.iter().any(ends) || doc_unit(field.doc)
}

/// Whether a doc comment ends in a comma and a unit, such as `m³/(s √Pa)`.
fn doc_unit(doc: &str) -> bool {
    let Some((_, unit)) = doc.trim_end_matches('.').rsplit_once(", ") else { return false };
    if unit.starts_with("in the ") && unit.ends_with("'s unit") {
        return true;
    }
    let mut symbols = unit.split(|c: char| " /()·√".contains(c)).filter(|symbol| !symbol.is_empty()).peekable();
    symbols.peek().is_some() && symbols.all(|symbol| SYMBOLS.contains(&symbol))
}

/// Parameters, of plant and effects, whose name does not end in the unit that they state.
pub fn entry_breaches() -> Vec<String> {
    let plant = ENTRIES.iter().map(|entry| (entry.key.to_owned(), entry.unit));
    let effects = CATALOGUE.iter().flat_map(|spec| {
        spec.parameters.iter().map(|parameter| (format!("{}.{}", spec.id, parameter.name), parameter.unit))
    });
    plant.chain(effects).filter_map(|(key, unit)| entry_breach(&key, unit)).collect()
}

fn entry_breach(key: &str, unit: &str) -> Option<String> {
    let parts: Vec<String> = unit
        .to_lowercase()
        .split(|c: char| !c.is_alphanumeric())
        .filter(|part| !part.is_empty())
        .map(str::to_owned)
        .collect();
    let suffix = format!("_{}", parts.join("_"));
    // What has no unit must not seem to have one; `_pu` marks a ratio of two per-unit values.
    let seems = UNITS.iter().any(|known| *known != "pu" && key.ends_with(&format!("_{known}")));
    let right = key.ends_with(&suffix) || (unit == "1" && !seems);
    (!right).then(|| format!("`{key}` is in {unit}; its name must end in `{suffix}`"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(fields: &str) -> Vec<String> {
        field_breaches(&[Source::new("src/model/a.rs", &format!("pub struct A {{\n{fields}\n}}\n"))])
    }

    #[test]
    fn a_field_without_unit_is_seen() {
        for field in [
            "    pressure: f64,",
            "    pub speed: Option<f64>,",
            "    /// A length, long.\n    pub x: f64,",
            "    pub m: f64,",
        ] {
            assert_eq!(of(field).len(), 1, "{field}");
        }
        for field in [
            "    pressure_pa: f64,",
            "    pub speed_m_s: f64,",
            "    /// Flow per root of pressure drop, m³/(s √Pa).\n    pub conductance: f64,",
            "    damping_ratio: f64,",
            "    values: Vec<f64>,",
            "    unit: &'static str,\n    min: f64,",
        ] {
            assert_eq!(of(field), Vec::<String>::new(), "{field}");
        }
        let stale = "    /// Flow, m³/s.\n    pub flow: f64,\n    pub other: f64,";
        assert_eq!(of(stale).len(), 1, "a doc comment speaks for one field only");
    }

    #[test]
    fn a_parameter_in_another_unit_is_seen() {
        assert!(entry_breach("oil.pressure_bar", "Pa").is_some());
        assert!(entry_breach("oil.pressure_pa", "1").is_some());
        assert!(entry_breach("oil.pressure", "Pa").is_some());
        assert!(entry_breach("oil.leakage_m3_s_pa", "m3/(s Pa)").is_none());
        assert!(entry_breach("valve.damping_ratio", "1").is_none());
    }
}
