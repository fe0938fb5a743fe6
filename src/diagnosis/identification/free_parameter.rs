//! Free parameters: what a fit may turn, in units of what is known of it beforehand.

use crate::estimation::coordinate::Coordinate;
use govtwin_model::effects::EffectParameter;
use govtwin_model::parameters::{ENTRIES, ParameterEntry, Tolerance, Unit};

/// Farthest that a fit may go from the sheet, in standard deviations.
const FARTHEST: f64 = 6.0;
/// The same for a parameter of which nothing is known, in steps.
const FARTHEST_FREE: f64 = 60.0;

/// Something that a fit may turn; position 0 is the nominal or neutral value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum FreeParameter {
    /// A parameter of the sheet, by its place in [`ENTRIES`]; 1 is one standard deviation of its tolerance.
    Parameter {
        /// Place in [`ENTRIES`].
        index: usize,
        /// What the sheet says of its spread.
        tolerance: Tolerance,
    },
    /// A parameter of the sheet of which nothing is known beforehand but its physical range.
    Free {
        /// Place in [`ENTRIES`].
        index: usize,
        /// What 1 is.
        step: Tolerance,
    },
    /// A parameter of an effect; 1 is its typical size on the unit.
    Effect {
        /// Place in the unit's list of effects.
        effect: usize,
        /// Place in the effect's list of parameters.
        parameter: usize,
        /// Its specification, for the reference unit.
        spec: &'static EffectParameter,
    },
}

impl FreeParameter {
    /// A free parameter for each parameter that the unit's sheet gives a tolerance for.
    pub fn nuisances(unit: &Unit) -> Vec<Self> {
        (0..ENTRIES.len())
            .filter_map(|index| unit.tolerances[index].map(|tolerance| Self::Parameter { index, tolerance }))
            .collect()
    }

    /// A free parameter for a parameter that the sheet is not believed in: searched over its physical range, without a prior.
    pub fn free(unit: &Unit, index: usize) -> Self {
        let entry = &ENTRIES[index];
        let usual = if (entry.get)(&unit.parameters) > 0.0 && entry.min >= 0.0 {
            Tolerance::LogNormal(0.1)
        } else {
            Tolerance::Absolute(0.01 * (entry.max - entry.min))
        };
        Self::Free { index, step: unit.tolerances[index].unwrap_or(usual) }
    }

    /// True where the sheet's tolerance speaks for positions near 0.
    pub fn has_prior(&self) -> bool {
        matches!(self, Self::Parameter { .. })
    }

    /// Place in [`ENTRIES`] of a parameter of the sheet; none of an effect's.
    pub fn entry(&self) -> Option<usize> {
        match *self {
            Self::Parameter { index, .. } | Self::Free { index, .. } => Some(index),
            Self::Effect { .. } => None,
        }
    }

    /// The key in parameter files, and the unit.
    pub fn key(&self, unit: &Unit) -> (String, &'static str) {
        match *self {
            Self::Parameter { index, .. } | Self::Free { index, .. } => {
                (ENTRIES[index].key.to_owned(), ENTRIES[index].unit)
            }
            Self::Effect { effect, spec, .. } => (format!("{}.{}", unit.effects[effect].id, spec.name), spec.unit),
        }
    }

    /// Where a fit starts: off the sheet where the sheet's value is a bound at which nothing can be felt.
    pub fn start(&self, unit: &Unit) -> f64 {
        match self {
            Self::Parameter { .. } if self.range(unit).0 == 0.0 => 0.5,
            _ => 0.0,
        }
    }

    /// The value at a position, in the parameter's unit.
    pub fn value(&self, unit: &Unit, position: f64) -> f64 {
        match *self {
            Self::Parameter { index, tolerance } | Self::Free { index, step: tolerance } => {
                let entry: &ParameterEntry = &ENTRIES[index];
                let nominal = (entry.get)(&unit.parameters);
                let value = match tolerance {
                    Tolerance::Relative(share) => nominal * (1.0 + share * position),
                    Tolerance::Absolute(size) => nominal + size * position,
                    Tolerance::LogNormal(share) => nominal * (share * position).exp(),
                };
                value.clamp(entry.min, entry.max)
            }
            Self::Effect { spec, .. } => spec.neutral + (spec.on(&unit.parameters).typical - spec.neutral) * position,
        }
    }

    /// Where the free parameter stands in the unit that it belongs to.
    pub fn position(&self, unit: &Unit) -> f64 {
        match *self {
            Self::Parameter { .. } | Self::Free { .. } => 0.0,
            Self::Effect { effect, parameter, .. } => self.position_at(unit, unit.effects[effect].values[parameter]),
        }
    }

    /// The position at which the parameter has a value, in its unit; the value need not be within its range.
    pub fn position_at(&self, unit: &Unit, value: f64) -> f64 {
        match *self {
            Self::Parameter { index, tolerance } | Self::Free { index, step: tolerance } => {
                let nominal = (ENTRIES[index].get)(&unit.parameters);
                match tolerance {
                    Tolerance::Relative(share) => (value / nominal - 1.0) / share,
                    Tolerance::Absolute(size) => (value - nominal) / size,
                    // A value of the other sign is as far as any.
                    Tolerance::LogNormal(share) => (value / nominal).max(f64::MIN_POSITIVE).ln() / share,
                }
            }
            Self::Effect { spec, .. } => (value - spec.neutral) / (spec.on(&unit.parameters).typical - spec.neutral),
        }
    }

    /// The positions between which a parameter of an effect makes physical sense on a unit.
    pub fn range_of(spec: &EffectParameter, unit: &Unit) -> (f64, f64) {
        let spec = spec.on(&unit.parameters);
        let [a, b] = [spec.min, spec.max].map(|bound| (bound - spec.neutral) / (spec.typical - spec.neutral));
        (a.min(b), a.max(b))
    }
}

impl Coordinate for FreeParameter {
    type Subject = Unit;

    /// The positions between which the value makes physical sense.
    fn range(&self, unit: &Unit) -> (f64, f64) {
        match *self {
            Self::Parameter { index, .. } | Self::Free { index, .. } => {
                let [a, b] = [ENTRIES[index].min, ENTRIES[index].max].map(|bound| self.position_at(unit, bound));
                let farthest = if self.has_prior() { FARTHEST } else { FARTHEST_FREE };
                (a.min(b).clamp(-farthest, 0.0), a.max(b).clamp(0.0, farthest))
            }
            Self::Effect { spec, .. } => Self::range_of(spec, unit),
        }
    }

    /// The position that is likeliest beforehand, with a standard deviation of 1; none where nothing is known.
    ///
    /// Of an effect the first parameter is its size, of which a fit takes nothing for granted; further ones give it its shape, and stand near
    /// their typical values unless the recordings say otherwise.
    fn prior_centre(&self) -> Option<f64> {
        match self {
            Self::Parameter { .. } => Some(0.0),
            Self::Effect { parameter, .. } if *parameter > 0 => Some(1.0),
            Self::Free { .. } | Self::Effect { .. } => None,
        }
    }

    /// Turns the unit's parameter to a position.
    fn turn(&self, base: &Unit, unit: &mut Unit, position: f64) {
        let value = self.value(base, position);
        match *self {
            Self::Parameter { index, .. } | Self::Free { index, .. } => {
                (ENTRIES[index].set)(&mut unit.parameters, value);
            }
            Self::Effect { effect, parameter, .. } => unit.effects[effect].values[parameter] = value,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use govtwin_model::params::reference;

    /// A value may be negative and have a tolerance by its logarithm, as the lower end of a dead band in a sheet from a name plate.
    #[test]
    fn a_range_holds_the_sheet_for_any_tolerance() {
        let mut unit = reference();
        for tolerance in [Tolerance::Relative(0.3), Tolerance::Absolute(1e-4), Tolerance::LogNormal(0.5)] {
            unit.tolerances = vec![Some(tolerance); ENTRIES.len()];
            for one in FreeParameter::nuisances(&unit) {
                let (low, high) = one.range(&unit);
                assert!(
                    low <= 0.0 && high >= 0.0 && high - low <= 2.0 * FARTHEST,
                    "{:?}: {low} to {high}",
                    one.key(&unit)
                );
                let middle = one.value(&unit, 0.5 * (low + high));
                assert!(middle.is_finite(), "{:?}: {middle}", one.key(&unit));
            }
        }
        let lower = ENTRIES.iter().position(|entry| entry.key == "regulator.deadband_lower_pu").unwrap();
        let (low, high) = FreeParameter::Parameter { index: lower, tolerance: Tolerance::LogNormal(0.5) }.range(&unit);
        assert!(low < -1.0 && high > 1.0, "{low} to {high}");
    }
}
