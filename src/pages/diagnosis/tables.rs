//! The tables of a diagnosis.

use crate::diagnosis::stage::{model_title, parameter_text};
use crate::scale;
use crate::table::Table;
use govtwin_diagnosis::result::{Diagnosis, Fitted, StageOnly};
use govtwin_diagnosis::words::{
    id_words, is_judged, key_words, parameter_words, percent, percents, probability, shown_unit, value, values,
};
use govtwin_model::number::{fixed, quantity, significant};

/// Mean square beyond the noise, over that of the noise, below which only noise remains after recalibration.
const NEXT_TO_NOTHING: f64 = 0.05;

/// RMS errors of the twins and the noise floor, by signal.
pub(crate) fn gap(diagnosis: &Diagnosis, explained: bool) -> Table {
    let mut table = Table::new().words("signal").numbers(diagnosis.setup.sheet_title()).numbers("recalibrated");
    if explained {
        table = table.numbers("with faults");
    }
    table = table.numbers("noise alone").words("unit");
    if explained {
        table = table.numbers("explained");
    }
    for gap in diagnosis.gap.iter().filter(|gap| is_judged(gap)) {
        let (scale, unit) = scale(gap.signal);
        let mut steps = vec![gap.delivered, gap.refitted];
        steps.extend(explained.then_some(gap.with_effects));
        steps.push(gap.noise_floor);
        let mut row = vec![gap.signal.title().to_owned()];
        row.extend(steps.iter().map(|step| significant(step * scale, 3)));
        row.push(unit.to_owned());
        if explained {
            let beyond = gap.refitted.powi(2) - gap.noise_floor.powi(2);
            let closed = gap.refitted.powi(2) - gap.with_effects.powi(2);
            // Of next to nothing no share is a finding.
            let some = beyond > NEXT_TO_NOTHING * gap.noise_floor.powi(2);
            row.push(if some { percent((closed / beyond).min(1.0)) } else { "only noise".to_owned() });
        }
        table.row(row);
    }
    table
}

/// The models of a servomotor stage in free runs over held-out pieces.
pub(crate) fn models(part: &StageOnly) -> Table {
    let mut table = Table::new().words("model").numbers("RMS error, %").numbers("one half, %");
    table = table.numbers("other half, %").numbers("best piece, %").numbers("worst piece, %").words("parameters");
    for model in &part.models {
        let pieces = || model.pieces.iter().copied();
        let ends = [pieces().fold(f64::INFINITY, f64::min), pieces().fold(0.0, f64::max)];
        let errors = [model.held_out, model.halves[0], model.halves[1]].into_iter().chain(ends);
        let row = std::iter::once(model_title(model)).chain(errors.map(|error| significant(100.0 * error, 3)));
        table.row(row.chain([parameter_text(model)]));
    }
    table
}

/// What was fitted of a stage alone, in the numbers of its recordings.
pub(crate) fn stage_figures(part: &StageOnly) -> Table {
    let mut table = Table::new().words("quantity").numbers("value").numbers("90 % from").numbers("to").words("unit");
    for one in &part.figures {
        let [value, low, high] = [one.value.value, one.value.low, one.value.high].map(|value| significant(value, 3));
        table.row([one.title.to_owned(), value, low, high, one.unit.to_owned()]);
    }
    table
}

/// Stages driven by recorded signals.
pub(crate) fn stage_tests(diagnosis: &Diagnosis) -> Table {
    let mut table = Table::new()
        .words("driven part")
        .words("compared signal")
        .numbers("zero error removed, %")
        .numbers("RMS error, %")
        .numbers("mean square over noise");
    for one in &diagnosis.stage_tests {
        table.row([
            one.stage.to_owned(),
            one.signal.title().to_lowercase(),
            if one.zero_error_pu == 0.0 { String::new() } else { significant(100.0 * one.zero_error_pu, 2) },
            significant(100.0 * one.rmse, 3),
            significant(one.excess, 3),
        ]);
    }
    table
}

/// Places of free terms.
pub(crate) fn discrepancy_terms(diagnosis: &Diagnosis) -> Table {
    let mut table = Table::new().words("signal").words("stage").numbers("would explain");
    for one in &diagnosis.discrepancy_terms {
        table.row([
            one.place.to_owned(),
            govtwin_diagnosis::words::stage_title(one.stage).to_owned(),
            percent(one.explains),
        ]);
    }
    table
}

/// What was tried, best first.
pub(crate) fn tried(diagnosis: &Diagnosis) -> Table {
    let mut table =
        Table::new().words("effects").numbers("cost reduction").numbers("held out").words("fitted, with 90 % interval");
    for one in &diagnosis.tried {
        let ids: Vec<String> = one.ids.iter().map(|id| id_words(id)).collect();
        let cells =
            [ids.join(" + "), significant(one.gain, 3), significant(one.held_out_gain, 3), values(&one.parameters)];
        let blamed = !one.ids.is_empty()
            && one.ids.len() == diagnosis.blamed.len()
            && one.ids.iter().all(|id| diagnosis.blamed.iter().any(|blame| blame.id == *id));
        if blamed { table.strong_row(cells) } else { table.row(cells) }
    }
    table
}

/// Explained fraction on recordings that were left out.
pub(crate) fn transfers(diagnosis: &Diagnosis) -> Table {
    let mut table = Table::new().words("held-out recording").numbers("error explained, with 90 % interval");
    for one in &diagnosis.transfers {
        table.row([one.recording.clone(), percents(one.explained_fraction)]);
    }
    table
}

/// The effects that the verdict names; of two also what each explains in addition to the other.
pub(crate) fn blamed(diagnosis: &Diagnosis) -> Table {
    let mut table = Table::new()
        .words("effect")
        .words("stage")
        .numbers("probability")
        .words("fitted, with 90 % interval")
        .numbers("explains alone");
    let two = diagnosis.blamed.iter().any(|one| one.last_in.is_some());
    if two {
        table = table.numbers("in addition to the other").numbers("Shapley share");
    }
    for one in &diagnosis.blamed {
        let mut row = vec![
            id_words(&one.id),
            govtwin_diagnosis::words::stage_title(one.stage).to_owned(),
            probability(one.probability),
            values(&one.parameters),
            percents(one.explained_fraction),
        ];
        if two {
            row.extend([one.last_in, one.shapley].map(|share| share.map_or_else(String::new, percent)));
        }
        table.row(row);
    }
    table
}

/// Further informative tests.
pub(crate) fn experiments(diagnosis: &Diagnosis) -> Table {
    let mut table = Table::new()
        .words("test")
        .words("distinguishes")
        .numbers("entropy drop, bits")
        .numbers("bits/min")
        .numbers("length, s")
        .numbers("ESV trips");
    for one in &diagnosis.experiments {
        let names: Vec<String> = one.separates.iter().map(|name| super::next_test::hypothesis_words(name)).collect();
        table.row([
            one.test.clone(),
            govtwin_diagnosis::words::listed(&names, "from"),
            span(one.expected_drop_bits, one.at_most_bits),
            significant(one.bits_per_minute, 2),
            super::next_test::length_s(one),
            one.trips.to_string(),
        ]);
    }
    table
}

/// `0.14 to 0.17`; one figure where both read the same.
fn span(low: f64, high: f64) -> String {
    let [low, high] = [low, high].map(|end| significant(end, 2));
    if low == high { low } else { format!("{low} to {high}") }
}

/// Pairs that look alike here.
pub(crate) fn ambiguous_pairs(diagnosis: &Diagnosis) -> Table {
    let mut table = Table::new().words("effect").words("similar to").numbers("cosine");
    for (one, other, likeness) in &diagnosis.ambiguous_pairs {
        table.row([id_words(one), id_words(other), fixed(*likeness, 3)]);
    }
    table
}

/// Smallest visible effects.
pub(crate) fn detectable_sizes(diagnosis: &Diagnosis) -> Table {
    let mut table = Table::new()
        .words("effect")
        .words("parameter")
        .numbers("minimum detectable")
        .numbers("moderate fault")
        .words("here");
    for one in &diagnosis.detectable_sizes {
        let seen = if one.smallest <= one.typical.abs() {
            "detectable"
        } else if one.smallest <= 10.0 * one.typical.abs() {
            "only if large"
        } else {
            "not detectable"
        };
        let shown = |value: f64| quantity(value, shown_unit(one.parameter, one.unit));
        // Many times a moderate fault is a size that no unit has.
        let smallest = if seen == "not detectable" { "none".to_owned() } else { shown(one.smallest) };
        table.row([
            id_words(one.id),
            parameter_words(one.parameter, one.unit),
            smallest,
            shown(one.typical),
            seen.to_owned(),
        ]);
    }
    table
}

/// The sheet's parameters as fitted, those most moved first.
pub(crate) fn parameters(diagnosis: &Diagnosis) -> Table {
    let mut table = Table::new()
        .words("value")
        .numbers("data sheet")
        .numbers("fitted, with 90 % interval")
        .numbers("σ from sheet")
        .numbers("from recordings")
        .words("")
        .words("key in the sheet");
    let mut all: Vec<&Fitted> = diagnosis.parameters.iter().collect();
    all.sort_by(|a, b| b.position.abs().total_cmp(&a.position.abs()));
    for one in all {
        table.row([
            key_words(&one.name),
            quantity(one.sheet, one.unit),
            value(one),
            fixed(one.position, 2),
            percent(one.information),
            if one.at_bound { "at its bound".to_owned() } else { String::new() },
            one.name.clone(),
        ]);
    }
    table
}

/// Values of the data sheet that moved far, farthest first.
pub(crate) fn moved(far: &[&Fitted]) -> Table {
    let mut table = Table::new()
        .words("value")
        .numbers("data sheet")
        .numbers("recalibrated")
        .numbers("σ from sheet")
        .words("")
        .words("key in the sheet");
    for one in far {
        table.row([
            key_words(&one.name),
            quantity(one.sheet, one.unit),
            quantity(one.value.value, one.unit),
            fixed(one.position, 1),
            if one.at_bound { "at its bound".to_owned() } else { String::new() },
            one.name.clone(),
        ]);
    }
    table
}

/// The channels as found.
pub(crate) fn channels(diagnosis: &Diagnosis) -> Table {
    let mut table = Table::new()
        .words("recording")
        .words("signal")
        .numbers("samples")
        .numbers("rate, Hz")
        .numbers("resolution")
        .numbers("noise")
        .words("unit")
        .words("remarks");
    for one in &diagnosis.channels {
        let (scale, unit) = scale(one.signal);
        table.row([
            one.recording.clone(),
            one.signal.title().to_lowercase(),
            one.samples.to_string(),
            significant(one.rate_hz, 3),
            significant(one.step * scale, 2),
            significant(one.noise * scale, 2),
            unit.to_owned(),
            if one.troubles.is_empty() { "none".to_owned() } else { one.troubles.join("; ") },
        ]);
    }
    table
}
