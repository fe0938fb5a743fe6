//! What a diagnosis says: the verdict and the evidence for it.

mod claims;
mod digests;
mod findings;
mod interval;
mod regret;
mod remainder;
pub mod schema;
mod setup;
mod sheet_limits;
mod stage_figures;
pub mod test_script;
mod traces;

use crate::hypotheses::table::EvidenceTable;
use crate::model::consistency::Consistency;
use govtwin_model::effects::Stage;
use govtwin_model::parameters::Unit;
use govtwin_model::stored::held_by_id;

pub use crate::result::claims::{Blame, Experiment, Fitted, NEXT_TEST, Ranked, SignalGap};
pub use crate::result::digests::sealed;
pub use crate::result::findings::{
    Breakdown, BreakdownPart, ChannelReport, DetectableSize, DiscrepancyTerm, StageTest, Transfer, Tried,
};
pub use crate::result::interval::Interval;
pub use crate::result::regret::Regret;
pub use crate::result::remainder::{LargestError, Remainder};
pub use crate::result::setup::Setup;
pub use crate::result::sheet_limits::{HiddenEffect, SheetLimits, SheetValue};
pub use crate::result::stage_figures::{ComparedModel, ModelParameter, StageFigure, StageOnly};
pub use crate::result::traces::Trace;

/// The six things that a diagnosis may say.
///
/// ```
/// use govtwin_diagnosis::result::Verdict;
///
/// assert_eq!(Verdict::ALL.map(Verdict::id)[..3], ["named", "class", "unknown"]);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// The effects are named, all present at once.
    Named,
    /// One of a few effects that these recordings cannot tell apart.
    Class,
    /// A gap of which nothing in the catalogue explains most.
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
}

held_by_id!(Verdict, "a verdict");

/// All that a diagnosis says.
#[derive(Clone, Debug)]
pub struct Diagnosis {
    /// Verdict.
    pub verdict: Verdict,
    /// The stage of the gap and the probability of each; the stage is none where there is no gap.
    pub stage: Option<Stage>,
    /// Probability of each stage.
    pub stages: Vec<(Stage, f64)>,
    /// Effects that the verdict blames.
    pub blamed: Vec<Blame>,
    /// What was judged, and by what.
    pub setup: Setup,
    /// The whole catalogue, `unknown` and `none`, most probable first.
    pub ranking: Vec<Ranked>,
    /// The gap in each signal.
    pub gap: Vec<SignalGap>,
    /// Share of the gap that the blamed effects close together, on other recordings of the unit.
    pub explained_fraction: Interval,
    /// What the blamed effects leave, or, where none is blamed, the likeliest ones; none where there is no gap.
    pub remainder: Option<Remainder>,
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
    /// By how much the search missed what the true values reach, where they are known.
    #[doc(hidden)]
    pub regret: Option<Regret>,
    /// Number of simulated recordings that it took.
    #[doc(hidden)]
    pub simulations: usize,
}
