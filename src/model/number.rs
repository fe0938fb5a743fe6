//! Numbers as people read them: with few digits, and in the units that people use.

/// A value with a number of significant digits, without an exponent for everyday sizes; a dash for NaN.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped before the cast")]
pub fn significant(value: f64, digits: u32) -> String {
    if !value.is_finite() {
        return "–".into();
    }
    let sign = if value < 0.0 { "\u{2212}" } else { "" };
    let size = value.abs();
    if size == 0.0 {
        return "0".into();
    }
    let magnitude = size.log10().floor();
    if !(-6.0..9.0).contains(&magnitude) {
        return format!("{sign}{size:.*e}", digits.saturating_sub(1) as usize);
    }
    let decimals = (f64::from(digits) - 1.0 - magnitude).clamp(0.0, 12.0) as usize;
    format!("{sign}{size:.decimals$}")
}

/// Prefixes of SI units with their powers of ten.
const PREFIXES: [(&str, i32); 7] = [("G", 9), ("M", 6), ("k", 3), ("", 0), ("m", -3), ("µ", -6), ("n", -9)];

/// The unit that people use for a value, and what the value is multiplied by: shares in percent, lengths in millimetres, others with their
/// SI prefix; no unit where there is none.
pub fn scaled_unit(value: f64, unit: &str) -> (f64, String) {
    let first = unit.split([' ', '/']).next().unwrap_or_default();
    match unit {
        "pu" => (100.0, "%".to_owned()),
        "1" | "" => (1.0, String::new()),
        // Machines are drawn in millimetres, and small openings are drilled in them.
        "m" => (1.0e3, "mm".to_owned()),
        "m2" if value.abs() < 0.01 => (1.0e6, "mm²".to_owned()),
        "m3/s" if value.abs() < 1.0 => (1.0e3, "L/s".to_owned()),
        "m3" if value.abs() < 1.0 => (1.0e3, "L".to_owned()),
        "m3/(s Pa)" => (1.0e12, "mL/(s MPa)".to_owned()),
        "m/N" => (1.0e9, "nm/N".to_owned()),
        _ if matches!(first, "s" | "Pa" | "N" | "W" | "A" | "V" | "Hz") && value.is_finite() && value != 0.0 => {
            let thousands = |power: i32| value.abs() * (1.0 + 1e-9) >= 10.0_f64.powi(power);
            let (prefix, power) = PREFIXES.into_iter().find(|(_, power)| thousands(*power)).unwrap_or(("", 0));
            (10.0_f64.powi(-power), format!("{prefix}{}", raised(unit)))
        }
        unit => (1.0, raised(unit)),
    }
}

/// A unit with its powers raised: `m³/s` of `m3/s`.
fn raised(unit: &str) -> String {
    let mut after_letter = false;
    let raise = |c: char| {
        let power = after_letter.then(|| "0123456789".find(c)).flatten();
        after_letter = c.is_ascii_alphabetic();
        power.and_then(|digit| "⁰¹²³⁴⁵⁶⁷⁸⁹".chars().nth(digit)).unwrap_or(c)
    };
    unit.chars().map(raise).collect()
}

/// A value with three digits in the unit that people use for it.
pub fn quantity(value: f64, unit: &str) -> String {
    let (factor, unit) = scaled_unit(value, unit);
    format!("{} {unit}", significant(factor * value, 3)).trim_end().to_owned()
}

/// A value with a fixed number of digits after the point and a true minus sign; a dash for NaN.
pub fn fixed(value: f64, decimals: usize) -> String {
    if !value.is_finite() {
        return "–".into();
    }
    let text = format!("{:.decimals$}", value.abs());
    // What rounds to zero has no sign.
    let zero = text.bytes().all(|byte| matches!(byte, b'0' | b'.'));
    if value < 0.0 && !zero { format!("\u{2212}{text}") } else { text }
}

#[cfg(test)]
mod tests {
    use super::{fixed, quantity, significant};

    #[test]
    fn quantities_have_three_digits_and_the_units_of_people() {
        for (value, unit, expected) in [
            (1.68e-4, "m", "0.168 mm"),
            (0.6, "m", "600 mm"),
            (6.3e6, "Pa", "6.30 MPa"),
            (-2.5e5, "N", "\u{2212}250 kN"),
            (0.0042, "pu", "0.420 %"),
            (0.012, "s", "12.0 ms"),
            (85.0, "kg", "85.0 kg"),
            (1.2, "1", "1.20"),
            (6.67e-4, "m3/s", "0.667 L/s"),
            (4.8e-4, "m3", "0.480 L"),
            (5.0e-12, "m3/(s Pa)", "5.00 mL/(s MPa)"),
            (4.72e-10, "m/N", "0.472 nm/N"),
            (1.77e-5, "m2", "17.7 mm²"),
            (0.0314, "m2", "0.0314 m²"),
            (2.87e9, "Pa s2/m6", "2.87 GPa s²/m⁶"),
            (850.0, "kg/m3", "850 kg/m³"),
            (f64::NAN, "Pa", "– Pa"),
        ] {
            assert_eq!(quantity(value, unit), expected);
        }
    }

    #[test]
    fn numbers_keep_their_digits() {
        assert_eq!(significant(0.000_123_456, 3), "0.000123");
        assert_eq!(significant(-12.3456, 3), "\u{2212}12.3");
        assert_eq!(significant(6_300_000.0, 3), "6300000");
        assert_eq!(significant(2.0e-13, 2), "2.0e-13");
        assert_eq!(significant(f64::NAN, 3), "–");
        assert_eq!(fixed(-0.123_45, 3), "\u{2212}0.123");
        assert_eq!(fixed(-0.000_4, 3), "0.000");
    }
}
