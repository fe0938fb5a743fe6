//! Label files: the true faults of the units of a folder. Only a scorer reads them.

use std::collections::BTreeMap;

use crate::battery::{Label, TrueFault};
use govtwin_model::effects::{Stage, find};
use govtwin_model::params::yaml::{self, Node, parse};

/// A label file that cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum LabelsError {
    /// Not YAML.
    #[error("line {}: {message}", line.map_or_else(|| "?".to_owned(), |line| line.to_string()))]
    Syntax {
        /// Where, counted from 1.
        line: Option<usize>,
        /// The message of the YAML library.
        message: String,
    },
    /// YAML, but no labels.
    #[error("{place}: expected {expected}, found {found}")]
    Shape {
        /// The case or the key.
        place: String,
        /// What belongs there.
        expected: &'static str,
        /// What is there.
        found: String,
    },
}

fn wrong(place: &str, expected: &'static str, found: Option<&Node>) -> LabelsError {
    let found = found.map_or_else(|| "nothing".to_owned(), Node::describe);
    LabelsError::Shape { place: place.to_owned(), expected, found }
}

/// Reads labels by case, which may stand below `units`; `strength`, `rate_hz` and `mismatch` may be absent.
///
/// Effects are a list, as [`write()`] writes it, or sizes by effect with `in_the_catalogue`, `stages` and `gap_over_noise` beside them: what they change
/// over the noise, by signal and process, of which the largest is the strength.
///
/// # Errors
/// When the text is not YAML, or a case is not as the practice labels have it.
pub fn read(text: &str) -> Result<Vec<Label>, LabelsError> {
    let root = match parse(text) {
        Ok(document) => document.root,
        Err(error) => return Err(LabelsError::Syntax { line: error.line, message: error.message }),
    };
    let Node::Map(cases) = get(&root, "units").unwrap_or(&root) else {
        return Err(wrong("the file", "cases by name", Some(&root)));
    };
    cases.iter().map(|(name, node)| label(name, node)).collect()
}

fn label(name: &str, node: &Node) -> Result<Label, LabelsError> {
    let listed = match get(node, "listed").or_else(|| get(node, "in_the_catalogue")) {
        Some(Node::Bool(listed)) => *listed,
        None => true,
        other => return Err(wrong(&format!("{name}.listed"), "true or false", other)),
    };
    let effects = match get(node, "effects") {
        Some(Node::List(effects)) => effects.iter().map(|effect| truth(name, effect)).collect::<Result<_, _>>()?,
        Some(Node::Map(sizes)) => {
            let first = match get(node, "stages") {
                Some(Node::List(stages)) => stages.first(),
                _ => None,
            };
            sizes.iter().map(|(id, size)| of_size(name, (id, size), first)).collect::<Result<_, _>>()?
        }
        other => return Err(wrong(&format!("{name}.effects"), "a list, or sizes by effect", other)),
    };
    let number = |key: &str| match get(node, key) {
        Some(Node::Number(number)) => *number,
        _ => f64::NAN,
    };
    let (rate_hz, mismatch) = (number("rate_hz"), number("mismatch"));
    let strength_ratio = match get(node, "gap_over_noise") {
        Some(Node::Map(processes)) => processes.iter().flat_map(|(_, ratios)| numbers(ratios)).fold(0.0, f64::max),
        _ => number("strength"),
    };
    Ok(Label { name: name.to_owned(), effects, listed, strength_ratio, rate_hz, mismatch })
}

fn numbers(node: &Node) -> impl Iterator<Item = f64> {
    let list = if let Node::List(list) = node { list.as_slice() } else { &[] };
    list.iter().filter_map(|one| if let Node::Number(number) = one { Some(*number) } else { None })
}

/// A true fault by its size; the stage of one that is not in the catalogue stands beside it.
fn of_size(name: &str, (id, size): (&str, &Node), stage: Option<&Node>) -> Result<TrueFault, LabelsError> {
    let Node::Number(size) = size else { return Err(wrong(&format!("{name}.effects.{id}"), "a number", Some(size))) };
    let beside = || match stage {
        Some(Node::Text(stage)) => Stage::with_id(stage),
        _ => None,
    };
    let known = find(id).map(|spec| spec.stage);
    let stage = known
        .or_else(beside)
        .ok_or_else(|| wrong(&format!("{name}.stages"), "a list of stages of the chain", stage))?;
    Ok(TrueFault { id: id.to_owned(), stage, size: *size, unit: String::new(), meaning: String::new() })
}

fn truth(name: &str, node: &Node) -> Result<TrueFault, LabelsError> {
    let text = |key: &str| match get(node, key) {
        Some(Node::Text(text)) => Ok(text.clone()),
        Some(Node::Number(number)) => Ok(number.to_string()),
        other => Err(wrong(&format!("{name}: {key}"), "text", other)),
    };
    let stage = text("stage")?;
    let Some(stage) = Stage::with_id(&stage) else {
        return Err(wrong(&format!("{name}: stage"), "a stage of the chain", get(node, "stage")));
    };
    let size = match get(node, "size") {
        Some(Node::Number(size)) => *size,
        None => f64::NAN,
        other => return Err(wrong(&format!("{name}: size"), "a number", other)),
    };
    let (unit, meaning) = (text("unit").unwrap_or_default(), text("meaning").unwrap_or_default());
    Ok(TrueFault { id: text("id")?, stage, size, unit, meaning })
}

fn get<'a>(node: &'a Node, key: &str) -> Option<&'a Node> {
    let Node::Map(map) = node else { return None };
    yaml::get(map, key)
}

/// Labels as a file of the same format.
pub fn write(labels: &[Label]) -> String {
    let mut text = "# What is truly in each synthetic unit; the scorer alone reads this.\n".to_owned();
    let quoted = |text: &str| serde_json::Value::from(text).to_string();
    for label in labels {
        text += &format!("{}:\n  listed: {}\n", label.name, label.listed);
        if label.strength_ratio.is_finite() {
            text += &format!("  strength: {:.3}\n", label.strength_ratio);
        }
        if label.rate_hz.is_finite() {
            text += &format!("  rate_hz: {}\n", label.rate_hz);
        }
        if label.mismatch.is_finite() {
            text += &format!("  mismatch: {}\n", label.mismatch);
        }
        text += if label.effects.is_empty() { "  effects: []\n" } else { "  effects:\n" };
        for truth in &label.effects {
            let (stage, unit, meaning) = (truth.stage.id(), quoted(&truth.unit), quoted(&truth.meaning));
            text += &format!(
                "    - {{id: {}, stage: {stage}, size: {:e}, unit: {unit}, meaning: {meaning}}}\n",
                truth.id, truth.size
            );
        }
    }
    text
}

/// Reads strengths by case, as [`write_strengths`] writes them.
///
/// # Errors
/// When the text is not YAML, or holds anything but numbers by case.
pub fn read_strengths(text: &str) -> Result<BTreeMap<String, f64>, LabelsError> {
    let root = parse(text).map_err(|error| LabelsError::Syntax { line: error.line, message: error.message })?.root;
    let Node::Map(cases) = &root else { return Err(wrong("the file", "strengths by case", Some(&root))) };
    let strength = |(name, node): &(String, Node)| match node {
        Node::Number(ratio) => Ok((name.clone(), *ratio)),
        other => Err(wrong(name, "a number", Some(other))),
    };
    cases.iter().map(strength).collect()
}

/// Strengths by case as a file ([`Label::strength_ratio`]).
pub fn write_strengths(strengths: &BTreeMap<String, f64>) -> String {
    let head =
        "# RMS by which the faults move the strongest recorded signal, over its noise floor; 0 where there is none.\n";
    let lines = strengths.iter().map(|(name, ratio)| format!("{name}: {ratio:.3}\n"));
    std::iter::once(head.to_owned()).chain(lines).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn labels_are_read_as_they_are_written() {
        let truth = |id: &str, stage, size| TrueFault {
            id: id.into(),
            stage,
            size,
            unit: "Pa s2/m6".into(),
            meaning: "a \"loss\", line".into(),
        };
        let of = |name: &str, effects, listed, strength_ratio| Label {
            name: name.into(),
            effects,
            listed,
            strength_ratio,
            rate_hz: 5.0,
            mismatch: 2.0,
        };
        let labels = vec![
            of("case_01", vec![], true, 0.0),
            of("case_02", vec![truth("supply_loss", Stage::Supply, 2.753e9)], true, 4.5),
            of("case_03", vec![truth("a", Stage::Esv, -1.0), truth("b", Stage::Sensor, 0.02)], false, 1.0),
        ];
        assert_eq!(read(&write(&labels)).unwrap(), labels);
        for (text, expected) in [
            ("a: [", "line"),
            ("- 1", "cases by name"),
            ("a: {listed: 3, effects: []}", "a.listed: expected true or false, found the number 3"),
            ("a: {listed: true}", "a.effects: expected a list, or sizes by effect, found nothing"),
            ("a: {effects: [{id: x, stage: moon}]}", "a stage of the chain"),
        ] {
            let error = read(text).unwrap_err().to_string();
            assert!(error.contains(expected), "{text}: {error}");
        }
    }

    #[test]
    fn sizes_by_effect_are_labels_too() {
        let text = "units:\n  a: {effects: {backlash: 0.003}, in_the_catalogue: true, stages: [servomotor], rate_hz: 5, gap_over_noise: {startup: [2.5, 4], shutdown: [3]}}\n  \
                    b: {effects: {a sticky band: 2}, in_the_catalogue: false, stages: [spool]}\n  c: {effects: {}}\n";
        let labels = read(text).unwrap();
        let units: Vec<(&str, bool)> = labels.iter().map(|label| (label.name.as_str(), label.listed)).collect();
        assert_eq!(units, [("a", true), ("b", false), ("c", true)]);
        let effects = labels.iter().flat_map(|label| &label.effects);
        let effects: Vec<(&str, Stage, f64)> = effects.map(|one| (one.id.as_str(), one.stage, one.size)).collect();
        assert_eq!(effects, [("backlash", Stage::Servomotor, 0.003), ("a sticky band", Stage::Spool, 2.0)]);
        assert!((labels[0].strength_ratio - 4.0).abs() < 1e-12 && labels[2].strength_ratio.is_nan());
        let error = read("b: {effects: {a sticky band: 2}}").unwrap_err().to_string();
        assert!(error.contains("b.stages: expected a list of stages"), "{error}");
    }

    #[test]
    fn strengths_are_read_as_they_are_written() {
        let strengths = BTreeMap::from([("case_001".to_owned(), 0.0), ("case_002".to_owned(), 12.345)]);
        assert_eq!(read_strengths(&write_strengths(&strengths)).unwrap(), strengths);
        for (text, expected) in [("a: [", "line"), ("- 1", "strengths by case"), ("a: much", "a: expected a number")] {
            let error = read_strengths(text).unwrap_err().to_string();
            assert!(error.contains(expected), "{text}: {error}");
        }
    }
}
