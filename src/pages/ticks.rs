//! Positions and texts of an axis's labels.

use super::picture::Axis;
use govtwin_model::number::{fixed, significant};

/// Values and labels of an axis, about one in `apart` px.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "small and positive")]
pub(crate) fn ticks(axis: &Axis, [from, to]: [f64; 2], length_px: f64, apart: f64) -> Vec<(f64, String)> {
    if !axis.categories.is_empty() {
        return axis.categories.iter().enumerate().map(|(i, name)| (i as f64, name.clone())).collect();
    }
    if axis.decades {
        let steps = (-9..=9).flat_map(|power| [1.0, 2.0, 5.0].map(|step| step * 10.0_f64.powi(power)));
        let inside = steps.filter(|value| value.log10() >= from - 1e-9 && value.log10() <= to + 1e-9);
        return inside.map(|value| (value.log10(), significant(value, 1))).collect();
    }
    let wanted = (length_px / apart).max(2.0) as usize;
    // An axis needs a few values, even where those are more than wanted.
    let values = (wanted..wanted + 6).map(|most| round_values(from, to, most)).find(|values| values.len() >= 3);
    let values = values.unwrap_or_else(|| round_values(from, to, wanted));
    let step = values.windows(2).map(|pair| pair[1] - pair[0]).fold(f64::INFINITY, f64::min);
    let decimals = if step.is_finite() { (-(step * 1.0001).log10().floor()).clamp(0.0, 6.0) as usize } else { 3 };
    values.into_iter().map(|value| (value, fixed(value, decimals))).collect()
}

/// The multiples in a range of the least of 1, 2 and 5 times powers of ten that has no more than so many there.
#[expect(clippy::cast_possible_truncation, reason = "counts of labels")]
fn round_values(from: f64, to: f64, most: usize) -> Vec<f64> {
    let inside = |step: f64| (from / step - 1e-9).ceil() as i64..=(to / step + 1e-9).floor() as i64;
    let largest = (to - from).log10().floor() as i32 + 1;
    let steps = (0..).flat_map(|k| [1.0, 0.5, 0.2].map(|part| part * 10.0_f64.powi(largest - k)));
    let step = steps.take_while(|step| inside(*step).count() <= most).last();
    step.map_or(vec![], |step| inside(step).map(|k| k as f64 * step).collect())
}

#[cfg(test)]
mod tests {
    use super::round_values;

    #[test]
    fn values_are_round_and_reach_both_ends() {
        for (from, to, most, first, last, count) in
            [(0.0, 0.3, 4, 0.0, 0.3, 4), (-3.8, -3.7, 3, -3.8, -3.7, 3), (1.19, 4.14, 16, 1.2, 4.0, 15)]
        {
            let values = round_values(from, to, most);
            let near = |value: Option<&f64>, expected: f64| value.is_some_and(|value| (value - expected).abs() < 1e-9);
            assert!(near(values.first(), first) && near(values.last(), last), "{values:?}");
            assert_eq!(values.len(), count);
        }
    }
}
