//! What the recordings could show: the smallest size of each effect that would stand out, and effects that leave the same mark.

use crate::hypotheses::Explored;
use crate::result::DetectableSize;
use govtwin_model::effects::EffectSpec;

/// Gain in cost from which an effect stands out: a log Bayes factor of 10, of which the odds against any effect take half.
pub(crate) const STANDS_OUT: f64 = 20.0;

/// From this cosine on the marks of two effects cannot be told apart here.
const ALIKE: f64 = 0.97;

/// The smallest size of each effect that would stand out.
pub fn detectable_sizes(explored: &Explored, catalogue: &[&'static EffectSpec]) -> Vec<DetectableSize> {
    let base = &explored.refitted().base;
    let of = |(effect, spec): (usize, &&'static EffectSpec)| {
        let parameter = spec.parameters[0].on(&base.parameters);
        let scale = base.recorded.of_unit(parameter.unit);
        let typical = scale * (parameter.typical - parameter.neutral).abs();
        let smallest = typical * explored.linearisation.minimum_detectable_size(effect, STANDS_OUT);
        let with_known_sheet = smallest / explored.linearisation.sharpest_ratio(effect, STANDS_OUT);
        DetectableSize {
            id: spec.id,
            parameter: parameter.name,
            unit: parameter.unit,
            smallest,
            with_known_sheet,
            typical,
        }
    };
    catalogue.iter().enumerate().map(of).collect()
}

/// Pairs whose marks are alike, most alike first.
pub fn ambiguous_pairs(explored: &Explored, catalogue: &[&'static EffectSpec]) -> Vec<(String, String, f64)> {
    let mut pairs = Vec::new();
    for (a, one) in catalogue.iter().enumerate() {
        for (b, other) in catalogue.iter().enumerate().skip(a + 1) {
            let likeness = explored.linearisation.likeness(a, b);
            if likeness > ALIKE {
                pairs.push((one.id.to_owned(), other.id.to_owned(), likeness));
            }
        }
    }
    pairs.sort_by(|a, b| b.2.total_cmp(&a.2));
    pairs
}
