//! What was fitted of a servomotor stage, told in the numbers of its recordings: zero and dead band of the spool, speed each way, lag.
//!
//! Zero and dead band are read off the fitted ports, speeds and lag off a step of the spool that the fitted twin answers. Intervals come from the
//! covariance of the fit or, where that is wider, of the pieces, by the slopes of each figure (the delta method: Casella & Berger 2002, *Statistical
//! Inference*, section 5.5.4), and from what the twin and the plain law differ by.

use nalgebra::{DMatrix, DVector};

use crate::acceptance::statistics::student_90;
use crate::estimation::coordinate::{Coordinate, subject_at};
use crate::estimation::linear::normal;
use crate::likelihood::prepared::PreparedRecording;
use crate::likelihood::problem::twin_of;
use crate::model::FittedModel;
use crate::result::{Interval, StageFigure};
use crate::stage_alone::plain::Plain;
use crate::stage_alone::plain_models::PlainModel;
use crate::stage_alone::plain_numbers::PlainNumbers;
use crate::stage_alone::spread::{PieceSlopes, spread, with_common};
use govtwin_model::effects;
use govtwin_model::frame::{EsvState, Frame, Inputs, Signals};
use govtwin_model::parameters::Unit;
use govtwin_model::plant::Plant;
use govtwin_model::signal::Signal;
use govtwin_model::twin::Cut;
use govtwin_model::units::{NORMAL_90, nanos_from_seconds};

/// How far free parameters are turned for slopes, in standard deviations of the fit, at most in units of the free parameter.
const TURN: (f64, f64) = (0.5, 0.5);
/// Travel of the servomotor that a step is followed over, pu, and rows for it at the speed of the plain law.
const FOLLOWED: (f64, f64) = (0.3, 200.0);
/// Rows at most, in times as many.
const LONGEST: u32 = 800;

const SPOOL: &str = "of the spool as recorded";
const SPEED: &str = "of the servomotor as recorded, per second";

/// Id, title and unit of each figure, in the order of [`figures`].
const FIGURES: [(&str, &str, &str); 7] = [
    ("spool_zero", "spool zero", SPOOL),
    ("dead_band", "dead band, full width", SPOOL),
    ("falls_from", "dead-band end where falling begins", SPOOL),
    ("rises_from", "dead-band end where rising begins", SPOOL),
    ("rising_speed", "rising speed at the farthest spool position", SPEED),
    ("falling_speed", "falling speed at the farthest spool position", SPEED),
    ("lag_s", "lag behind the spool", "s"),
];

/// Place of the lag among them.
const LAG: usize = 6;

/// The plain law beside a twin, in the numbers of the recordings.
pub(crate) struct PlainLaw<'a> {
    /// The law.
    pub law: Plain,
    /// Its numbers.
    pub numbers: &'a PlainNumbers,
    /// Whether it predicts better than the twin, or worse; none where neither does clearly.
    pub is_better: Option<bool>,
}

/// The figures of a model; `recordings` tell how far the spool went.
pub fn stage_figures(model: &FittedModel, law: &Plain, recordings: &[PreparedRecording]) -> Vec<StageFigure> {
    told(fitted(model, law, recordings, None))
}

/// The same where no data sheet is known, beside the plain law in the numbers of the recordings.
///
/// The spool may be held for `held_s` of what is a lag behind it by the plain law; the twin has that in its rows.
///
/// Where one of the two predicts clearly better, its figures are given, else the mean of both: what their laws differ by is part of the interval, as of
/// two laws that are equally likely (Hoeting et al. 1999, *Bayesian Model Averaging: A Tutorial*).
pub(crate) fn sheetless_figures(
    model: &FittedModel,
    law: &Plain,
    recordings: &[PreparedRecording],
    plain: Option<PlainLaw<'_>>,
    held_s: f64,
) -> Vec<StageFigure> {
    let mut all = fitted(model, law, recordings, between_pieces(model).as_ref());
    // Whether it is held, or as much later, nobody can tell.
    all[LAG][1] += held_s;
    let Some(plain) = plain.filter(|plain| plain.is_better != Some(false)) else { return told(all) };
    let ends = farthest(recordings).map(|pu| model.unit().recorded.spool_position.recorded(pu));
    let mut values = figures_of(&plain.law, ends);
    values[LAG] = (values[LAG] - held_s).max(0.0);
    let of = |model: &PlainModel| match model {
        PlainModel::Sum(_, law) => figures_of(law, ends).to_vec(),
        PlainModel::SetPoint(..) => vec![f64::NAN; FIGURES.len()],
    };
    let mut halves = plain.numbers.half_widths(of);
    halves[LAG] += held_s;
    for ((one, value), half) in all.iter_mut().zip(values).zip(halves) {
        let other = [value, half];
        *one = if plain.is_better == Some(true) { other } else { mixed(*one, other) };
    }
    told(all)
}

/// The farthest positions of the spool, opening and closing, pu.
fn farthest(recordings: &[PreparedRecording]) -> [f64; 2] {
    let spools =
        recordings.iter().flat_map(|recording| recording.measured(Signal::SpoolPosition)).filter(|pu| pu.is_finite());
    let (closing_pu, opening_pu) = spools.fold((0.0_f64, 0.0_f64), |(low, high), pu| (low.min(pu), high.max(pu)));
    [opening_pu, closing_pu]
}

/// Value and half-width of each figure, in words.
fn told(all: Vec<[f64; 2]>) -> Vec<StageFigure> {
    let each = FIGURES.iter().zip(all).filter(|(_, [value, _])| value.is_finite());
    each.map(|(&(id, title, unit), [value, half])| StageFigure {
        id,
        title,
        unit,
        value: Interval { value, low: value - half, high: value + half },
    })
    .collect()
}

/// Value and half-width of each figure by a fit, and by how it differs `between` pieces where that is wider.
fn fitted(
    model: &FittedModel,
    law: &Plain,
    recordings: &[PreparedRecording],
    between: Option<&(DMatrix<f64>, f64)>,
) -> Vec<[f64; 2]> {
    let ends = farthest(recordings);
    let of = |unit: &Unit| figures(unit, law, ends);
    let best = of(&model.unit());
    let mut slopes = vec![DVector::zeros(model.free_parameters.len()); best.len()];
    for (k, free_parameter) in model.free_parameters.iter().enumerate() {
        let (low, high) = free_parameter.range(&model.base);
        let by = (TURN.0 * model.spread[(k, k)].max(0.0).sqrt()).clamp(1e-3, TURN.1);
        let places = [-by, by].map(|by| (model.fit.positions[k] + by).clamp(low, high));
        let ends = places.map(|place| {
            let mut positions = model.fit.positions.clone();
            positions[k] = place;
            of(&subject_at(&model.base, &model.free_parameters, &positions))
        });
        for (figure, slopes) in slopes.iter_mut().enumerate() {
            let slope = (ends[1][figure] - ends[0][figure]) / (places[1] - places[0]);
            slopes[k] = if slope.is_finite() { slope } else { 0.0 };
        }
    }
    let half = |slopes: &DVector<f64>| {
        let sd = |spread: &DMatrix<f64>| slopes.dot(&(spread * slopes)).max(0.0).sqrt();
        let by_fit = NORMAL_90 * sd(&model.spread);
        between.map_or(by_fit, |(spread, wide)| by_fit.max(wide * sd(spread)))
    };
    best.into_iter().zip(&slopes).map(|(value, slopes)| [value, half(slopes)]).collect()
}

/// Value and half-width of an interval of two that are equally likely.
fn mixed(one: [f64; 2], other: [f64; 2]) -> [f64; 2] {
    if !other[0].is_finite() {
        return one;
    }
    let apart = NORMAL_90 * 0.5 * (one[0] - other[0]);
    let square = 0.5 * (one[1] * one[1] + other[1] * other[1]) + apart * apart;
    [0.5 * (one[0] + other[0]), square.sqrt()]
}

/// Covariance of a model's free parameters from piece to piece, and how many deviations hold nine in ten; none without slopes.
fn between_pieces(model: &FittedModel) -> Option<(DMatrix<f64>, f64)> {
    let fit = &model.fit;
    let (hessian, _) = normal(&model.free_parameters, &fit.positions, &fit.residuals, &fit.slopes, 1.0);
    let pieces: Vec<PieceSlopes> = fit
        .slopes
        .iter()
        .zip(&fit.residuals)
        .map(|(slopes, residuals)| PieceSlopes { slopes: slopes.clone(), residuals: residuals.clone() })
        .collect();
    Some((with_common(spread(&hessian, &pieces)?, pieces.len()), student_90(pieces.len() as f64 - 1.0)))
}

/// The figures of a plain law at the farthest positions of the spool, all as recorded.
fn figures_of(law: &Plain, ends: [f64; 2]) -> [f64; FIGURES.len()] {
    let edge = |end: f64| if end > law.zero { law.zero + law.half_band } else { law.zero - law.half_band };
    let [one, other] = ends.map(|end| (law.speed(end), edge(end)));
    let (rising, falling) = if one.0 >= other.0 { (one, other) } else { (other, one) };
    [law.zero, 2.0 * law.half_band, falling.1, rising.1, rising.0, falling.0, law.lag.time_s()]
}

/// The figures of a unit, as recorded; what does not exist is not a number.
fn figures(unit: &Unit, law: &Plain, [opening_pu, closing_pu]: [f64; 2]) -> [f64; FIGURES.len()] {
    let mut plant = Plant::new(&unit.parameters);
    effects::apply(unit, &mut plant);
    let (spool, ports) = (&plant.spool, &plant.main_ports);
    let reading = |position_m: f64| {
        let reading_pu = position_m / spool.reference_stroke_m * spool.reading_gain + spool.reading_bias_pu;
        unit.recorded.spool_position.recorded(reading_pu)
    };
    let (opens, closes) = (reading(ports.opening_overlap_m), reading(-ports.closing_overlap_m));
    let (opening, closing) = (step(unit, law, opening_pu), step(unit, law, closing_pu));
    let speed =
        |one: Option<[f64; 2]>| one.map_or(f64::NAN, |[pu_s, _]| pu_s / unit.recorded.servomotor_position.scale_pu);
    let lags: Vec<f64> = [opening, closing].into_iter().flatten().map(|[_, lag_s]| lag_s).collect();
    let lag_s = lags.iter().sum::<f64>() / lags.len() as f64;
    let (mut ways, mut speeds) = ([closes, opens], [speed(opening), speed(closing)]);
    if unit.recorded.servomotor_position.scale_pu < 0.0 {
        // What opens falls as recorded.
        ways.reverse();
        speeds.reverse();
    }
    [0.5 * (opens + closes), (opens - closes).abs(), ways[0], ways[1], speeds[0], speeds[1], lag_s]
}

/// Speed in pu/s and lag in s that the twin of a unit answers a step of the spool with, from half opening; none where it stands still.
fn step(unit: &Unit, law: &Plain, spool_pu: f64) -> Option<[f64; 2]> {
    let expected_pu_s = law.above_1_s.abs().max(law.below_1_s.abs()) * spool_pu.abs().min(law.saturates);
    if expected_pu_s <= 0.0 {
        return None;
    }
    let period_s = FOLLOWED.0 / expected_pu_s / FOLLOWED.1;
    let mut twin = twin_of(unit).with_cut(Cut::Spool);
    let mut moved: Vec<(f64, f64)> = Vec::new();
    for k in 0..LONGEST {
        let time_s = f64::from(k) * period_s;
        let measured = Signals {
            spool_position_pu: if k == 0 { law.zero } else { spool_pu },
            servomotor_position_pu: 0.5,
            ..Signals::NONE
        };
        let inputs = Inputs {
            opening_command_pu: f64::NAN,
            esv: EsvState::Normal,
            tank_pressure_pa: f64::NAN,
            piston_force_n: 0.0,
        };
        let estimate = twin.step(&Frame { time_ns: nanos_from_seconds(time_s), inputs, measured });
        // The spool runs straight from the first row to the second.
        moved.push((time_s - 0.5 * period_s, estimate.signals.servomotor_position_pu - 0.5));
        if moved.last().is_some_and(|(_, by)| by.abs() > FOLLOWED.0) {
            break;
        }
    }
    let (end_s, end) = moved.last().copied()?;
    let (half_s, half) = moved.iter().copied().find(|(_, by)| by.abs() >= 0.5 * end.abs())?;
    let speed_pu_s = (end - half) / (end_s - half_s);
    (speed_pu_s.is_finite() && speed_pu_s != 0.0).then(|| [speed_pu_s, (end_s - end / speed_pu_s).max(0.0)])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stage_alone::run::Lag;

    #[test]
    fn a_plain_law_has_its_figures_whichever_way_it_runs() {
        let law = |gain: f64| Plain {
            lag: Lag::dead(0.2),
            zero: 5.0,
            half_band: 1.0,
            saturates: f64::INFINITY,
            above_1_s: gain,
            below_1_s: 2.0 * gain,
        };
        let wanted = [5.0, 2.0, 4.0, 6.0, 0.3, -0.6, 0.2];
        let found = figures_of(&law(0.1), [9.0, 1.0]);
        assert!(found.iter().zip(wanted).all(|(found, wanted)| (found - wanted).abs() < 1e-12), "{found:?}");
        // What opens falls as recorded: it rises below the zero.
        let [_, _, falls_from, rises_from, rising, falling, _] = figures_of(&law(-0.1), [1.0, 9.0]);
        assert_eq!([falls_from, rises_from], [6.0, 4.0]);
        assert!((rising - 0.6).abs() < 1e-12 && (falling + 0.3).abs() < 1e-12, "{rising} {falling}");
    }

    #[test]
    fn two_laws_that_differ_widen_the_interval_by_that() {
        assert_eq!(mixed([2.0, 0.1], [2.0, 0.1]), [2.0, 0.1]);
        let [value, half] = mixed([2.0, 0.1], [2.4, 0.1]);
        assert!(
            (value - 2.2).abs() < 1e-12 && half > NORMAL_90 * 0.2 && half < NORMAL_90 * 0.2 + 0.1,
            "{value} {half}"
        );
        assert_eq!(mixed([2.0, 0.1], [f64::NAN, 0.1]), [2.0, 0.1]);
    }
}
