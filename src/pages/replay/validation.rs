//! Limits of a replay, how they stand, and the stretches in which they are broken.

use super::super::page::PageBody;
use super::super::table::Table;
use super::curves::Pictures;
use govtwin_diagnosis::replay_validation::{Check, Standing, Validation, short_name};
use govtwin_model::number::significant;

/// Checks that the page lists; those that fail come first.
const MOST_LISTED: usize = 60;

/// Stretches that are drawn.
const MOST_DRAWN: usize = 12;

/// Shows a validation; `pictures` hold the stretches of the recordings.
pub(crate) fn show(body: &mut PageBody, validation: &Validation, pictures: &[Pictures]) {
    body.heading("Limits");
    let mut table =
        Table::new().words("recording or process").words("limit").numbers("value").numbers("bound").words("");
    let (broken, kept): (Vec<&Check>, Vec<&Check>) = validation.checks.iter().partition(|check| check.is_broken());
    for check in broken.iter().chain(&kept).take(MOST_LISTED) {
        let word = match (check.standing, &check.reason) {
            (Standing::Passes, _) => "passes".to_owned(),
            (Standing::Fails, _) => "fails".to_owned(),
            (Standing::NotMeasured, reason) => format!("fails: {}", reason.as_deref().unwrap_or("not measured")),
        };
        let name = format!("{}.{}", short_name(check.signal), check.measure.id());
        let limit = if check.limit.contains(&name) { check.limit.clone() } else { format!("{name}: {}", check.limit) };
        let (value, bound) =
            (shown(check, check.value), format!("{} {}", check.side.sign(), shown(check, check.bound)));
        let cells = [check.of.clone(), limit, value, bound, word];
        if check.is_broken() { table.strong_row(cells) } else { table.row(cells) }
    }
    let left_out = validation.checks.len().saturating_sub(MOST_LISTED);
    let caption = if left_out > 0 { format!("{left_out} more checks are in the JSON.") } else { String::new() };
    body.table(table, caption);
    for (svg, limits) in pictures.iter().flat_map(|pictures| &pictures.broken).take(MOST_DRAWN) {
        body.figure(svg.clone(), format!("Fails: {}.", limits.join("; ")));
    }
}

/// A figure as people read it.
fn shown(check: &Check, value: f64) -> String {
    match check.unit {
        "pu" => format!("{} %", significant(100.0 * value, 3)),
        "Pa" => format!("{} kPa", significant(1e-3 * value, 3)),
        _ => significant(value, 5),
    }
}
