//! How much the sheet limits a verdict, in words and as a table.

use crate::table::Table;
use govtwin_diagnosis::result::{DetectableSize, Diagnosis, SheetLimits, SheetValue};
use govtwin_diagnosis::words::{id_words, parameter_words, percent, shown_unit};
use govtwin_model::number::{fixed, quantity, significant};

/// Values that are named in a sentence, and that a page shows.
const NAMED: usize = 3;
const SHOWN: usize = 10;

/// A value with one standard deviation of its tolerance.
fn tolerance(value: &SheetValue) -> String {
    let (low, high) = value.tolerance;
    format!("{} to {}", quantity(low, value.unit), quantity(high, value.unit))
}

/// What looking values up would settle.
fn looking_up(limits: &SheetLimits) -> String {
    let open = significant(limits.open_bits, 2);
    let Some(first) = limits.next() else {
        return format!(
            "no value is worth looking up, as none is expected to settle 0.01 bit or more; {open} bits are open between the fault sets"
        );
    };
    let mut text = format!(
        "look up {} ({}): it is expected to settle {} of the {open} bits that are open between the fault sets",
        first.key,
        tolerance(first),
        significant(first.bits, 2)
    );
    let others: Vec<String> = limits
        .values
        .iter()
        .filter(|one| one.key != first.key && one.bits >= 0.5 * first.bits)
        .take(NAMED - 1)
        .map(|one| format!("{} ({})", one.key, significant(one.bits, 2)))
        .collect();
    if !others.is_empty() {
        text.push_str(&format!("; or {}", others.join(", ")));
    }
    text
}

/// The effect that the sheet hides most: how much smaller it could be and still show were all values known.
fn hidden(diagnosis: &Diagnosis) -> Option<String> {
    let ratio = |one: &DetectableSize| one.smallest / one.with_known_sheet;
    let finite = diagnosis.detectable_sizes.iter().filter(|one| ratio(one).is_finite());
    let most = finite.max_by(|a, b| ratio(a).total_cmp(&ratio(b)))?;
    (ratio(most) > 1.0).then(|| {
        let shown = |value: f64| quantity(value, shown_unit(most.parameter, most.unit));
        format!(
            "its tolerances hide {} most; the minimum detectable {} is {}, or {} if all values were known exactly",
            id_words(most.id),
            parameter_words(most.parameter, most.unit),
            shown(most.smallest),
            shown(most.with_known_sheet)
        )
    })
}

/// How much the sheet limits the verdict, a sentence each; none where no sheet was given.
pub(crate) fn sentences(diagnosis: &Diagnosis) -> Vec<String> {
    let Some(limits) = &diagnosis.sheet_limits else { return Vec::new() };
    [Some(looking_up(limits)), hidden(diagnosis)].into_iter().flatten().collect()
}

/// The values that limit the verdict most.
pub(crate) fn table(limits: &SheetLimits) -> Table {
    let mut table = Table::new()
        .words("key in the sheet")
        .numbers("data sheet")
        .numbers("± one tolerance")
        .numbers("from recordings")
        .numbers("settles, bits")
        .words("hides, by a factor of");
    for one in limits.values.iter().take(SHOWN) {
        let hides: Vec<String> =
            one.hides.iter().map(|one| format!("{} {}", id_words(&one.id), significant(one.sharper, 2))).collect();
        table.row([
            one.key.clone(),
            quantity(one.sheet, one.unit),
            tolerance(one),
            percent(one.information),
            fixed(one.bits, 3),
            hides.join(", "),
        ]);
    }
    table
}
