//! Samples into the order of their stamps: late ones put in place, repeated ones dropped, all counted.

use super::StreamHealth;
use super::streams::{Sample, Value};

/// Sorts samples by stamp and leaves one for each stamp.
///
/// `samples` come in the order of arrival. Of samples with one stamp the last to arrive stays.
pub(super) fn by_stamp<V: Value>(mut samples: Vec<Sample<V>>, health: &mut StreamHealth) -> Vec<Sample<V>> {
    let mut newest_ns = i64::MIN;
    for sample in &samples {
        if sample.stamp_ns < newest_ns {
            health.late += 1;
        }
        newest_ns = newest_ns.max(sample.stamp_ns);
    }
    // Stable: arrival order stays within one stamp.
    samples.sort_by_key(|sample| sample.stamp_ns);
    let mut kept: Vec<Sample<V>> = Vec::with_capacity(samples.len());
    for sample in samples {
        match kept.last_mut() {
            Some(last) if last.stamp_ns == sample.stamp_ns => {
                if last.value.same(sample.value) {
                    health.duplicates += 1;
                } else {
                    health.conflicts += 1;
                }
                *last = sample;
            }
            _ => kept.push(sample),
        }
    }
    health.kept = kept.len() as u64;
    kept
}
