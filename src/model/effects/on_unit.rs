//! Effects switched on in a unit by their names, checked against the catalogue and the owner's definitions.

use crate::effects::own::{OwnError, spec};
use crate::effects::{CATALOGUE, EffectSpec, find_in};
use crate::parameters::{EffectSetting, OwnEffect, Unit};

/// Why an effect cannot be switched on.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum EffectError {
    /// Neither the catalogue nor the unit's owner has such an effect.
    #[error("there is no effect `{found}`; known are {}", known.join(", "))]
    Effect {
        /// The id as given.
        found: String,
        /// The ids that are known.
        known: Vec<String>,
    },
    /// The effect has no parameter of this name.
    #[error("`{effect}` has no parameter `{found}`; it has {}", known.join(", "))]
    Parameter {
        /// The effect's id.
        effect: String,
        /// The name as given.
        found: String,
        /// The names that it has.
        known: Vec<&'static str>,
    },
    /// A value outside of the range that makes physical sense, or none at all.
    #[error("{effect}.{parameter}: expected {min} to {max} {unit}, found {found}")]
    Range {
        /// The effect's id.
        effect: String,
        /// The parameter's name.
        parameter: &'static str,
        /// Smallest value, in the unit.
        min: f64,
        /// Largest value, in the unit.
        max: f64,
        /// The parameter's unit, `1` where there is none.
        unit: &'static str,
        /// The value as given.
        found: f64,
    },
}

impl Unit {
    /// The place of an effect among the unit's; one that is not among them is switched on, but neutral.
    pub fn effect_at(&mut self, spec: &EffectSpec) -> usize {
        self.effects.iter().position(|setting| setting.id == spec.id).unwrap_or_else(|| {
            self.effects.push(EffectSetting { id: spec.id.to_owned(), values: spec.completed(&[]) });
            self.effects.len() - 1
        })
    }

    /// The same unit with an effect switched on, in the place of an earlier setting of it.
    ///
    /// `values` are parameters by name, each in the unit of [`EffectParameter`](crate::effects::EffectParameter); those that are not given
    /// are neutral. The effect is one of the [catalogue](CATALOGUE), or one that [`Unit::with_own_effect`] defined.
    ///
    /// # Errors
    /// When no such effect or parameter is known, or a value is outside its physical range.
    ///
    /// ```
    /// let worn = govtwin_model::params::reference().with_effect("spool_friction", &[("coulomb_n", 400.0)])?;
    /// assert_eq!(worn.effects[0].values, [400.0, 1.0]); // `static_ratio` was not given
    ///
    /// let error = worn.with_effect("backlash", &[("play_pu", 3.0)]).unwrap_err();
    /// assert_eq!(error.to_string(), "backlash.play_pu: expected 0 to 0.1 pu, found 3");
    /// # Ok::<(), govtwin_model::effects::on_unit::EffectError>(())
    /// ```
    pub fn with_effect(mut self, id: &str, values: &[(&str, f64)]) -> Result<Self, EffectError> {
        let Some(spec) = find_in(&self, id) else {
            let own = self.own_effects.iter().map(|own| own.id.clone());
            let known = CATALOGUE.iter().map(|spec| spec.id.to_owned()).chain(own).collect();
            return Err(EffectError::Effect { found: id.to_owned(), known });
        };
        let mut setting = EffectSetting { id: id.to_owned(), values: spec.completed(&[]) };
        for (name, value) in values {
            let Some(at) = spec.parameters.iter().position(|parameter| parameter.name == *name) else {
                let known = spec.parameters.iter().map(|parameter| parameter.name).collect();
                return Err(EffectError::Parameter { effect: id.to_owned(), found: (*name).to_owned(), known });
            };
            let parameter = spec.parameters[at].on(&self.parameters);
            if !(parameter.min..=parameter.max).contains(value) {
                return Err(EffectError::Range {
                    effect: id.to_owned(),
                    parameter: parameter.name,
                    min: parameter.min,
                    max: parameter.max,
                    unit: parameter.unit,
                    found: *value,
                });
            }
            setting.values[at] = *value;
        }
        self.effects.retain(|known| known.id != id);
        self.effects.push(setting);
        Ok(self)
    }

    /// The same unit with a definition of an effect of the owner's, in the place of an earlier one of the same id; it is not switched on.
    ///
    /// # Errors
    /// When a name in it is not known, the expression cannot be read, a range is not one, or the effect does not vanish at its neutral values.
    pub fn with_own_effect(mut self, own: OwnEffect) -> Result<Self, OwnError> {
        spec(&own)?;
        self.own_effects.retain(|known| known.id != own.id);
        self.own_effects.push(own);
        Ok(self)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::params::reference;

    #[test]
    fn an_effect_is_switched_on_once() {
        let unit = reference().with_effect("backlash", &[("play_pu", 0.01)]).unwrap();
        let unit = unit.with_effect("cushion", &[("length_pu", 0.06)]).unwrap();
        let unit = unit.with_effect("backlash", &[("play_pu", 0.002)]).unwrap();
        let settings: Vec<(&str, &[f64])> = unit.effects.iter().map(|one| (one.id.as_str(), &one.values[..])).collect();
        assert_eq!(settings, [("cushion", &[0.0, 0.06][..]), ("backlash", &[0.002])]);
    }

    #[test]
    fn slips_say_what_is_known() {
        let of = |id: &str, name: &str, value: f64| reference().with_effect(id, &[(name, value)]).unwrap_err();
        assert!(
            of("backlsh", "play_pu", 0.0)
                .to_string()
                .starts_with("there is no effect `backlsh`; known are command_delay, ")
        );
        assert_eq!(
            of("spring", "stiffness", 0.1).to_string(),
            "`spring` has no parameter `stiffness`; it has stiffness_loss_share, preload_loss_m"
        );
        for value in [-1.0, f64::NAN, f64::INFINITY] {
            assert!(
                matches!(of("backlash", "play_pu", value), EffectError::Range { min: 0.0, max: 0.1, unit: "pu", .. }),
                "{value}"
            );
        }
    }
}
