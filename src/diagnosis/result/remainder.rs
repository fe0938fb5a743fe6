//! What the named causes leave: something else as well, or errors of equations.

use serde::{Deserialize, Serialize};

use crate::result::Interval;
use govtwin_model::effects::Stage;
use govtwin_model::signal::Signal;
use govtwin_model::stored::figure;

/// What is left of the gap once the twin has the causes that come nearest.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Remainder {
    /// Ids of the effects that the twin has: those that the verdict blames, else those of the likeliest fault set.
    pub beside: Vec<String>,
    /// Share of the gap that these explain on other recordings of the unit.
    pub explained: Interval,
    /// Share of the gap that remains, 0 to 1.
    #[serde(deserialize_with = "figure")]
    pub share: f64,
    /// Probability that something else is at work, beside these effects or instead of them; 0 in reports of older programs.
    #[serde(default)]
    pub something_else: f64,
    /// χ² that remains for each independent sample: 1 for a right twin, 1 to 3 where nothing but equations are a little wrong.
    #[serde(rename = "chi_square_per_sample", deserialize_with = "figure")]
    pub chi_square: f64,
    /// Stage at which something else would explain most of it; none where nothing would.
    pub stage: Option<Stage>,
    /// Where it is largest; none where nothing remains.
    pub largest: Option<LargestError>,
}

impl Remainder {
    /// Whether something else is likelier at work than not.
    pub fn says_something_else(&self) -> bool {
        self.something_else > 0.5
    }
}

/// The stretch of all recordings in which a twin is farthest off.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LargestError {
    /// Recording.
    pub recording: String,
    /// Signal that is farthest off there, in its noise.
    pub signal: Signal,
    /// Begin, time since the first row, s.
    #[serde(deserialize_with = "figure")]
    pub from_s: f64,
    /// End, s.
    #[serde(deserialize_with = "figure")]
    pub to_s: f64,
    /// RMS error of that signal there, in its unit.
    #[serde(deserialize_with = "figure")]
    pub rms: f64,
    /// Share of all that remains.
    #[serde(deserialize_with = "figure")]
    pub share: f64,
}
