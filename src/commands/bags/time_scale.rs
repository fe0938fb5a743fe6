//! Whether the time of a recording is that of the plant: the sheet's twin follows one whose time is stretched only where it runs at that scale.
//!
//! No fault slows spool and servomotor alike, by the same factor in whatever they do; a clock in another unit, or an export by a wrong rate, does. A
//! recording of another unit may look so too. A loss of oil flow looks so in one recording, by another factor in each: only where several agree
//! is nothing concluded from them. None makes a unit faster, and no sheet is wrong by so much as some machines are: one recording of those tells enough.
//! So does one that no effect explains half as well: a gain of the spool's transducer slows no trip, and a loss of a line no small movement.

use govtwin_model::effects::find;
use govtwin_model::frame::Frame;
use govtwin_model::metrics::Figures;
use govtwin_model::parameters::Unit;
use govtwin_model::recording::Recording;
use govtwin_model::replay::{Scores, simulate};
use govtwin_model::signal::{Signal, span};
use govtwin_model::twin::Twin;
use govtwin_model::units::{nanos_from_seconds, seconds_from_nanos};

use super::doubt::Doubt;

/// Scales are tried by this factor, from that of the recording on in the direction in which the error falls, up to the last.
const STEP: f64 = 1.2;
const MOST_STEPS: f64 = 18.0;
/// The best of the steps is looked for nearer by this many halvings.
const HALVINGS: i32 = 4;
/// A smaller factor is one of tolerances and faults: flows of valves and ports are known to some per cent, loads and losses take up to a quarter.
const LEAST: f64 = 1.3;
/// From this factor on it is worth a note.
const NOTED: f64 = 1.15;
/// Of the squared error so much may remain, as a mean over the signals, and of each signal's variance, where the twin follows.
pub(super) const DOUBTFUL: f64 = 0.25;
/// Half a step from the right scale less remains than this: time is then wrong by a tenth, where it was by a third.
const HOPELESS: f64 = 2.0 * DOUBTFUL;
/// A unit that is so many times as fast as its sheet is another one: even a name plate has its times to a factor of two.
const FAR_FASTER: f64 = 3.0;
/// Factors of recordings that agree differ by no more than this one.
const ALIKE: f64 = 1.1;
/// The first so much of a recording is enough, s.
const MOST_S: f64 = 300.0;
/// A servomotor that moves less tells nothing, pu.
pub(super) const MOVED_PU: f64 = 0.05;

/// The scale of time at which the sheet's twin follows a recording best.
#[derive(Clone, Copy, Debug)]
pub struct TimeScale {
    /// The recording's time over the plant's.
    factor: f64,
    /// Root mean square error of each position before and at that scale, pu; none where it was not measured.
    errors_pu: [Option<[f64; 2]>; 2],
    /// What remains of the squared error.
    remains: f64,
    /// And with the sheet's own time under the effect that explains most; looked for where time may be another.
    by_effect: f64,
}

/// A scale that was tried, by its power of [`STEP`].
struct Tried {
    steps: f64,
    /// What remains of the squared error at the recording's own scale.
    remains: f64,
    figures: [Option<Figures>; 2],
}

/// Effects that may look like another time: a gain is tried like a scale, a loss up to the greatest of the catalogue.
const EFFECTS: [&str; 3] = ["lvdt_gain", "supply_loss", "return_loss"];
/// Another time is the reason where it leaves so much of the squared error that any effect leaves, at most.
const CLEAR: f64 = 0.5;

/// Where least remains along a line of steps, from 0 on in the direction in which it falls.
fn least(own: [Option<Figures>; 2], tried: &impl Fn(f64) -> Tried) -> Tried {
    let mut best = Tried { steps: 0.0, remains: 1.0, figures: own };
    let [up, down] = [1.0, -1.0].map(tried);
    let mut next = if up.remains < down.remains { up } else { down };
    let direction = next.steps;
    while next.remains <= best.remains && best.steps.abs() < MOST_STEPS {
        best = next;
        next = tried(best.steps + direction);
    }
    let mut near = 0.5;
    for _ in 0..if best.remains < HOPELESS { HALVINGS } else { 0 } {
        for steps in [best.steps - near, best.steps + near] {
            let found = tried(steps);
            if found.remains < best.remains {
                best = found;
                break;
            }
        }
        near *= 0.5;
    }
    best
}

impl TimeScale {
    /// That of the recording that shows it best, of those taken of one bag; none where none can tell.
    pub fn most(recordings: &[Recording], unit: &Unit) -> Option<Self> {
        recordings
            .iter()
            .filter_map(|recording| Self::of(recording, unit))
            .min_by(|a, b| a.remains.total_cmp(&b.remains))
    }

    /// That of a recording; none where it has no command, hardly moves, or is followed at no scale.
    pub fn of(recording: &Recording, unit: &Unit) -> Option<Self> {
        let frames = beginning(recording);
        let moves = |frame: &Frame| Signal::ServomotorPosition.of(&frame.measured);
        let span_pu = span(frames.iter().map(moves))?;
        if !recording.has_command() || span_pu < MOVED_PU {
            return None;
        }
        let twin = Twin::new(unit);
        let own = figures(&twin, frames, 1.0);
        let at = |found: [Option<Figures>; 2], steps: f64| {
            let both = own.iter().zip(&found);
            let ratios = both.filter_map(|(own, found)| Some((found.as_ref()?.rmse / own.as_ref()?.rmse).powi(2)));
            let (sum, count) = ratios.fold((0.0, 0.0), |(sum, count), ratio| (sum + ratio, count + 1.0));
            let remains = if sum.is_finite() && count > 0.0 { sum / count } else { f64::INFINITY };
            Tried { steps, remains, figures: found }
        };
        let best = least(own, &|steps| at(figures(&twin, frames, STEP.powf(steps)), steps));
        let Tried { steps, remains, figures: found } = best;
        let factor = STEP.powf(steps);
        let follows = found.iter().flatten().all(|figures| figures.r2 >= 1.0 - DOUBTFUL);
        let pair = |k: usize| Some([own[k].as_ref()?.rmse, found[k].as_ref()?.rmse]);
        let scale = follows.then(|| Self { factor, errors_pu: [pair(0), pair(1)], remains, by_effect: 0.0 })?;
        if !scale.may_be_other() {
            return Some(scale);
        }
        let by_effect = EFFECTS.map(|id| {
            let with = |steps: f64| {
                let parameter = find(id)?.parameters.first()?.on(&unit.parameters);
                let is_gain = parameter.neutral > 0.0;
                let value = if is_gain { STEP.powf(steps) } else { parameter.max * steps / MOST_STEPS };
                unit.clone().with_effect(id, &[(parameter.name, value)]).ok()
            };
            let tried = |steps: f64| {
                let found = with(steps).map(|unit| figures(&Twin::new(&unit), frames, 1.0));
                at(found.unwrap_or_default(), steps)
            };
            least(own, &tried).remains
        });
        Some(Self { by_effect: by_effect.into_iter().fold(f64::INFINITY, f64::min), ..scale })
    }

    /// Whether the twin follows the recording at another scale, and not at the recording's own.
    pub fn is_other(&self) -> bool {
        self.factor.max(1.0 / self.factor) > LEAST && self.remains < DOUBTFUL
    }

    /// Whether nothing else explains the recording: spool and servomotor are slow also where no effect makes them so, as at their stops.
    pub fn is_clear(&self) -> bool {
        self.may_be_other() && self.remains < CLEAR * self.by_effect
    }

    /// Whether it is that of another recording, give or take what is left open.
    pub fn is_alike(&self, other: &Self) -> bool {
        let ratio = self.factor / other.factor;
        self.may_be_other() && ratio.max(1.0 / ratio) <= ALIKE
    }

    /// Whether it follows at a scale so near that of the recording that tolerances and a loss of oil flow may be all there is.
    fn is_near(&self) -> bool {
        self.may_be_other() && !self.is_other()
    }

    /// Whether it follows at a scale that is worth a note.
    fn may_be_other(&self) -> bool {
        self.factor.max(1.0 / self.factor) > NOTED && self.remains < DOUBTFUL
    }

    /// What is to be said of one recording alone.
    pub fn doubt(&self) -> Option<Doubt> {
        if self.is_clear() {
            return Some(Doubt::warned(self.words(false)));
        }
        if self.is_near() {
            return Some(Doubt::note(self.words(true)));
        }
        self.is_other().then(|| Doubt::warned(self.words(true)))
    }

    /// Whether nothing but another time, or another unit, explains recordings: all that can tell have the same other scale, and are several, or much
    /// faster than the plant.
    pub fn agree<'a>(all: impl Iterator<Item = &'a Self>) -> bool {
        let (mut count, mut least, mut most) = (0, f64::INFINITY, 0.0_f64);
        for scale in all {
            if !scale.is_other() {
                return false;
            }
            (count, least, most) = (count + 1, least.min(scale.factor), most.max(scale.factor));
        }
        (count > 1 || (count == 1 && most * FAR_FASTER < 1.0)) && most <= ALIKE * least
    }

    /// In words, with the way out; `alone` where no other recording says the same.
    pub fn words(&self, alone: bool) -> String {
        let fall = |(signal, errors): (&Signal, &Option<[f64; 2]>)| {
            let [own, found] = errors.as_ref()?.map(|pu| pu * 100.0);
            Some(format!("of {} from {own:.2} % to {found:.2} %", signal.id()))
        };
        let falls: Vec<String> = Signal::POSITIONS.iter().zip(&self.errors_pu).filter_map(fall).collect();
        let factor = self.factor;
        let (what, rest) = if factor > 1.0 { ("stretched", factor) } else { ("compressed", 1.0 / factor) };
        let also = match (alone, factor > 1.0) {
            (true, true) => ", or a loss of oil flow slows both",
            (true, false) => ", or the spool's transducer reads too little (`lvdt_gain`)",
            (false, _) => "",
        };
        format!(
            "with its time divided by {factor:.2} the sheet's twin follows it, the error falls {}: the recording is not of this unit, or its time is {what} by {rest:.2}{also}; \
             check the unit and the rate of its time (`time:` of an import map), or name the sheet of its unit with --params (`diagnose` can do without: \
             --no-sheet, --stage-alone)",
            falls.join(" and ")
        )
    }
}

/// So much of a recording as is looked at.
pub(super) fn beginning(recording: &Recording) -> &[Frame] {
    let first_ns = recording.frames.first().map_or(0, |frame| frame.time_ns);
    let until_ns = first_ns.saturating_add(nanos_from_seconds(MOST_S));
    &recording.frames[..recording.frames.partition_point(|frame| frame.time_ns < until_ns)]
}

/// Figures of the positions where the recording's time is divided by a factor; none of one that was not measured.
fn figures(twin: &Twin, frames: &[Frame], factor: f64) -> [Option<Figures>; 2] {
    let begin_ns = frames.first().map_or(0, |frame| frame.time_ns);
    let scaled = |frame: &Frame| {
        let after_s = seconds_from_nanos(frame.time_ns.saturating_sub(begin_ns)) / factor;
        Frame { time_ns: begin_ns.saturating_add(nanos_from_seconds(after_s)), ..*frame }
    };
    let recording = Recording::new("", frames.iter().map(scaled).collect());
    let estimates = simulate(&mut twin.clone(), &recording);
    let scores = Scores::of(&recording, &estimates);
    let of = |signal| Some(scores.figures(signal)).filter(|figures| figures.rmse.is_finite() && figures.rmse > 0.0);
    Signal::POSITIONS.map(of)
}

#[cfg(test)]
mod tests {
    use super::TimeScale;

    /// A loss of oil flow slows each recording by another factor, and one that does not ask for flow by none.
    #[test]
    fn recordings_agree_where_all_have_the_same_other_scale() {
        let agree = |told: &[(f64, f64)]| {
            let scales: Vec<TimeScale> = told
                .iter()
                .map(|&(factor, remains)| TimeScale { factor, errors_pu: [None; 2], remains, by_effect: 0.0 })
                .collect();
            TimeScale::agree(scales.iter())
        };
        assert!(agree(&[(2.0, 0.01), (1.95, 0.2)]) && agree(&[(0.5, 0.01); 3]));
        assert!(!agree(&[(2.07, 0.01), (1.41, 0.1)]), "as a supply loss has it");
        assert!(!agree(&[(2.0, 0.01), (1.0, 1.0)]) && !agree(&[(2.0, 0.01), (2.0, 0.5)]));
        assert!(!agree(&[(2.0, 0.01)]) && !agree(&[]));
        assert!(
            agree(&[(0.2, 0.01)]) && !agree(&[(0.2, 0.4)]),
            "no fault makes a unit faster, and no sheet is so wrong"
        );
        assert!(!agree(&[(0.6, 0.01)]), "as of a sheet from a name plate");
    }
}
