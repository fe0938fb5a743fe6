//! The pictures of a diagnosis but for its traces: shares, probabilities, recovered shapes.

use crate::ink::Ink;
use crate::picture::{Mark, MarkShape, Panel, Picture};
use crate::scale;
use govtwin_diagnosis::result::{Breakdown, Diagnosis, DiscrepancyTerm, SignalGap, Verdict};
use govtwin_diagnosis::words::{id_words, is_judged, stage_title};
use govtwin_model::signal::Signal;

/// How many rows the ranking shows.
const RANKED: usize = 10;

/// Height of a lying bar with its air, px.
const BAR_PX: u32 = 22;

fn height(bars: usize) -> u32 {
    BAR_PX * u32::try_from(bars.max(2)).unwrap_or(10)
}

/// RMS errors of the twins, a panel for each signal.
pub(crate) fn residuals(diagnosis: &Diagnosis, explained: bool) -> Picture {
    let panel = |gap: &SignalGap| {
        let (scale, unit) = scale(gap.signal);
        let mut steps = vec![(diagnosis.setup.sheet_title(), gap.delivered), ("recalibrated", gap.refitted)];
        if explained {
            steps.push(("with faults", gap.with_effects));
        }
        // Categories stand from the bottom up.
        steps.reverse();
        let values: Vec<f64> = steps.iter().map(|(_, value)| value * scale).collect();
        Panel::new(format!("{}, RMS error in {unit}", gap.signal.title()))
            .height(height(steps.len()) + 8)
            .y_categories(steps.iter().map(|(name, _)| *name))
            .lying_bars(Ink::Simulated, "", &values)
            .mark(noise(gap.noise_floor * scale))
    };
    Picture::grid("RMS errors of the twins", 2, diagnosis.gap.iter().filter(|gap| is_judged(gap)).map(panel).collect())
}

/// What noise alone makes, as a line across the bars.
fn noise(at: f64) -> Mark {
    let rule = MarkShape::Segments(vec![[at, f64::NEG_INFINITY, at, f64::INFINITY]]);
    Mark { width_px: 2.0, ..Mark::new(rule, Ink::Alarm, "noise alone") }
}

/// Lying bars of half the width, so that those below them show where they are shorter too.
fn slim(values: &[f64]) -> Mark {
    let blocks = values.iter().enumerate().map(|(i, &value)| [0.0, value, i as f64 - 0.2, i as f64 + 0.2]);
    Mark { opacity: 1.0, ..Mark::new(MarkShape::Blocks(blocks.collect()), Ink::Simulated, "with faults") }
}

/// Shares as lying bars with their percentages beside them.
fn shares(title: &str, ink: Ink, bars: &[(String, f64)]) -> Panel {
    let values: Vec<f64> = bars.iter().rev().map(|(_, share)| 100.0 * share).collect();
    let word = |(i, value): (usize, &f64)| {
        // None is certain, and none is nothing.
        let beside = match value {
            value if *value < 0.5 => "< 1".to_owned(),
            value if *value > 99.5 => "> 99".to_owned(),
            value => format!("{value:.0}"),
        };
        ([*value, i as f64], beside)
    };
    let beside = MarkShape::Words(values.iter().enumerate().map(word).collect());
    Panel::new(title)
        .height(height(10))
        .x_range(0.0, 112.0)
        .y_categories(bars.iter().rev().map(|(name, _)| name.clone()))
        .lying_bars(ink, "", &values)
        .mark(Mark::new(beside, Ink::Muted, ""))
}

/// The cuts through the squared gap of one signal.
pub(crate) fn breakdown(breakdowns: &[&Breakdown], signal: Signal, explained: bool) -> Picture {
    let panel = |breakdown: &&Breakdown| {
        let parts: Vec<_> = breakdown.parts.iter().filter(|part| part.samples > 0).rev().collect();
        let refitted: Vec<f64> = parts.iter().map(|part| 100.0 * part.refitted).collect();
        let mut panel = Panel::new(format!("by {}", breakdown.by))
            .height(height(parts.len()))
            .y_categories(parts.iter().map(|part| part.name.clone()))
            .x_range(0.0, 100.0)
            .lying_bars(Ink::Band, "recalibrated", &refitted);
        if explained {
            let after: Vec<f64> = parts.iter().map(|part| 100.0 * part.with_effects).collect();
            panel = panel.mark(slim(&after));
        }
        panel
    };
    let told = breakdowns.iter().filter(|breakdown| breakdown.parts.iter().filter(|part| part.samples > 0).count() > 1);
    let title = format!("Share of the squared error of the {}", signal.title().to_lowercase());
    Picture::grid(title, 2, told.map(panel).collect())
}

/// Stage probabilities beside the ranking of effects.
pub(crate) fn probabilities(diagnosis: &Diagnosis) -> Picture {
    // Where there is no error there is no place of it.
    let some = matches!(diagnosis.verdict, Verdict::Named | Verdict::Class | Verdict::Unknown);
    let stages: Vec<_> =
        diagnosis.stages.iter().map(|(stage, share)| (stage_title(*stage).to_owned(), *share)).collect();
    let ranked: Vec<_> =
        diagnosis.ranking.iter().take(RANKED).map(|one| (id_words(&one.id), one.probability)).collect();
    let mut panels = vec![shares("probability that the effect is present, %", Ink::Simulated, &ranked)];
    if some {
        panels.insert(0, shares("probability of the stage, %", Ink::Good, &stages));
    }
    Picture::grid("Probability of each stage and of the leading effects", 2, panels)
}

/// The shape of a discrepancy term over its variable.
pub(crate) fn shape(discrepancy_term: &DiscrepancyTerm) -> Picture {
    let points = |points: &[(f64, f64)]| points.iter().map(|&(x, y)| [x, y]).collect::<Vec<_>>();
    let largest =
        discrepancy_term.curves.iter().flat_map(|curve| &curve.points).fold(0.0_f64, |most, (_, y)| most.max(y.abs()));
    // Axes write no exponents; terms in m³/s are far below one.
    let (scale, unit) = match discrepancy_term.unit {
        "pu" => (100.0, "%".to_owned()),
        "m³/s" => (1.0e6, "cm³/s".to_owned()),
        "N" if largest >= 1000.0 => (1.0e-3, "kN".to_owned()),
        unit => (1.0, unit.to_owned()),
    };
    // One vertical range for all, so that what matters more looks larger.
    let all = || {
        discrepancy_term.curves.iter().flat_map(|curve| curve.points.iter().chain(&curve.named)).map(|(_, y)| scale * y)
    };
    let (low, high) = all().fold((0.0_f64, 0.0_f64), |(low, high), y| (low.min(y), high.max(y)));
    let air = 0.06 * (high - low);
    let panels = discrepancy_term.curves.iter().map(|curve| {
        let scaled = |from: &[(f64, f64)]| points(&from.iter().map(|&(x, y)| (x, scale * y)).collect::<Vec<_>>());
        let mut panel = Panel::new(format!("dependence on {}", curve.against))
            .x_name(curve.against)
            .y_range(low - air, high + air)
            .level(Ink::Band, "", 0.0)
            .line(Ink::Simulated, &format!("discrepancy term, {unit}"), scaled(&curve.points));
        if !curve.named.is_empty() {
            panel = panel.dashed_line(Ink::Good, "expected with the faults", scaled(&curve.named));
        }
        panel
    });
    Picture::grid(format!("Shape of a discrepancy term on the {}", discrepancy_term.place), 2, panels.collect())
}
