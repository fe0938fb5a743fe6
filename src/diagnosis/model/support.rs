//! Fault sets: which effects are present at once, and the unit that has them.

use crate::estimation::coordinate::Coordinate;
use crate::identification::free_parameter::FreeParameter;
use govtwin_model::effects::EffectSpec;
use govtwin_model::parameters::{EffectSetting, Unit};

/// Sizes of effects beforehand: median and spread of the logarithm of the size over the typical one.
pub const SIZE_PRIOR: (f64, f64) = (1.1, 0.8);

/// Size of an effect's first parameter in typical ones, and where its further ones stand: neutral at 0, typical at 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Variant {
    /// Size.
    pub size: f64,
    /// Shape.
    pub further: f64,
}

/// A unit with effects on top, all that may be fitted, and where it stands.
pub type Placed = (Unit, Vec<FreeParameter>, Vec<f64>);

/// Puts one more effect onto a unit; none where the size is out of its range.
pub fn add(placed: &mut Placed, spec: &'static EffectSpec, variant: Variant) -> bool {
    let (base, free_parameters, positions) = placed;
    let effect = base.effects.len();
    let neutral = spec.parameters.iter().map(|parameter| parameter.neutral).collect();
    base.effects.push(EffectSetting { id: spec.id.to_owned(), values: neutral });
    let mut fits = true;
    for (parameter, spec) in spec.parameters.iter().enumerate() {
        let free_parameter = FreeParameter::Effect { effect, parameter, spec };
        let (low, high) = free_parameter.range(base);
        let wanted = if parameter == 0 { variant.size } else { variant.further };
        let held = wanted.clamp(low, high);
        fits &= parameter > 0 || held == wanted;
        positions.push(held);
        free_parameters.push(free_parameter);
    }
    fits
}
