//! Limits files: the limits of an acceptance test.
//!
//! ```yaml
//! name: contract of 1998, annex 3
//! source: IEC 60308                    # of every limit that names no other
//! dead_band_pu: {max: 2.0e-4}
//! closing_time_s: {min: 6.0, max: 7.0, source: transient study 2021}
//! ```

use std::path::Path;

use crate::acceptance::Measure;
use crate::acceptance::limits::{AcceptanceLimits, Limit};
use govtwin_model::params::error::{FileProblem, ParamsError};
use govtwin_model::params::suggest::nearest;
use govtwin_model::params::yaml::{Node, parse};

/// Reads a limits file.
///
/// # Errors
/// When it cannot be read, or holds anything that is not right; all problems come at once.
pub fn load_limits(path: &Path) -> Result<AcceptanceLimits, ParamsError> {
    let text = govtwin_model::params::read("limits", path)?;
    limits_of(&text).map_err(|problems| ParamsError::Invalid { what: "limits", path: path.to_path_buf(), problems })
}

fn limits_of(text: &str) -> Result<AcceptanceLimits, Vec<FileProblem>> {
    let document = parse(text)
        .map_err(|error| vec![FileProblem { line: error.line, key: String::new(), message: error.message }])?;
    let Node::Map(pairs) = &document.root else {
        let message = format!(
            "a limits file holds measures such as `dead_time_s: {{max: 0.2}}`; this is {}",
            document.root.describe()
        );
        return Err(vec![FileProblem { line: None, key: String::new(), message }]);
    };
    let source = document.text("source").unwrap_or_default();
    let mut limits = AcceptanceLimits { name: document.text("name").unwrap_or_default().to_owned(), of: vec![] };
    let mut problems = vec![];
    for (key, node) in pairs.iter().filter(|(key, _)| key != "name" && key != "source") {
        match measure(key).and_then(|measure| Ok((measure, limit(node, source)?))) {
            Ok(read) => limits.of.push(read),
            Err(message) => problems.push(FileProblem { line: document.line(&[key]), key: key.clone(), message }),
        }
    }
    if limits.of.is_empty() && problems.is_empty() {
        let message = "no limit in it; `govtwin accept --template` prints a file with all measures".to_owned();
        problems.push(FileProblem { line: None, key: String::new(), message });
    }
    if problems.is_empty() { Ok(limits) } else { Err(problems) }
}

fn measure(key: &str) -> Result<Measure, String> {
    Measure::find(key).ok_or_else(|| match nearest(key, Measure::ALL.map(Measure::id)) {
        Some(near) => format!("there is no such measure; did you mean `{near}`?"),
        None => "there is no such measure; `govtwin accept --template` lists all".to_owned(),
    })
}

fn limit(node: &Node, source: &str) -> Result<Limit, String> {
    let Node::Map(pairs) = node else {
        return Err(format!("expected `{{max: NUMBER}}`, `{{min: NUMBER}}` or both, found {}", node.describe()));
    };
    let mut limit = Limit { source: source.to_owned(), ..Limit::default() };
    for (key, node) in pairs {
        match (key.as_str(), node) {
            ("min", Node::Number(value)) if value.is_finite() && *value >= 0.0 => limit.min = Some(*value),
            ("max", Node::Number(value)) if value.is_finite() && *value >= 0.0 => limit.max = Some(*value),
            ("min" | "max", other) => {
                return Err(format!(
                    "{key}: expected a number of 0 or more in the unit of the key, found {}",
                    other.describe()
                ));
            }
            ("source", Node::Text(words)) => limit.source.clone_from(words),
            ("source", Node::Number(number)) => limit.source = number.to_string(),
            _ => return Err(format!("`{key}` is none of min, max, source")),
        }
    }
    match (limit.min, limit.max) {
        (None, None) => Err("expected `min`, `max` or both".to_owned()),
        (Some(min), Some(max)) if min > max => Err(format!("min {min} is above max {max}, so that nothing passes")),
        _ => Ok(limit),
    }
}

/// A limits file to fill in: every measure with how it is computed, commented out.
pub fn limits_template() -> String {
    let mut lines = vec![
        "# Limits of an acceptance test. Take away the # before what your contract or standard limits, and give its numbers.".to_owned(),
        "# Units stand in the keys: s, Hz, pu of full servomotor stroke (0.001 pu is 0.1 %), or a share of the change.".to_owned(),
        "# IEC 60308, IEEE 125 and ASME PTC 29 name such measures; no number here comes from them.".to_owned(),
        "name: my contract".to_owned(),
        "source: annex 3".to_owned(),
    ];
    for measure in Measure::ALL {
        let bound = if measure == Measure::Bandwidth { "min" } else { "max" };
        lines.push(format!("# {}: {}.", measure.title(), measure.definition()));
        lines.push(format!("# {}: {{{bound}: 0.0}}", measure.id()));
    }
    lines.join("\n") + "\n"
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn limits_are_read_with_their_sources() {
        let text = "name: a\nsource: b\ndead_time_s: {max: 0.2}\nclosing_time_s: {min: 6, max: 7.5, source: c}\n";
        let limits = limits_of(text).unwrap();
        assert_eq!(limits.name, "a");
        let closing = limits.limit(Measure::ClosingTime).unwrap();
        assert_eq!((closing.min, closing.max, closing.source.as_str()), (Some(6.0), Some(7.5), "c"));
        assert_eq!(limits.limit(Measure::DeadTime).unwrap().source, "b");
        let whole: String = limits_template()
            .lines()
            .map(|line| line.strip_prefix("# ").filter(|rest| rest.contains("{m")).unwrap_or(line).to_owned() + "\n")
            .collect();
        assert_eq!(limits_of(&whole).unwrap().of.len(), Measure::ALL.len());
    }

    #[test]
    fn slips_come_at_once_with_lines_and_a_way_out() {
        let text = "dead_tme_s: {max: 1}\ndead_time_s: 0.2\novershoot_share: {max: 5 %}\nopening_time_s: {min: 9, max: 7}\nbandwidth_hz: {least: 1}\ncushion_time_s: {}\nhysteresis_pu: {max: -1}\n";
        let problems = limits_of(text).unwrap_err();
        let said: Vec<String> = problems.iter().map(|problem| format!("{:?} {problem}", problem.line)).collect();
        for (number, words) in [
            (0, "Some(1) dead_tme_s: there is no such measure; did you mean `dead_time_s`?"),
            (1, "expected `{max: NUMBER}`"),
            (2, "max: expected a number of 0 or more in the unit of the key, found the text \"5 %\""),
            (3, "min 9 is above max 7, so that nothing passes"),
            (4, "`least` is none of min, max, source"),
            (5, "expected `min`, `max` or both"),
            (6, "found the number -1"),
        ] {
            assert!(said[number].contains(words), "{words}: {said:?}");
        }
        for text in ["- 1", "", "a: [", "name: x\n"] {
            assert_eq!(limits_of(text).unwrap_err().len(), 1, "{text}");
        }
    }
}
