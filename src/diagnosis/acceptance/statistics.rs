//! Intervals: several events of one kind, and a table's worth of blocks.

use statrs::distribution::{ContinuousCDF, StudentsT};

use super::{Measure, MeasureFound};
use crate::result::Interval;
use govtwin_model::units::NORMAL_90;

/// One event: what it shows, and the standard deviation with which it shows it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MeasuredEvent {
    /// The value, in the measure's unit.
    pub value: f64,
    /// Its standard deviation, in the measure's unit.
    pub sd: f64,
}

/// Half-width of an interval of nine in ten by Student's distribution, standard deviations.
pub fn student_90(freedom: f64) -> f64 {
    StudentsT::new(0.0, 1.0, freedom.max(1.0)).map_or(NORMAL_90, |student| student.inverse_cdf(0.95))
}

/// Mean and standard deviation of one value.
pub fn mean_and_sd(values: &[f64]) -> (f64, f64) {
    let count = values.len() as f64;
    let mean = values.iter().sum::<f64>() / count;
    let square = values.iter().map(|value| (value - mean).powi(2)).sum::<f64>();
    (mean, (square / (count - 1.0).max(1.0)).sqrt())
}

/// The mean of events: as wide as they differ, and no narrower than each is known.
pub fn mean(events: &[MeasuredEvent]) -> Option<Interval> {
    if events.is_empty() {
        return None;
    }
    let count = events.len() as f64;
    let values: Vec<f64> = events.iter().map(|event| event.value).collect();
    let (value, spread) = mean_and_sd(&values);
    let known = NORMAL_90 * events.iter().map(|event| event.sd * event.sd).sum::<f64>().sqrt() / count;
    let seen = if events.len() > 1 { student_90(count - 1.0) * spread / count.sqrt() } else { 0.0 };
    let half = known.max(seen);
    Some(Interval { value, low: (value - half).max(0.0), high: value + half })
}

/// The mean of events as a measure; `missing` states what it needs if there is none.
pub fn found(measure: Measure, events: &[MeasuredEvent], missing: &str) -> MeasureFound {
    let note = if events.is_empty() { missing.to_owned() } else { String::new() };
    MeasureFound { measure, value: mean(events), events: events.len(), note }
}

/// A measure that the movements do not show.
pub fn missing(measure: Measure, why: impl Into<String>) -> MeasureFound {
    MeasureFound { measure, value: None, events: 0, note: why.into() }
}

#[cfg(test)]
mod tests {
    use super::{MeasuredEvent, mean};

    #[test]
    fn the_mean_of_events_is_as_wide_as_they_differ_and_no_narrower_than_each_is_known() {
        let of = |values: &[f64], sd: f64| {
            mean(&values.iter().map(|&value| MeasuredEvent { value, sd }).collect::<Vec<_>>()).unwrap()
        };
        let one = of(&[2.0], 0.1);
        assert!((one.high - 2.1645).abs() < 1e-9 && (one.low - 1.8355).abs() < 1e-9);
        // Student's t of one degree of freedom is 6.314: two events that differ determine little.
        let two = of(&[1.0, 2.0], 0.0);
        assert!((two.high - two.value - 6.314 * 0.5).abs() < 1e-3 && two.low == 0.0);
        let alike = of(&[1.0, 1.0, 1.0, 1.0], 0.2);
        assert!((alike.high - 1.0 - 1.645 * 0.1).abs() < 1e-9);
        assert!(mean(&[]).is_none());
    }
}
