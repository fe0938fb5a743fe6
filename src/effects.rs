//! The effect catalogue: what a real unit may do beyond the nominal model, as switches of the same twin.

use crate::parameters::EffectSetting;
use crate::plant::Plant;

/// One parameter of an effect.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EffectParameter {
    /// Name as parameter files write it, with its unit suffix.
    pub name: &'static str,
    /// Unit, `1` where there is none.
    pub unit: &'static str,
    /// Value at which the effect vanishes exactly.
    pub neutral: f64,
    /// Smallest value that makes physical sense.
    pub min: f64,
    /// Largest value that makes physical sense.
    pub max: f64,
    /// What it is.
    pub doc: &'static str,
}

/// What the rest of the house needs to know of an effect.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EffectSpec {
    /// Its id, a contract with reports and parameter files.
    pub id: &'static str,
    /// Its parameters; [`crate::parameters::EffectSetting::values`] has their order.
    pub parameters: &'static [EffectParameter],
}

/// Every effect that the twin can switch on. None is built yet.
pub const CATALOGUE: &[EffectSpec] = &[];

/// Builds a list of effects into a plant; unknown ids are ignored because parameter files are checked at the edge.
pub fn apply(_settings: &[EffectSetting], _plant: &mut Plant) {}
