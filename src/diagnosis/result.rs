//! What a diagnosis says: the verdict and the evidence for it.

mod interval;
mod judged_by;
pub mod schema;
mod sheet_limits;
pub mod test_script;

use serde_json::{Value, json};

use crate::diagnosis::hypotheses::table::EvidenceTable;
use crate::diagnosis::model::consistency::Consistency;
use crate::diagnosis::model::discrepancy::Curve;
use crate::diagnosis::result::test_script::TestScript;
use crate::effects::Stage;
use crate::parameters::Unit;
use crate::recording::Process;
use crate::signal::Signal;

pub use crate::diagnosis::result::interval::Interval;
pub use crate::diagnosis::result::judged_by::JudgedBy;
pub use crate::diagnosis::result::sheet_limits::{SheetLimits, SheetValue};

/// The six things that a diagnosis may say.
///
/// ```
/// use govtwin::Verdict;
///
/// assert_eq!(Verdict::ALL.map(Verdict::id)[..3], ["named", "class", "unknown"]);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Verdict {
    /// The effects are named, all present at once.
    Named,
    /// One of a few effects that these recordings cannot tell apart.
    Class,
    /// A gap that nothing in the catalogue explains.
    Unknown,
    /// Nothing beyond noise and tolerances.
    NoGap,
    /// The recordings do not move the unit enough to tell.
    NotExcited,
    /// The recordings are of no servomotor stage behind this spool.
    NoSuchUnit,
}

impl Verdict {
    /// All of them.
    pub const ALL: [Self; 6] =
        [Self::Named, Self::Class, Self::Unknown, Self::NoGap, Self::NotExcited, Self::NoSuchUnit];

    /// The word in reports.
    #[must_use]
    pub fn id(self) -> &'static str {
        match self {
            Self::Named => "named",
            Self::Class => "class",
            Self::Unknown => "unknown",
            Self::NoGap => "no_gap",
            Self::NotExcited => "not_excited",
            Self::NoSuchUnit => "no_such_unit",
        }
    }

    /// The words of all verdicts as a sentence lists them: `named, class, … or no_such_unit`.
    #[must_use]
    pub fn all_words() -> String {
        let [others @ .., last] = Self::ALL.map(Self::id);
        format!("{} or {last}", others.join(", "))
    }
}

/// A parameter as fitted.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Fitted {
    /// Name with its unit suffix; for the sheet's parameters the key of parameter files.
    pub name: String,
    /// Unit.
    pub unit: &'static str,
    /// Fitted value, in the unit.
    pub value: Interval,
    /// Value of the sheet, or the neutral value of an effect.
    pub sheet: f64,
    /// Distance from the sheet in standard deviations of its tolerance, or from neutral in typical sizes.
    pub position: f64,
    /// Share of what is known of it that these recordings said: 0 where the tolerance alone speaks, 1 where the recordings do.
    pub information: f64,
    /// True where it stands on a bound.
    pub at_bound: bool,
}

/// An effect that the verdict blames, or a rival in a class.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Blame {
    /// Its id.
    pub id: String,
    /// Where it sits.
    pub stage: Stage,
    /// Probability that it is present.
    pub probability: f64,
    /// Its fitted parameters.
    pub parameters: Vec<Fitted>,
    /// Share of the gap that it closes on its own, on data left out of the fit.
    pub explained_fraction: Interval,
    /// What it closes on top of the other of two effects; none where it is not one of two.
    pub last_in: Option<f64>,
    /// Its Shapley share of what both explain together: the mean over the orders in which they may come (Shapley 1953).
    pub shapley: Option<f64>,
}

/// One row of the ranking.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Ranked {
    /// An effect's id, `unknown` or `none`.
    pub id: String,
    /// Probability.
    pub probability: f64,
}

/// The gap in one signal.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct SignalGap {
    /// Which signal.
    pub signal: Signal,
    /// What a right twin would still leave, RMS in the signal's unit.
    pub noise_floor: f64,
    /// RMS error with the sheet's values.
    pub delivered: f64,
    /// RMS error after refitting within tolerances.
    pub refitted: f64,
    /// RMS error with the blamed effects.
    pub with_effects: f64,
}

/// A test that is expected to take something off the posterior's entropy.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Experiment {
    /// The two hypotheses that it tells apart most: ids of effects joined by `+`, `none`, or `unknown:STAGE`.
    pub separates: Vec<String>,
    /// What to do, in words.
    pub test: String,
    /// Expected distance between their answers beyond what parameters may hide, in standard deviations.
    pub separation: f64,
    /// Bits that it takes off the entropy at least.
    pub expected_drop_bits: f64,
    /// The same at most.
    pub at_most_bits: f64,
    /// Entropy of the posterior now, bits.
    pub entropy_bits: f64,
    /// Bits that it takes off for each minute.
    pub bits_per_minute: f64,
    /// Length, s.
    pub length_s: f64,
    /// Trips of the emergency shutdown valve.
    pub trips: u32,
    /// The state of the unit and what to bring it to first.
    pub unit_state: String,
    /// Signals to record.
    pub records: Vec<Signal>,
    /// Samples a second.
    pub rate_hz: f64,
    /// Command and ESV over time, where the test can be sent to a governor.
    pub script: Option<TestScript>,
}

/// One channel of one recording, as found.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct ChannelReport {
    /// Recording.
    pub recording: String,
    /// Signal.
    pub signal: Signal,
    /// Samples with a value.
    pub samples: usize,
    /// Typical rate, Hz.
    pub rate_hz: f64,
    /// Smallest step between different values, signal unit.
    pub step: f64,
    /// Noise from sample to sample where the unit stands still, signal unit; NaN where it never does.
    pub noise: f64,
    /// What is wrong with it, in words; empty where nothing is.
    pub troubles: Vec<String>,
}

/// How well an effect could be seen at all.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct DetectableSize {
    /// Effect.
    pub id: &'static str,
    /// Name of the parameter that sizes it.
    pub parameter: &'static str,
    /// Its unit.
    pub unit: &'static str,
    /// Smallest deviation from neutral that would stand out, in the parameter's unit; infinite where none would.
    pub smallest: f64,
    /// The same if every value of the sheet were known.
    pub with_known_sheet: f64,
    /// A moderate fault, as deviation from neutral.
    pub typical: f64,
}

/// One part of a cut through the squared gap.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct BreakdownPart {
    /// What the part holds, in words.
    pub name: String,
    /// Samples in it.
    pub samples: usize,
    /// Share of the squared gap of the refitted twin; all parts of a cut sum to 1.
    pub refitted: f64,
    /// The same for the twin with the effects, as a share of the refitted gap.
    pub with_effects: f64,
}

/// One way of cutting the squared gap of one signal into parts.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Breakdown {
    /// Which signal.
    pub signal: Signal,
    /// By what: process, phase, direction, spool band, end zones, ESV.
    pub by: &'static str,
    /// The parts; together they are the whole.
    pub parts: Vec<BreakdownPart>,
}

/// A stage driven by the recorded signals at its input.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct StageTest {
    /// What is driven, in words.
    pub stage: &'static str,
    /// Signal that it is judged by.
    pub signal: Signal,
    /// Zero error taken off the fed spool first, pu.
    pub zero_error_pu: f64,
    /// RMS error, signal unit.
    pub rmse: f64,
    /// Residuals made white: mean square, 1 where only noise is left.
    pub excess: f64,
}

/// A free term placed in one equation: how much it would explain, and what it looks like.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct DiscrepancyTerm {
    /// Where it stands, in words.
    pub place: &'static str,
    /// Stage.
    pub stage: Stage,
    /// Unit of the term.
    pub unit: &'static str,
    /// Share of the gap beyond noise that it would explain.
    pub explains: f64,
    /// Its shape against what it depends on.
    pub curves: Vec<Curve>,
}

/// An effect tried alone on top of the refitted twin.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Tried {
    /// Ids, one or more.
    pub ids: Vec<String>,
    /// By how much the cost fell, prior included.
    pub gain: f64,
    /// The same on data left out of the fit.
    pub held_out_gain: f64,
    /// Fitted parameters.
    pub parameters: Vec<Fitted>,
}

/// How far the gap of a recording closes when the fit has not seen it.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Transfer {
    /// Recording.
    pub recording: String,
    /// Explained fraction on it.
    pub explained_fraction: Interval,
}

/// One recording as it was and as the twins have it, at the rows where something was measured.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Trace {
    /// Recording.
    pub name: String,
    /// Process.
    pub process: Process,
    /// Time since the first row, s.
    pub time_s: Vec<f64>,
    /// Signals: measured, delivered, refitted, with effects.
    pub signals: Vec<(Signal, [Vec<f64>; 4])>,
}

/// How well a model predicts free runs of a fixed length, each from its own measured start.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct FreeRun {
    /// The model, in words.
    pub model: String,
    /// The half of the recordings that it was fitted to.
    pub fitted_on: &'static str,
    /// RMS error of the servomotor in the half that it was fitted to, pu.
    pub seen: f64,
    /// The same in the other half.
    pub held_out: f64,
}

/// One figure of a fitted stage, in the numbers of its recordings.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct StageFigure {
    /// Its id in reports.
    pub id: &'static str,
    /// What it is.
    pub title: &'static str,
    /// Its unit, as recorded.
    pub unit: &'static str,
    /// Value and interval.
    pub value: Interval,
}

impl StageFigure {
    /// As reports hold it.
    #[must_use]
    pub fn json(&self) -> Value {
        let Interval { value, low, high } = self.value;
        json!({"id": self.id, "words": self.title, "value": value, "ci90": [low, high], "unit": self.unit})
    }
}

/// What to know of a diagnosis of a part of the chain.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct StageOnly {
    /// Whether a data sheet was given; without one everything is fitted freely.
    pub sheet: bool,
    /// Number of pieces that the recordings were cut into.
    pub pieces: usize,
    /// Length of a piece, s.
    pub piece_s: f64,
    /// What was fitted, in the numbers of the recordings.
    pub figures: Vec<StageFigure>,
    /// RMS that the transducers alone make a right model residual over a piece, pu of stroke.
    pub transducers_pu: f64,
    /// Why the recordings are of no such stage; none where they are.
    pub foreign: Option<String>,
    /// Length of a free run, s.
    pub free_run_s: f64,
    /// Free runs on the other half.
    pub free_runs: Vec<FreeRun>,
}

/// All that a diagnosis says.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Diagnosis {
    /// Verdict.
    pub verdict: Verdict,
    /// The stage of the gap and the probability of each; the stage is none where there is no gap.
    pub stage: Option<Stage>,
    /// Probability of each stage.
    pub stages: Vec<(Stage, f64)>,
    /// Effects that the verdict blames.
    pub blamed: Vec<Blame>,
    /// What was known of the unit beside its recordings.
    pub judged_by: JudgedBy,
    /// The whole catalogue, `unknown` and `none`, most probable first.
    pub ranking: Vec<Ranked>,
    /// The gap in each signal.
    pub gap: Vec<SignalGap>,
    /// Share of the gap that the blamed effects close together, on data left out of the fit.
    pub explained_fraction: Interval,
    /// Tests that would tell more, best first; none where nothing is to be settled.
    pub experiments: Vec<Experiment>,
    /// Entropy of the posterior over the hypotheses that are left, bits.
    #[doc(hidden)]
    pub entropy_bits: f64,
    /// The unit refitted without any effect.
    pub refitted: Unit,
    /// The unit refitted with the blamed effects.
    pub fitted: Unit,
    /// The sheet's parameters as fitted in `fitted`.
    pub parameters: Vec<Fitted>,
    /// Channels as found.
    #[doc(hidden)]
    pub channels: Vec<ChannelReport>,
    /// What could be seen at all.
    #[doc(hidden)]
    pub detectable_sizes: Vec<DetectableSize>,
    /// How much the sheet's tolerances limit the verdict; none where no sheet was given.
    pub sheet_limits: Option<SheetLimits>,
    /// Pairs of effects that these recordings cannot tell apart, with how alike they look, 0 to 1.
    #[doc(hidden)]
    pub ambiguous_pairs: Vec<(String, String, f64)>,
    /// The squared gap in parts.
    #[doc(hidden)]
    pub breakdowns: Vec<Breakdown>,
    /// Stages driven by recorded signals; empty where parts of the chain are judged on their own.
    #[doc(hidden)]
    pub stage_tests: Vec<StageTest>,
    /// Free terms.
    #[doc(hidden)]
    pub discrepancy_terms: Vec<DiscrepancyTerm>,
    /// What was tried, best first.
    #[doc(hidden)]
    pub tried: Vec<Tried>,
    /// By how much intervals of the explained share are widened, as a factor of their half-widths.
    pub explained_fraction_widened_by: f64,
    /// Explained fraction on each recording by fits to the others; empty where there is nothing to transfer.
    #[doc(hidden)]
    pub transfers: Vec<Transfer>,
    /// Fault sets that hold nine tenths of the probability of something known, likeliest first.
    #[doc(hidden)]
    pub sets: Vec<(Vec<String>, f64)>,
    /// The evidence that the probabilities rest on.
    #[doc(hidden)]
    pub table: EvidenceTable,
    /// Innovations of the refitted sheet, and of the likeliest fault set.
    #[doc(hidden)]
    pub consistency: [Vec<Consistency>; 2],
    /// How many values were measured.
    #[doc(hidden)]
    pub samples: usize,
    /// Traces for pictures.
    #[doc(hidden)]
    pub traces: Vec<Trace>,
    /// Where the recordings hold no command: the servomotor stage alone was judged, driven by the measured spool.
    #[doc(hidden)]
    pub part: Option<StageOnly>,
    /// What a reader must know beside the verdict.
    pub notes: Vec<String>,
    /// Number of simulated recordings that it took.
    #[doc(hidden)]
    pub simulations: usize,
}
