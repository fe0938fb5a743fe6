//! How often claims of a probability were right.

use govtwin_diagnosis::decision::hyperparameters::Hyperparameters;
use govtwin_diagnosis::words::percent;

/// The fewest claims of a probability from which an observed frequency is shown.
const LEAST_CLAIMS: u64 = 5;

/// How often claims of such a probability on whole chains with a data sheet were right, in a sentence.
pub(crate) fn like(claimed: f64) -> Option<String> {
    hit_rate(&Hyperparameters::shipped().provenance, "units", claimed)
}

/// How often claims like this one were right on units whose faults are known; by their probability where that was counted, else over all.
fn hit_rate(learned: &serde_json::Value, units: &str, claimed: f64) -> Option<String> {
    let counted = |bin: &&serde_json::Value| bin["units"].as_u64().unwrap_or(0) >= LEAST_CLAIMS;
    let off = |bin: &&serde_json::Value| (bin["said"].as_f64().unwrap_or(f64::INFINITY) - claimed).abs();
    let bins = learned["reliability"].as_array().into_iter().flatten().filter(counted);
    if let Some(bin) = bins.min_by(|a, b| off(a).total_cmp(&off(b))).filter(|bin| off(bin) <= 0.15) {
        let (said, was) = (bin["said"].as_f64()?, bin["was"].as_f64()?);
        let of = bin["units"].as_u64()?;
        return Some(format!(
            "On held-out generated {units}, {of} statements had a probability of about {}; {} of them were true.",
            percent(said),
            percent(was)
        ));
    }
    let (count, right) = (learned["units"].as_u64()?, learned["first_word_right_held_out"].as_f64()?);
    Some(format!(
        "On {count} held-out generated {units}, the most probable answer was right in {}, whatever its probability.",
        percent(right)
    ))
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::hit_rate;

    #[test]
    fn a_claim_stands_beside_what_came_of_such_claims() {
        let binned = json!({"units": 79, "first_word_right_held_out": 0.56, "reliability": [
            {"said": 0.95, "was": 0.9, "units": 30}, {"said": 0.96, "was": 0.0, "units": 1}, {"said": 0.5, "was": 0.4, "units": 20}]});
        assert!(
            hit_rate(&binned, "units", 0.97)
                .unwrap()
                .starts_with("On held-out generated units, 30 statements had a probability of about 95 %")
        );
        assert!(hit_rate(&binned, "units", 0.55).unwrap().contains("a probability of about 50 %"));
        // No such claim was counted.
        assert!(hit_rate(&binned, "units", 0.75).unwrap().contains("right in 56 %, whatever its probability"));
        let plain = json!({"units": 79, "first_word_right_held_out": 0.56});
        assert!(hit_rate(&plain, "units", 0.97).unwrap().contains("On 79 held-out generated units"));
        assert!(hit_rate(&json!({}), "units", 0.97).is_none(), "weights that were not learned have no record");
    }
}
