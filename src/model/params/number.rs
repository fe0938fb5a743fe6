//! Numbers as people and every YAML reader understand them, without losing a digit.

use crate::parameters::Tolerance;

/// The shortest text that reads back as the same number.
///
/// Exponents carry a dot and a sign (`2.0e-13`), without which YAML 1.1 readers take them for text.
pub fn number_text(value: f64) -> String {
    let size = value.abs();
    if !value.is_finite() {
        // YAML's own words; no parameter accepts them, but an error message may have to show one.
        return if value.is_nan() {
            ".nan"
        } else if value > 0.0 {
            ".inf"
        } else {
            "-.inf"
        }
        .to_owned();
    }
    if size == 0.0 || (1e-3..1e6).contains(&size) {
        return format!("{value:?}");
    }
    let text = format!("{value:e}");
    let (mantissa, exponent) = text.split_once('e').unwrap_or((&text, "0"));
    let dot = if mantissa.contains('.') { "" } else { ".0" };
    let sign = if exponent.starts_with('-') { "" } else { "+" };
    format!("{mantissa}{dot}e{sign}{exponent}")
}

/// A number with its unit; `1` is no unit.
pub fn quantity_text(value: f64, unit: &str) -> String {
    if unit == "1" { number_text(value) } else { format!("{} {unit}", number_text(value)) }
}

/// A tolerance in a reader's words.
pub fn tolerance_text(tolerance: Tolerance, unit: &str) -> String {
    match tolerance {
        Tolerance::Relative(share) => format!("± {} %", decimals(share * 100.0)),
        Tolerance::Absolute(spread) => format!("± {}", quantity_text(spread, unit)),
        Tolerance::LogNormal(spread) => format!("× or ÷ {}", decimals(spread.exp())),
    }
}

/// At most three decimals, none of them a trailing zero.
fn decimals(value: f64) -> String {
    format!("{value:.3}").trim_end_matches('0').trim_end_matches('.').to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reads_well() {
        assert_eq!(number_text(870.0), "870.0");
        assert_eq!(number_text(0.0), "0.0");
        assert_eq!(number_text(2e-13), "2.0e-13");
        assert_eq!(number_text(-6.67e-4), "-6.67e-4");
        assert_eq!(number_text(1e9), "1.0e+9");
        assert_eq!(number_text(f64::NEG_INFINITY), "-.inf");
        assert_eq!(quantity_text(0.62, "1"), "0.62");
        assert_eq!(tolerance_text(Tolerance::Relative(0.1), "Pa"), "± 10 %");
        assert_eq!(tolerance_text(Tolerance::Absolute(0.005), "pu"), "± 0.005 pu");
        assert_eq!(tolerance_text(Tolerance::LogNormal(0.3), "1"), "× or ÷ 1.35");
    }
}
