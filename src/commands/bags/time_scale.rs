//! Whether the time of a recording is that of the plant: the sheet's twin follows one whose time is stretched only where it runs at that scale.
//!
//! No fault slows spool and servomotor alike, by the same factor in whatever they do; a clock in another unit, or an export by a wrong rate, does. A
//! recording of another unit may look so too, and a loss of oil flow nearly so: what is said names them.

use govtwin_model::frame::Frame;
use govtwin_model::parameters::Unit;
use govtwin_model::recording::Recording;
use govtwin_model::replay::{Scores, simulate};
use govtwin_model::signal::{Signal, span};
use govtwin_model::twin::Twin;

/// Scales are tried by this factor, from that of the recording on in the direction in which the error falls, up to the last.
const STEP: f64 = 1.2;
const MOST_STEPS: i32 = 18;
/// The best of the steps is looked for nearer by this many halvings.
const HALVINGS: i32 = 4;
/// A smaller factor is one of tolerances and faults: flows of valves and ports are known to some per cent, loads and losses take up to a quarter.
const LEAST: f64 = 1.3;
/// Of the squared error so much may remain, as a mean over the signals, for a doubt, and for certainty.
const DOUBTFUL: f64 = 0.25;
const CERTAIN: f64 = 0.1;
/// The first so many rows are enough, five minutes of the twin's ticks.
const MOST_ROWS: usize = 300_000;
/// A servomotor that moves less tells nothing, pu.
const MOVED_PU: f64 = 0.05;

/// A scale of time at which the sheet's twin follows a recording, while it does not at the recording's own.
#[derive(Clone, Copy, Debug)]
pub struct TimeScale {
    /// The recording's time over the plant's.
    factor: f64,
    /// Root mean square error of each position before and at that scale, pu; none where it was not measured.
    errors_pu: [Option<[f64; 2]>; 2],
    /// What remains of the squared error.
    remains: f64,
}

impl TimeScale {
    /// The scale of the recording that shows it best, of those taken of one bag.
    pub fn most(recordings: &[Recording], unit: &Unit) -> Option<Self> {
        recordings
            .iter()
            .filter_map(|recording| Self::of(recording, unit))
            .min_by(|a, b| a.remains.total_cmp(&b.remains))
    }

    /// The scale of a recording's time, where it is not that of the sheet's twin.
    pub fn of(recording: &Recording, unit: &Unit) -> Option<Self> {
        let frames = &recording.frames[..recording.frames.len().min(MOST_ROWS)];
        let moves = |frame: &Frame| Signal::ServomotorPosition.of(&frame.measured);
        let span_pu = span(frames.iter().map(moves))?;
        if !recording.has_command() || span_pu < MOVED_PU {
            return None;
        }
        let twin = Twin::new(unit);
        let errors = |steps: f64| errors_pu(&twin, frames, STEP.powf(steps));
        let own = errors(0.0);
        let remains = |found: &[Option<f64>; 2]| {
            let ratios =
                own.iter().zip(found).filter_map(|(own, found)| Some((found.as_ref()? / own.as_ref()?).powi(2)));
            let (sum, count) = ratios.fold((0.0, 0.0), |(sum, count), ratio| (sum + ratio, count + 1.0));
            if sum.is_finite() && count > 0.0 { sum / count } else { f64::INFINITY }
        };
        let at = |steps: f64| remains(&errors(steps));
        let direction = if at(1.0) < at(-1.0) { 1.0 } else { -1.0 };
        let (mut best, mut least) = (0.0, 1.0);
        for step in 1..=MOST_STEPS {
            let steps = direction * f64::from(step);
            let found = at(steps);
            if found > least {
                break;
            }
            (best, least) = (steps, found);
        }
        if best == 0.0 {
            return None;
        }
        let mut near = 0.5;
        for _ in 0..HALVINGS {
            for steps in [best - near, best + near] {
                let found = at(steps);
                if found < least {
                    (best, least) = (steps, found);
                    break;
                }
            }
            near *= 0.5;
        }
        let factor = STEP.powf(best);
        let found = errors(best);
        let pair = |k: usize| own[k].zip(found[k]).map(|(own, found)| [own, found]);
        (factor.max(1.0 / factor) > LEAST && least < DOUBTFUL).then(|| Self {
            factor,
            errors_pu: [pair(0), pair(1)],
            remains: least,
        })
    }

    /// Whether nothing but another time, or another unit, explains it.
    pub fn is_certain(&self) -> bool {
        self.remains < CERTAIN
    }

    /// In words, with the way out.
    pub fn words(&self) -> String {
        let fall = |(signal, errors): (&Signal, &Option<[f64; 2]>)| {
            let [own, found] = errors.as_ref()?.map(|pu| pu * 100.0);
            Some(format!("of {} from {own:.2} % to {found:.2} %", signal.id()))
        };
        let falls: Vec<String> = Signal::POSITIONS.iter().zip(&self.errors_pu).filter_map(fall).collect();
        let factor = self.factor;
        let (what, rest) = if factor > 1.0 { ("stretched", factor) } else { ("compressed", 1.0 / factor) };
        let also = if self.is_certain() { "" } else { ", or a loss of oil flow slows both" };
        format!(
            "with its time divided by {factor:.2} the sheet's twin follows it, the error falls {}: the recording is not of this unit, or its time is {what} by {rest:.2}{also}; \
             check the unit and the rate of its time (`time:` of an import map), or name the sheet of its unit with --params",
            falls.join(" and ")
        )
    }
}

/// Root mean square errors of the positions where the recording's time is divided by a factor.
fn errors_pu(twin: &Twin, frames: &[Frame], factor: f64) -> [Option<f64>; 2] {
    let begin_ns = frames.first().map_or(0, |frame| frame.time_ns);
    let scaled = |frame: &Frame| {
        let after_ns = (frame.time_ns.saturating_sub(begin_ns)) as f64 / factor;
        Frame { time_ns: begin_ns.saturating_add(after_ns as i64), ..*frame }
    };
    let recording = Recording::new("", frames.iter().map(scaled).collect());
    let estimates = simulate(&mut twin.clone(), &recording);
    let scores = Scores::of(&recording, &estimates);
    let rmse_pu = |signal| Some(scores.figures(signal).rmse).filter(|rmse| rmse.is_finite() && *rmse > 0.0);
    Signal::POSITIONS.map(rmse_pu)
}
