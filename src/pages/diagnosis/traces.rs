//! The traces of a diagnosis: measured, refitted, with the effects, and the residual of each over time.

use std::collections::BTreeSet;

use crate::ink::Ink;
use crate::picture::{Mark, MarkShape, Panel, Picture};
use crate::thin::{runs, thin};
use govtwin_diagnosis::result::Trace;
use govtwin_model::signal::Signal;

/// Length of the stretch that shows an error best, s.
pub(crate) const WORST_S: f64 = 2.0;

/// Columns that a curve is thinned to; each keeps up to four points, so a curve has at most 1500.
const COLUMNS: usize = 370;

/// Recordings longer than this get a second picture of the stretch with most of the gap, s.
const LONG_S: f64 = 45.0;

/// Length of that stretch, s.
const CLOSE_UP_S: f64 = 15.0;

/// Columns that the curves of a report are thinned to.
const KEPT_COLUMNS: usize = 120;

/// Most rows of the worst stretch that a report keeps.
const MOST_ROWS: usize = 400;

/// Squared residuals of the refitted twin in the positions, sample by sample, pu².
fn squares(trace: &Trace) -> Vec<f64> {
    let mut all = vec![0.0; trace.time_s.len()];
    for (_, [measured, _, refitted, _]) in trace.signals.iter().filter(|(signal, _)| Signal::POSITIONS.contains(signal))
    {
        for ((sum, one), other) in all.iter_mut().zip(measured).zip(refitted) {
            let residual = one - other;
            *sum += if residual.is_finite() { residual * residual } else { 0.0 };
        }
    }
    all
}

/// Sum of the squared residuals of the refitted twin, pu².
pub(crate) fn gap(trace: &Trace) -> f64 {
    squares(trace).iter().sum()
}

/// The stretch with most of the gap, where the recording is too long to show it.
pub(crate) fn close_up(trace: &Trace) -> Option<[f64; 2]> {
    let (first_s, last_s) = (*trace.time_s.first()?, *trace.time_s.last()?);
    if last_s - first_s < LONG_S { None } else { worst(trace, CLOSE_UP_S) }
}

/// The stretch of so many seconds with most of the gap; none where the recording is hardly longer.
pub(crate) fn worst(trace: &Trace, length_s: f64) -> Option<[f64; 2]> {
    worst_stretch(&trace.time_s, &squares(trace), length_s)
}

/// The stretch of so many seconds in which the squares of an error add up to most; none where there is hardly more, or no error.
pub(crate) fn worst_stretch(time_s: &[f64], squares: &[f64], length_s: f64) -> Option<[f64; 2]> {
    let (first_s, last_s) = (*time_s.first()?, *time_s.last()?);
    if last_s - first_s < 1.5 * length_s {
        return None;
    }
    let mut sums = vec![0.0];
    for square in squares {
        sums.push(sums.last().copied().unwrap_or(0.0) + square);
    }
    let inside = |from_s: f64| {
        let at = |at_s: f64| sums[time_s.partition_point(|t| *t < at_s)];
        at(from_s + length_s) - at(from_s)
    };
    // A window on the way is as good as any other to a quarter of its length.
    let step_s = (0.25 * length_s).min(0.5);
    let starts = (0..20_000).map(|k| first_s + step_s * f64::from(k)).take_while(|from| from + length_s <= last_s);
    let best = starts.max_by(|a, b| inside(*a).total_cmp(&inside(*b)))?;
    Some([best, best + length_s])
}

/// The traces as a report keeps them: all by name, and the curves of the one with most of the error, each row of its worst stretch and few
/// of the rest.
pub fn kept(traces: &[Trace]) -> Vec<Trace> {
    let most = traces.iter().enumerate().max_by(|(_, a), (_, b)| gap(a).total_cmp(&gap(b))).map(|(at, _)| at);
    let one = |(at, trace): (usize, &Trace)| {
        let rows = if Some(at) == most { rows_to_keep(trace) } else { Vec::new() };
        let of = |values: &Vec<f64>| rows.iter().map(|&row| values[row]).collect::<Vec<_>>();
        Trace {
            name: trace.name.clone(),
            process: trace.process,
            time_s: of(&trace.time_s),
            signals: trace.signals.iter().map(|(signal, curves)| (*signal, curves.each_ref().map(of))).collect(),
        }
    };
    traces.iter().enumerate().map(one).collect()
}

/// Rows of a trace that its curves are drawn of: where a curve turns, and all of the worst stretch.
fn rows_to_keep(trace: &Trace) -> Vec<usize> {
    let (Some(&first_s), Some(&last_s)) = (trace.time_s.first(), trace.time_s.last()) else { return Vec::new() };
    let mut rows: BTreeSet<usize> = [0, trace.time_s.len() - 1].into();
    if let Some([from_s, to_s]) = worst(trace, WORST_S) {
        let within = |time_s: f64| trace.time_s.partition_point(|t| *t < time_s);
        let all = within(from_s)..within(to_s);
        let step = all.len().div_ceil(MOST_ROWS).max(1);
        rows.extend(all.step_by(step));
    }
    let window_s = [first_s, last_s];
    for (_, [measured, _, refitted, _]) in &trace.signals {
        for curve in [measured, refitted] {
            let points: Vec<[f64; 2]> =
                trace.time_s.iter().zip(curve).map(|(&t, &y)| [t, y]).filter(|point| point[1].is_finite()).collect();
            let kept = runs(&points).flat_map(|run| thin(run, window_s, KEPT_COLUMNS)).collect::<Vec<_>>();
            rows.extend(kept.iter().map(|point| trace.time_s.partition_point(|t| *t < point[0])));
        }
    }
    rows.into_iter().collect()
}

/// The picture of one recording, of a stretch of it where `window_s` is given; `sheet` is what its sheet is called, `improved` what the twin with
/// effects is called, where there is one.
pub(crate) fn picture(
    trace: &Trace,
    window_s: Option<[f64; 2]>,
    improved: Option<&'static str>,
    sheet: &'static str,
) -> Picture {
    let mut panels = Vec::new();
    for (signal, [measured, delivered, refitted, with_effects]) in &trace.signals {
        if !Signal::POSITIONS.contains(signal) {
            continue;
        }
        let curve = |values: &[f64]| curve(&trace.time_s, values.iter().map(|value| 100.0 * value), window_s);
        let off = |values: &[f64]| {
            let residuals = values.iter().zip(measured).map(|(twin, real)| 100.0 * (twin - real));
            self::curve(&trace.time_s, residuals, window_s)
        };
        let title = signal.title();
        let mut above = Panel::new(format!("{title}, %"))
            .height(150)
            .thick_line("measured", curve(measured))
            .dashed_line(Ink::Difference, "recalibrated", curve(refitted));
        let mut below = Panel::new(format!("{title}, twin − measured, %"))
            .height(110)
            .level(Ink::Band, "", 0.0)
            .mark(thin_line(Ink::Command, sheet, off(delivered)))
            .mark(thin_line(Ink::Difference, "recalibrated", off(refitted)).dashed(1));
        if let Some(improved) = improved {
            above = above.line(Ink::Simulated, improved, curve(with_effects));
            below = below.mark(thin_line(Ink::Simulated, improved, off(with_effects)));
        }
        panels.extend([above.x_name("time, s"), below.x_name("time, s")]);
    }
    if let Some([from_s, to_s]) = window_s {
        panels = panels.into_iter().map(|panel| panel.x_range(from_s, to_s)).collect();
    }
    Picture::stacked(format!("{}: measured and simulated", trace.name), panels)
}

fn thin_line(ink: Ink, label: &str, points: Vec<[f64; 2]>) -> Mark {
    Mark { width_px: 1.0, ..Mark::new(MarkShape::Line(points), ink, label) }
}

fn curve(time_s: &[f64], values: impl Iterator<Item = f64>, window_s: Option<[f64; 2]>) -> Vec<[f64; 2]> {
    // Signals take turns in the rows, so a missing value is no gap.
    let points: Vec<[f64; 2]> =
        time_s.iter().zip(values).filter(|(_, y)| y.is_finite()).map(|(&t, y)| [t, y]).collect();
    let whole = [time_s.first().copied().unwrap_or(0.0), time_s.last().copied().unwrap_or(1.0)];
    runs(&points).flat_map(|run| thin(run, window_s.unwrap_or(whole), COLUMNS)).collect()
}

#[cfg(test)]
mod tests {
    use super::{close_up, curve, gap, worst};
    use govtwin_diagnosis::result::Trace;
    use govtwin_model::recording::Process;
    use govtwin_model::signal::Signal;

    #[test]
    fn the_close_up_holds_the_gap_and_curves_stay_short() {
        let time_s: Vec<f64> = (0..10_000).map(|k| 0.01 * f64::from(k)).collect();
        let measured = vec![0.5; time_s.len()];
        let refitted: Vec<f64> = time_s.iter().map(|t| if (70.0..72.0).contains(t) { 0.6 } else { 0.5 }).collect();
        let twins = [measured.clone(), measured.clone(), refitted.clone(), measured];
        let signals = vec![(Signal::ServomotorPosition, twins)];
        let trace = Trace { name: "a".into(), process: Process::Startup, time_s, signals };
        assert!((gap(&trace) - 2.0).abs() < 0.02);
        let [from_s, to_s] = close_up(&trace).unwrap();
        assert!(from_s <= 70.0 && to_s >= 71.9, "{from_s} to {to_s}");
        let [from_s, to_s] = worst(&trace, 2.0).unwrap();
        assert!((from_s - 70.0).abs() < 0.6 && (to_s - 72.0).abs() < 0.6, "{from_s} to {to_s}");
        assert_eq!(worst(&trace, 90.0), None, "hardly shorter than the whole");
        let points = curve(&trace.time_s, refitted.iter().copied(), None);
        assert!(points.len() <= 1500);
        assert!(points.iter().any(|point| point[1] > 0.59));
    }
}
