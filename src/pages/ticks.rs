//! Positions and texts of an axis's labels.

use plotters::coord::ranged1d::Ranged;
use plotters::coord::types::RangedCoordf64;

use super::picture::Axis;
use govtwin_model::number::{fixed, significant};

/// Values and labels of an axis, about one in `apart` px.
#[expect(clippy::cast_precision_loss, reason = "a handful of categories")]
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "small and positive")]
pub fn ticks(axis: &Axis, [from, to]: [f64; 2], length_px: f64, apart: f64) -> Vec<(f64, String)> {
    if !axis.categories.is_empty() {
        return axis.categories.iter().enumerate().map(|(i, name)| (i as f64, name.clone())).collect();
    }
    if axis.decades {
        let steps = (-9..=9).flat_map(|power| [1.0, 2.0, 5.0].map(|step| step * 10.0_f64.powi(power)));
        let inside = steps.filter(|value| value.log10() >= from - 1e-9 && value.log10() <= to + 1e-9);
        return inside.map(|value| (value.log10(), significant(value, 1))).collect();
    }
    let coord = RangedCoordf64::from(from..to);
    let wanted = (length_px / apart).max(2.0) as usize;
    // The library takes the wanted number as a limit and at times gives one value; an axis needs a few.
    let values = (wanted..wanted + 6).map(|most| coord.key_points(most)).find(|values| values.len() >= 3);
    let values = values.unwrap_or_else(|| coord.key_points(wanted));
    let step = values.windows(2).map(|pair| pair[1] - pair[0]).fold(f64::INFINITY, f64::min);
    let decimals = if step.is_finite() { (-(step * 1.0001).log10().floor()).clamp(0.0, 6.0) as usize } else { 3 };
    values.into_iter().map(|value| (value, fixed(value, decimals))).collect()
}
