//! Whether rows come often enough for a model, and what it assumes of them.
//!
//! A model takes its past on the grid of its training period, whatever the rate of the rows (`history`). Rows that come faster cost it nothing;
//! rows that come more slowly hold no such past, so that they are refused. Where the twin is driven on a finer grid than was recorded, the
//! rows are there, but what happened between the recorded ones is an assumption, which is reported.

use super::model::{Model, ModelError};
use super::table::spacing_ns;
use govtwin_model::recording::{Recording, median_spacing_ns};
use govtwin_model::signal::Signal;
use govtwin_model::units::seconds_from_nanos;

/// What a model assumes wherever it runs.
pub fn assumed(model: &Model) -> String {
    format!(
        "trained on rows every {} s with the opening {} and inputs between rows by `{}`; its past is taken every {} s whatever the rate here",
        seconds_from_nanos(model.period_ns),
        model.opening.id(),
        model.rate_of_inputs.id(),
        seconds_from_nanos(model.period_ns)
    )
}

/// Whether rows at this spacing are slower than a model's; a tenth is left to jitter, as where rows are made.
fn is_slower(model: &Model, spacing_ns: i64) -> bool {
    spacing_ns > model.period_ns + model.period_ns / 10
}

/// Refuses a model whose past cannot be taken from rows at this spacing.
///
/// # Errors
/// Where rows come more slowly than those of its training.
pub fn check_spacing(model: &Model, spacing_ns: i64) -> Result<(), ModelError> {
    if !is_slower(model, spacing_ns) {
        return Ok(());
    }
    let here_s = seconds_from_nanos(spacing_ns);
    Err(ModelError::Mismatch {
        what: "training period",
        found: format!("{} s", seconds_from_nanos(model.period_ns)),
        expected: format!("{here_s} s or longer, as rows come every {here_s} s; train on such rows"),
    })
}

/// Refuses a model for a recording as it drives the twin, and states what it assumes where the recording itself is slower than its training.
///
/// # Errors
/// As [`check_spacing`].
pub fn check(model: &Model, driven: &Recording) -> Result<Option<String>, ModelError> {
    check_spacing(model, median_spacing_ns(driven.frames.iter().map(|frame| frame.time_ns)))?;
    // The servomotor's position runs straight between rows where the twin is driven more finely; nothing else is made up.
    let recorded = Signal::ALL.into_iter().filter(|signal| *signal != Signal::ServomotorPosition);
    let recorded_ns = recorded.map(|signal| spacing_ns(driven, signal)).filter(|ns| *ns > 0).min();
    let slow_ns = recorded_ns.filter(|&ns| is_slower(model, ns));
    Ok(slow_ns.map(|ns| {
        format!(
            "recorded every {} s, while the residual was trained every {} s: it assumes that nothing happens between but what the twin says",
            seconds_from_nanos(ns),
            seconds_from_nanos(model.period_ns)
        )
    }))
}

#[cfg(test)]
mod tests {
    use super::{assumed, check, check_spacing};
    use crate::model::Model;
    use crate::model::tests::model;
    use crate::table::tests::recording;

    const MS: i64 = 1_000_000;

    fn of(period_ns: i64) -> Model {
        Model { period_ns, ..model() }
    }

    #[test]
    fn rows_may_come_faster_than_in_training_and_not_more_slowly() {
        for spacing_ns in [MS, 10 * MS, 200 * MS, 219 * MS] {
            assert_eq!(check_spacing(&of(200 * MS), spacing_ns), Ok(()));
        }
        let words = check_spacing(&of(10 * MS), 200 * MS).unwrap_err().to_string();
        assert!(words.contains("training period is 0.01 s") && words.contains("every 0.2 s"), "{words}");
    }

    #[test]
    fn a_slow_recording_is_refused_and_one_driven_finely_says_what_is_assumed() {
        use govtwin_model::replay::between::drawn;
        let slow = recording("a", 0, 50, |_, _| 0.0);
        assert_eq!(check(&of(200 * MS), &slow), Ok(None));
        assert!(check(&of(10 * MS), &slow).is_err());
        let words = check(&of(10 * MS), &drawn(&slow, 10 * MS).0).unwrap().unwrap();
        assert!(words.starts_with("recorded every 0.2 s"), "{words}");
        assert!(assumed(&of(200 * MS)).contains("every 0.2 s"));
    }
}
