//! Quantities as people write them on plates, `63 bar` or `40 L/min`, in SI units.

/// What a quantity measures.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Dimension {
    /// m.
    Length,
    /// m².
    Area,
    /// m³.
    Volume,
    /// Pa.
    Pressure,
    /// s.
    Time,
    /// m³/s.
    Flow,
    /// kg.
    Mass,
    /// N.
    Force,
    /// rad/s, also written as Hz.
    Frequency,
    /// kg/m³.
    Density,
    /// A share of a stroke.
    Share,
    /// No unit.
    Plain,
}

/// A text that is no quantity of the dimension.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("expected a number and one of the units {}, found `{found}`", units.join(", "))]
#[non_exhaustive]
pub struct QuantityError {
    /// The units of the dimension.
    pub units: Vec<&'static str>,
    /// The text.
    pub found: String,
}

impl Dimension {
    /// Its units with their size in SI units, the SI unit first.
    pub fn units(self) -> &'static [(&'static str, f64)] {
        match self {
            Self::Length => &[("m", 1.0), ("mm", 1e-3), ("cm", 1e-2), ("um", 1e-6), ("in", 0.0254)],
            Self::Area => &[("m2", 1.0), ("cm2", 1e-4), ("mm2", 1e-6)],
            Self::Volume => &[("m3", 1.0), ("L", 1e-3), ("l", 1e-3), ("dm3", 1e-3), ("cm3", 1e-6)],
            Self::Pressure => {
                &[("Pa", 1.0), ("bar", 1e5), ("MPa", 1e6), ("kPa", 1e3), ("psi", 6_894.757), ("kgf/cm2", 98_066.5)]
            }
            Self::Time => &[("s", 1.0), ("ms", 1e-3), ("min", 60.0)],
            Self::Flow => &[
                ("m3/s", 1.0),
                ("L/min", 1e-3 / 60.0),
                ("l/min", 1e-3 / 60.0),
                ("L/s", 1e-3),
                ("l/s", 1e-3),
                ("m3/h", 1.0 / 3600.0),
            ],
            Self::Mass => &[("kg", 1.0), ("t", 1000.0)],
            Self::Force => &[("N", 1.0), ("kN", 1e3), ("MN", 1e6), ("t", 9_806.65)],
            Self::Frequency => &[("rad/s", 1.0), ("Hz", std::f64::consts::TAU)],
            Self::Density => &[("kg/m3", 1.0), ("g/cm3", 1000.0)],
            Self::Share => &[("pu", 1.0), ("%", 0.01)],
            Self::Plain => &[("1", 1.0)],
        }
    }

    /// The SI unit.
    pub fn unit(self) -> &'static str {
        self.units().first().map_or("1", |(name, _)| name)
    }

    /// A quantity in its SI unit; a number without a unit is in it already.
    ///
    /// # Errors
    /// Where there is no number, or a unit of another dimension.
    pub fn parse(self, text: &str) -> Result<f64, QuantityError> {
        let text = text.trim();
        let end =
            text.find(|letter: char| !(letter.is_ascii_digit() || "+-.,eE".contains(letter))).unwrap_or(text.len());
        // An exponent ends in a digit; what follows it is a unit.
        let end = text[..end].trim_end_matches(['e', 'E']).len();
        let (number, unit) = text.split_at(end);
        let number = if number.contains('.') { number.to_owned() } else { number.replace(',', ".") };
        let unit = unit.trim().replace(['²'], "2").replace(['³'], "3");
        let size = if unit.is_empty() {
            Some(1.0)
        } else {
            self.units().iter().find(|(name, _)| *name == unit).map(|(_, size)| *size)
        };
        let wanted =
            || QuantityError { units: self.units().iter().map(|(name, _)| *name).collect(), found: text.to_owned() };
        let number: f64 = number.parse().map_err(|_| wanted())?;
        size.map(|size| number * size).filter(|value| value.is_finite()).ok_or_else(wanted)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantities_are_read_with_their_units() {
        for (dimension, text, value) in [
            (Dimension::Pressure, "63 bar", 6.3e6),
            (Dimension::Pressure, "6.3 MPa", 6.3e6),
            (Dimension::Pressure, "6.3e6", 6.3e6),
            (Dimension::Length, "600mm", 0.6),
            (Dimension::Length, "0,6 m", 0.6),
            (Dimension::Volume, "120 L", 0.12),
            (Dimension::Flow, "40 L/min", 40e-3 / 60.0),
            (Dimension::Frequency, "60 Hz", 376.991_118),
            (Dimension::Share, "0.05 %", 5e-4),
            (Dimension::Area, "2000 cm²", 0.2),
            (Dimension::Plain, "-30", -30.0),
        ] {
            let found = dimension.parse(text).unwrap();
            assert!((found - value).abs() < 1e-6 * value.abs(), "{text}: {found}");
        }
        for (dimension, text) in [(Dimension::Pressure, "63 mm"), (Dimension::Length, "long"), (Dimension::Time, "")] {
            let error = dimension.parse(text).unwrap_err().to_string();
            assert!(error.contains(dimension.unit()) && error.contains("expected a number"), "{error}");
        }
    }
}
