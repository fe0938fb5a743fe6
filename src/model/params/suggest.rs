//! "Did you mean": the known name nearest to one that is not known.

/// Below this likeness a suggestion misleads more than it helps; 1 is equality.
const LEAST_LIKENESS: f64 = 0.75;

/// The candidate most like `word`, the first of equals; `None` where none is near.
pub fn nearest<'a>(word: &str, candidates: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let mut best = None;
    for candidate in candidates {
        let likeness = strsim::jaro_winkler(&word.to_lowercase(), candidate);
        if likeness >= LEAST_LIKENESS && best.is_none_or(|(most, _)| likeness > most) {
            best = Some((likeness, candidate));
        }
    }
    best.map(|(_, candidate)| candidate)
}

#[cfg(test)]
mod tests {
    use super::nearest;

    #[test]
    fn finds_a_slip_and_refuses_a_stranger() {
        let known = ["density_kg_m3", "bulk_modulus_pa", "tank_pressure_pa"];
        assert_eq!(nearest("bulk_modulus", known), Some("bulk_modulus_pa"));
        assert_eq!(nearest("TANK_PRESSURE_BAR", known), Some("tank_pressure_pa"));
        assert_eq!(nearest("xyz", known), None);
    }
}
