//! Where one model loses to another: the error by process and phase, the rows that decide, and how far the twin is off in time.
//!
//! Phases go by what was recorded: the row at which the ESV trips and the one behind it, rows at which the measured signal jumps, rows of a
//! motion, and rows at rest. `shift` is by how much the twin's trace must be moved in time to come nearest to the measured one.

use serde::Serialize;

use super::Contender;
use govtwin_correction::guard::{Guard, GuardCounts};
use govtwin_correction::row::RowChannel;
use govtwin_correction::table::FeatureTable;
use govtwin_model::recording::Process;
use govtwin_model::stored::with_words;
use govtwin_model::units::seconds_from_nanos;

/// A signal that changes by more than this from row to row jumps, in its unit, pu; the coefficient's unit is the signal's.
const JUMP: f64 = 0.1;

/// A signal that changes by more than this over five rows moves; the coefficient's unit is the signal's.
const MOTION: f64 = 0.03;

/// Rows that are listed for each process.
const WORST: usize = 8;

/// Rows before and behind the worst one that a picture shows.
pub(crate) const AROUND: usize = 8;

with_words! {
    /// What goes on at a row.
    #[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
    #[serde(rename_all = "snake_case")]
    pub enum Phase: title {
        /// The ESV trips at this row or did at the one before.
        Trip = "trip",
        /// The measured signal jumps.
        Jump = "jump",
        /// It moves.
        Moving = "moving",
        /// It rests, apart from chatter.
        AtRest = "at rest",
    }
}

/// Errors of all models in one phase of a process, in the order of the models.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PhaseErrors {
    /// The phase.
    pub phase: Phase,
    /// Its rows.
    pub rows: u64,
    /// Mean absolute error of each model, in the signal's unit, pu or Pa.
    pub mae: Vec<f64>,
    /// Share of each model's squared error in this process that lies here.
    pub square_shares: Vec<f64>,
}

/// A row that decides.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct DecidingRow {
    /// The recording's index.
    pub recording: usize,
    /// The row's time from the recording's first row in the table, s.
    pub time_s: f64,
    /// Its phase.
    pub phase: Phase,
    /// What was measured, in the signal's unit, pu or Pa.
    pub measured: f64,
    /// What each model says, in the signal's unit, pu or Pa.
    pub said: Vec<f64>,
    /// Index of the row in the table.
    #[serde(skip)]
    pub row: usize,
}

/// One process.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Broken {
    /// Its id.
    pub process: &'static str,
    /// Phases that have rows.
    pub parts: Vec<PhaseErrors>,
    /// By how much each parent's trace comes too late on these rows, s: of the shifts tried the one with the least mean absolute error.
    pub shift_s: Vec<(&'static str, f64)>,
    /// Of what the first model loses to the second in squared error, the share in the listed rows; `null` if it loses nothing.
    pub decided_share: Option<f64>,
    /// The rows on which the first model loses most to the second.
    pub worst: Vec<DecidingRow>,
    /// What the guard would do to these rows.
    pub guard: GuardCounts,
}

/// The whole breakdown.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ErrorBreakdown {
    /// Ids of the models; the first is compared with the second.
    pub models: Vec<&'static str>,
    /// Process by process.
    pub processes: Vec<Broken>,
}

/// The phase of a row.
pub fn phase(table: &FeatureTable, row: usize) -> Phase {
    let mark = &table.marks[row];
    let before = |back: usize| {
        let at = row.checked_sub(back)?;
        (table.marks[at].recording == mark.recording).then_some(at)
    };
    let esv = table.layout.features.iter().position(|feature| feature.is_now() && feature.channel() == RowChannel::Esv);
    let open = |row: usize| esv.and_then(|place| table.row(row).get(place)).copied();
    let trips = |row: Option<usize>, before: Option<usize>| matches!((row.and_then(open), before.and_then(open)), (Some(now), Some(then)) if now < then);
    if trips(Some(row), before(1)) || trips(before(1), before(2)) {
        return Phase::Trip;
    }
    let change = |back: usize| before(back).map_or(0.0, |at| (mark.measured - table.marks[at].measured).abs());
    if change(1) > JUMP {
        Phase::Jump
    } else if (1..=5).any(|back| change(back) > MOTION) {
        Phase::Moving
    } else {
        Phase::AtRest
    }
}

/// Breaks errors down; `rows` are the test rows, and every parent a table with the same rows.
pub fn breakdown(
    parents: &[(&'static str, &FeatureTable)],
    rows: &[usize],
    models: &[&Contender],
    guard: &Guard,
) -> ErrorBreakdown {
    let Some((_, table)) = parents.first() else { return ErrorBreakdown { models: vec![], processes: vec![] } };
    let phases: Vec<Phase> = rows.iter().map(|&row| phase(table, row)).collect();
    let residual_of = |model: usize, at: usize| models[model].estimates[at] - table.marks[rows[at]].measured;
    let of = |process: Process| {
        let own: Vec<usize> = (0..rows.len()).filter(|&at| table.marks[rows[at]].process == process).collect();
        if own.is_empty() {
            return None;
        }
        let squares = |model: usize, at: &[usize]| at.iter().map(|&at| residual_of(model, at).powi(2)).sum::<f64>();
        let part = |phase: Phase| {
            let here: Vec<usize> = own.iter().copied().filter(|&at| phases[at] == phase).collect();
            let mae =
                |model: usize| here.iter().map(|&at| residual_of(model, at).abs()).sum::<f64>() / here.len() as f64;
            let share = |model: usize| squares(model, &here) / squares(model, &own).max(f64::MIN_POSITIVE);
            (!here.is_empty()).then(|| PhaseErrors {
                phase,
                rows: here.len() as u64,
                mae: (0..models.len()).map(mae).collect(),
                square_shares: (0..models.len()).map(share).collect(),
            })
        };
        let lost =
            |at: usize| if models.len() > 1 { residual_of(0, at).powi(2) - residual_of(1, at).powi(2) } else { 0.0 };
        let mut order = own.clone();
        order.sort_by(|a, b| lost(*b).total_cmp(&lost(*a)));
        order.truncate(WORST);
        let all: f64 = own.iter().map(|&at| lost(at)).sum();
        let begin_ns = |recording: usize| {
            table.marks.iter().find(|mark| mark.recording == recording).map_or(0, |mark| mark.time_ns)
        };
        let told = |&at: &usize| {
            let mark = &table.marks[rows[at]];
            DecidingRow {
                recording: mark.recording,
                time_s: seconds_from_nanos(mark.time_ns - begin_ns(mark.recording)),
                phase: phases[at],
                measured: mark.measured,
                said: models.iter().map(|model| model.estimates[at]).collect(),
                row: rows[at],
            }
        };
        let mut guarded = GuardCounts::default();
        for &at in &own {
            let mark = &table.marks[rows[at]];
            guard.apply(models[0].estimates[at] - mark.model, table.row(rows[at]), &mut guarded);
        }
        let here: Vec<usize> = own.iter().map(|&at| rows[at]).collect();
        Some(Broken {
            process: process.id(),
            parts: Phase::ALL.into_iter().filter_map(part).collect(),
            shift_s: parents.iter().map(|(id, table)| (*id, shift_s(table, &here))).collect(),
            decided_share: (all > 0.0).then(|| order.iter().map(|&at| lost(at)).sum::<f64>() / all),
            worst: order.iter().map(told).collect(),
            guard: guarded,
        })
    };
    ErrorBreakdown {
        models: models.iter().map(|model| model.id).collect(),
        processes: Process::ALL.into_iter().filter_map(of).collect(),
    }
}

/// By how much the twin's trace comes too late on some rows, s, to a twentieth of a period.
fn shift_s(table: &FeatureTable, rows: &[usize]) -> f64 {
    let model = |row: Option<usize>, recording: usize| {
        row.and_then(|row| table.marks.get(row)).filter(|mark| mark.recording == recording).map(|mark| mark.model)
    };
    let loss = |share: f64| -> f64 {
        let residual_of = |&row: &usize| {
            let mark = &table.marks[row];
            // A trace that comes too late is read from the row behind.
            let other = if share > 0.0 { row.checked_add(1) } else { row.checked_sub(1) };
            let moved = model(other, mark.recording)
                .map_or(mark.model, |other| mark.model + share.abs() * (other - mark.model));
            (mark.measured - moved).abs()
        };
        rows.iter().map(residual_of).sum()
    };
    let shares = (-20..=20).map(|step| f64::from(step) / 20.0);
    let best = shares.map(|share| (share, loss(share))).min_by(|a, b| a.1.total_cmp(&b.1));
    best.map_or(0.0, |(share, _)| share) * seconds_from_nanos(table.layout.period_ns)
}

#[cfg(test)]
mod tests {
    use super::{Phase, breakdown, phase};
    use crate::comparison::Contender;
    use crate::comparison::tests::made;
    use govtwin_correction::guard::Guard;
    use govtwin_correction::table::FeatureTable;

    /// A twin that comes one row late, and one row at which the first model fails.
    fn late() -> FeatureTable {
        let mut table = made(400).1;
        let models: Vec<f64> = table.marks.iter().map(|mark| mark.measured).collect();
        for (row, mark) in table.marks.iter_mut().enumerate() {
            mark.model = models[row.saturating_sub(1)];
        }
        table
    }

    #[test]
    fn the_row_that_decides_and_the_twin_that_comes_late_are_found() {
        let table = late();
        let rows: Vec<usize> = (100..300).collect();
        let estimates: Vec<f64> = rows.iter().map(|&row| table.marks[row].measured + 0.001).collect();
        let good = Contender { id: "good", title: "good", estimates };
        let mut bad = Contender { id: "bad", ..good.clone() };
        bad.estimates[50] += 0.5;
        let width = table.layout.features.len();
        let guard = Guard { support: vec![[-1e9, 1e9]; width], range: [-0.1, 0.1], reach: None };
        let said = breakdown(&[("late", &table)], &rows, &[&bad, &good], &guard);
        assert_eq!(said.models, ["bad", "good"]);
        let process = &said.processes[0];
        assert_eq!(process.shift_s, [("late", 0.2)]);
        assert_eq!((process.worst[0].row, process.guard.clamped), (150, 1));
        assert!(process.decided_share.unwrap() > 0.999);
        assert_eq!(process.parts.iter().map(|part| part.rows).sum::<u64>(), 200);
        for model in 0..2 {
            let whole: f64 = process.parts.iter().map(|part| part.square_shares[model]).sum();
            assert!((whole - 1.0).abs() < 1e-9);
        }
    }

    #[test]
    fn phases_go_by_what_was_recorded() {
        let mut table = late();
        for mark in &mut table.marks {
            mark.measured = 0.0;
        }
        table.marks[50].measured = 0.3;
        table.marks[80].measured = 0.05;
        assert_eq!(
            [49, 50, 53, 60, 80].map(|row| phase(&table, row)),
            [Phase::AtRest, Phase::Jump, Phase::Moving, Phase::AtRest, Phase::Moving]
        );
        let esv = table.layout.features.iter().position(|feature| feature.name() == "esv").unwrap();
        let width = table.layout.features.len();
        for row in 100..400 {
            table.values[row * width + esv] = 0.0;
        }
        assert_eq!(
            [99, 100, 101, 102].map(|row| phase(&table, row)),
            [Phase::AtRest, Phase::Trip, Phase::Trip, Phase::AtRest]
        );
    }
}
