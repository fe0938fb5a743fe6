//! The numbers of the posterior: all that is learned, in one place.
//!
//! They say how far equations and noise may be trusted, on any plant, and nothing of what a unit usually has. `govtwin calibrate` learns them by log
//! score on judged units whose faults are known.

use serde::{Deserialize, Serialize};

/// Most of what a set explains that a further effect may have to gain.
const MOST_FURTHER_SHARE: f64 = 0.3;

/// The numbers, each with what it means.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Hyperparameters {
    /// Share of the independent samples that counts where residuals hold errors of equations, which are alike for long.
    pub tempering: f64,
    /// Logarithm of the odds against each further effect beforehand.
    pub rarity: f64,
    /// Share of what a set explains that each further effect beyond the first must gain: less than that only mends the law of another one.
    pub further_share: f64,
    /// Error of all equations together: what they leave in squares of the noise, half of the time.
    pub equation_error: f64,
    /// Error of the laws of effects: what they leave as a share of what the effects explain, half of the time.
    pub law_error: f64,
    /// Error of data sheets: squares of their tolerances by which the parameters are off, half of the time.
    pub sheet_error: f64,
    /// Spread of all three between plants: the scale of a logistic distribution of their logarithm.
    pub error_spread: f64,
    /// Relative error of the size of an effect that comes of its law: one standard deviation.
    pub size_spread: f64,
    /// Where they were learned: folders, number of units, program version, scores.
    #[serde(default)]
    pub provenance: serde_json::Value,
}

impl Hyperparameters {
    /// How many are learned by log score; the rest by counting.
    pub const LEARNED: usize = 7;

    /// Those that come with the program.
    pub fn shipped() -> Self {
        serde_json::from_str(include_str!("../../../params/posterior.json")).unwrap_or_else(|_| Self::usual())
    }

    /// Nothing learned: round numbers of the right size.
    pub fn usual() -> Self {
        Self {
            tempering: 0.5,
            rarity: 5.0,
            further_share: 0.02,
            equation_error: 1.5,
            law_error: 0.7,
            sheet_error: 4.0,
            error_spread: 0.4,
            size_spread: 0.1,
            provenance: serde_json::Value::Null,
        }
    }

    /// Logarithm of the evidence of a set of so many effects and of the odds against them, the scale of the noise integrated out
    /// ([`super::posterior`]): of so many independent samples, where the set costs so much and the sheet alone `without_effects`.
    pub fn score(&self, samples: f64, without_effects: f64, cost: f64, effects: usize) -> f64 {
        let explained = if without_effects.is_finite() { (without_effects - cost).max(0.0) } else { 0.0 };
        // With this much less explained, effects beyond the first would only mend the law of another.
        let left = cost + self.further_share * effects.saturating_sub(1) as f64 * explained;
        -0.5 * self.tempering * samples * left.ln() - self.rarity * effects as f64
    }

    /// The learned ones moved by so much along their logarithms, within what they may be.
    #[must_use]
    pub fn moved(&self, by: &[f64; Self::LEARNED]) -> Self {
        let [tempering, rarity, further_share, equation_error, law_error, sheet_error, error_spread] = by.map(f64::exp);
        Self {
            tempering: (self.tempering * tempering).min(1.0),
            rarity: self.rarity * rarity,
            further_share: (self.further_share * further_share).min(MOST_FURTHER_SHARE),
            equation_error: self.equation_error * equation_error,
            law_error: self.law_error * law_error,
            sheet_error: self.sheet_error * sheet_error,
            error_spread: self.error_spread * error_spread,
            ..self.clone()
        }
    }

    /// All of them by name.
    pub fn named(&self) -> [(&'static str, f64); 8] {
        [
            ("share of the independent samples that counts", self.tempering),
            ("logarithm of the odds against each effect", self.rarity),
            ("share of what is explained that each further effect must gain", self.further_share),
            ("what equations leave, in squares of the noise", self.equation_error),
            ("what laws of effects leave, as a share of what they explain", self.law_error),
            ("what data sheets are off, in squares of their tolerances", self.sheet_error),
            ("spread of all three between plants", self.error_spread),
            ("relative error of sizes", self.size_spread),
        ]
    }
}
