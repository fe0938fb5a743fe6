//! Plate files: the items of a unit's name plate and manual, in the units used there.
//!
//! ```yaml
//! name: unit 3
//! source: plate and commissioning report of 1998     # of every value that names no other
//! tank_pressure: 63 bar
//! servomotor_stroke: 600 mm
//! closing_time: {value: 6.5 s, tol: 0.05, source: rejection test 2021}
//! ```

use std::path::Path;

use crate::sheet::item::item;
use crate::sheet::{GivenValue, ITEMS, Plate, PlateItem};
use govtwin_model::params::error::{FileProblem, ParamsError};
use govtwin_model::params::suggest::nearest;
use govtwin_model::params::yaml::{Document, Node, parse};

/// Reads a plate file.
///
/// # Errors
/// When it cannot be read, or holds anything that is not right; all problems come at once.
pub fn load_plate(path: &Path) -> Result<Plate, ParamsError> {
    let text = govtwin_model::params::read("plate", path)?;
    plate_of(&text).map_err(|problems| ParamsError::Invalid { what: "plate", path: path.to_path_buf(), problems })
}

/// One value as people write it on a command line, `tank_pressure=63 bar`.
///
/// # Errors
/// In words.
pub fn plate_value(text: &str) -> Result<(&'static str, GivenValue), String> {
    let (key, value) = text.split_once('=').ok_or_else(|| format!("expected KEY=VALUE, found `{text}`"))?;
    let item = find(key.trim())?;
    Ok((item.key, given(item, value.trim(), None, String::new())?))
}

fn find(key: &str) -> Result<&'static PlateItem, String> {
    item(key).ok_or_else(|| {
        let hint = match nearest(key, ITEMS.iter().map(|item| item.key)) {
            Some(near) => format!("did you mean `{near}`?"),
            None => "`govtwin sheet new --template` lists all".to_owned(),
        };
        format!("there is no such item; {hint}")
    })
}

fn given(item: &PlateItem, text: &str, tolerance_share: Option<f64>, source: String) -> Result<GivenValue, String> {
    let value = item.dimension.parse(text).map_err(|error| error.to_string())?;
    if !(item.least..=item.most).contains(&value) {
        let unit = item.dimension.unit();
        let (least, most) = (item.least, item.most);
        return Err(format!("{value} {unit} makes no sense of {}; expected {least} to {most} {unit}", item.key));
    }
    Ok(GivenValue { value, tolerance_share, text: text.to_owned(), source })
}

fn plate_of(text: &str) -> Result<Plate, Vec<FileProblem>> {
    let document = parse(text)
        .map_err(|error| vec![FileProblem { line: error.line, key: String::new(), message: error.message }])?;
    let pairs = match &document.root {
        Node::Map(pairs) => pairs.as_slice(),
        Node::Null => &[],
        other => {
            let message =
                format!("a plate file holds items such as `tank_pressure: 63 bar`; this is {}", other.describe());
            return Err(vec![FileProblem { line: None, key: String::new(), message }]);
        }
    };
    let mut plate = Plate::default();
    let mut problems = vec![];
    let source = document.text("source").unwrap_or_default();
    for (key, node) in pairs.iter().filter(|(key, node)| key != "source" && *node != Node::Null) {
        if let ("name", Node::Text(name)) = (key.as_str(), node) {
            plate.name.clone_from(name);
            continue;
        }
        match find(key).and_then(|item| Ok((item.key, read(item, node, source)?))) {
            Ok((key, given)) => drop(plate.values.insert(key, given)),
            Err(message) => problems.push(FileProblem { line: line(&document, key), key: key.clone(), message }),
        }
    }
    if problems.is_empty() { Ok(plate) } else { Err(problems) }
}

fn line(document: &Document, key: &str) -> Option<usize> {
    document.line(&[key])
}

fn read(item: &PlateItem, node: &Node, source: &str) -> Result<GivenValue, String> {
    let words = |node: &Node| match node {
        Node::Text(text) => Ok(text.clone()),
        Node::Number(number) => Ok(number.to_string()),
        other => Err(format!("expected a value such as `{}`, found {}", item.example, other.describe())),
    };
    let Node::Map(pairs) = node else { return given(item, &words(node)?, None, source.to_owned()) };
    let get = |key: &str| pairs.iter().find(|(known, _)| known == key).map(|(_, node)| node);
    if let Some((key, _)) = pairs.iter().find(|(key, _)| !["value", "tol", "source"].contains(&key.as_str())) {
        return Err(format!("`{key}` is none of value, tol, source"));
    }
    let value = get("value").ok_or_else(|| format!("expected `{{value: {}, …}}`", item.example))?;
    let tolerance = match get("tol") {
        None => None,
        Some(Node::Number(share)) if (0.0..=2.0).contains(share) => Some(*share),
        Some(other) => return Err(format!("tol: expected a share of the value, 0 to 2, found {}", other.describe())),
    };
    let source = match get("source") {
        None => source.to_owned(),
        Some(node) => words(node)?,
    };
    given(item, &words(value)?, tolerance, source)
}

/// A plate file to fill in: every item with its meaning and an example, commented out.
pub fn plate_template() -> String {
    let mut lines = vec![
        "# What stands on the name plate and in the manual. Take away the # before what you know; the examples are the reference unit's.".to_owned(),
        "# Needed: tank_pressure, and the servomotor's size by stroke with volume, area or bore. Everything else sharpens the sheet.".to_owned(),
        "# A value takes a unit, and where you know them a tolerance (one standard deviation, a share) and a source:".to_owned(),
        "#   closing_time: {value: 6.5 s, tol: 0.05, source: rejection test 2021}".to_owned(),
        "name: my unit".to_owned(),
        String::new(),
    ];
    for item in ITEMS {
        lines.push(format!("# {}: {:<12} # {}", item.key, item.example, item.doc));
    }
    lines.push(String::new());
    lines.join("\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_filled_template_is_the_whole_plate() {
        let filled: String = plate_template()
            .lines()
            .map(|line| match line.strip_prefix("# ") {
                Some(rest) if item(rest.split(':').next().unwrap_or_default()).is_some() => format!("{rest}\n"),
                _ => format!("{line}\n"),
            })
            .collect();
        let plate = plate_of(&filled).unwrap_or_else(|problems| panic!("{problems:?}\n{filled}"));
        assert_eq!(plate.values.len(), ITEMS.len());
        assert_eq!(plate.get("servomotor_volume"), Some(0.12));
    }

    #[test]
    fn slips_come_at_once_with_lines_and_a_way_out() {
        let text = "tank_pressure: 63 mm\nservo_stroke: 1\nclosing_time: {value: 5 s, tolerance: 1}\nservomotor_stroke: 600\nopening_time: [1]\n";
        let problems = plate_of(text).unwrap_err();
        let said: Vec<String> = problems.iter().map(|problem| format!("{:?} {problem}", problem.line)).collect();
        for (number, words) in [
            (0, "Some(1) tank_pressure: expected a number and one of the units Pa, bar"),
            (1, "did you mean `servomotor_stroke`?"),
            (2, "`tolerance` is none of value, tol, source"),
            (3, "600 m makes no sense of servomotor_stroke; expected 0.01 to 5 m"),
            (4, "expected a value such as `7.1 s`, found a list"),
        ] {
            assert!(said[number].contains(words), "{words}: {said:?}");
        }
    }
}
