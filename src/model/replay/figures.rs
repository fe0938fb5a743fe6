//! How far a twin is off, signal by signal: the figures that reports and their comparisons share.

use serde::Serialize;

use crate::signal::Signal;

/// Figures over all rows of several recordings.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RecordingGroup {
    /// Id of their process; absent for everything.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub process: Option<&'static str>,
    /// How many recordings.
    pub recordings: usize,
    /// Figures, signal by signal.
    pub signals: Vec<SignalFigures>,
}

impl RecordingGroup {
    /// The figures of a signal.
    pub fn of(&self, signal: Signal) -> Option<&SignalFigures> {
        self.signals.iter().find(|figures| figures.name == signal.id())
    }
}

/// Figures of one signal.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SignalFigures {
    /// [`crate::signal::Signal::id`].
    pub name: &'static str,
    /// Unit of the figures; that of `r2` is 1.
    pub unit: &'static str,
    /// The measured signal replaces the simulated one, which is therefore not evaluated.
    pub stands_in: bool,
    /// Rows compared.
    pub rows: u64,
    /// Measured rows for which the twin has no finite value.
    pub left_out: u64,
    /// Mean absolute error.
    pub mae: f64,
    /// Root mean square error.
    pub rmse: f64,
    /// Coefficient of determination.
    pub r2: f64,
    /// Mean of simulated − measured.
    pub bias: f64,
    /// Largest absolute error.
    pub max_abs: f64,
}
