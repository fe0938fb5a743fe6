//! Colours by role: one meaning keeps one colour in every picture, in light and in dark.
//!
//! The hues are those of Okabe and Ito 2008, "Color Universal Design", which stay apart for every
//! common kind of colour blindness; some are darkened or lightened to stand off their background.

/// The meaning of a colour.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ink {
    /// Words and outlines.
    Text,
    /// Axis labels and lesser words.
    Muted,
    /// Grid lines and frames.
    Grid,
    /// The background.
    Paper,
    /// What was commanded.
    Command,
    /// What was measured.
    Measured,
    /// Simulated by the twin.
    Simulated,
    /// Simulated minus measured.
    Difference,
    /// Noise floors, intervals, tolerances.
    Band,
    /// Trips, alarms, errors.
    Alarm,
    /// What is right.
    Good,
    /// Further series, for comparisons: a further model, a further candidate.
    Extra1,
    /// See [`Ink::Extra1`].
    Extra2,
    /// See [`Ink::Extra1`].
    Extra3,
}

impl Ink {
    /// All roles.
    pub const ALL: [Self; 14] = [
        Self::Text,
        Self::Muted,
        Self::Grid,
        Self::Paper,
        Self::Command,
        Self::Measured,
        Self::Simulated,
        Self::Difference,
        Self::Band,
        Self::Alarm,
        Self::Good,
        Self::Extra1,
        Self::Extra2,
        Self::Extra3,
    ];

    /// Colours for series that have no role of their own, in the order to take them.
    pub const SERIES: [Self; 6] =
        [Self::Simulated, Self::Measured, Self::Good, Self::Extra1, Self::Extra2, Self::Extra3];

    /// The name of its CSS variable, without the dashes, and its colours on light and on dark paper.
    const fn sheet(self) -> (&'static str, [u8; 3], [u8; 3]) {
        match self {
            Self::Text => ("ink-text", [0x1A, 0x1D, 0x21], [0xE8, 0xEA, 0xED]),
            Self::Muted => ("ink-muted", [0x5A, 0x62, 0x6B], [0xA3, 0xAB, 0xB5]),
            Self::Grid => ("ink-grid", [0xE1, 0xE4, 0xE8], [0x36, 0x3B, 0x42]),
            Self::Paper => ("ink-paper", [0xFF, 0xFF, 0xFE], [0x16, 0x18, 0x1C]),
            Self::Command => ("ink-command", [0x8A, 0x90, 0x98], [0x8B, 0x93, 0x9C]),
            Self::Measured => ("ink-measured", [0xE6, 0x9F, 0x00], [0xE6, 0x9F, 0x01]),
            Self::Simulated => ("ink-simulated", [0x00, 0x5F, 0x9E], [0x6C, 0xC4, 0xF5]),
            Self::Difference => ("ink-difference", [0x9C, 0x3F, 0x7B], [0xE0, 0x93, 0xBD]),
            Self::Band => ("ink-band", [0x7F, 0x88, 0x92], [0x9A, 0xA3, 0xAD]),
            Self::Alarm => ("ink-alarm", [0xC2, 0x4E, 0x00], [0xFF, 0x8A, 0x4A]),
            Self::Good => ("ink-good", [0x00, 0x86, 0x62], [0x2B, 0xC4, 0x9A]),
            Self::Extra1 => ("ink-extra1", [0xB0, 0x56, 0x89], [0xCC, 0x79, 0xA7]),
            Self::Extra2 => ("ink-extra2", [0x3D, 0x9B, 0xD1], [0x56, 0xB4, 0xE8]),
            Self::Extra3 => ("ink-extra3", [0x8C, 0x82, 0x00], [0xF0, 0xE4, 0x42]),
        }
    }

    /// Red, green and blue on light paper; no two roles share them.
    #[must_use]
    pub const fn rgb(self) -> [u8; 3] {
        self.sheet().1
    }

    /// The CSS value: a variable that the page sets, with the light colour where no page does.
    #[must_use]
    pub fn css(self) -> String {
        format!("var(--{},{})", self.sheet().0, hex(self.rgb()))
    }

    /// The declarations of all variables, for light or for dark paper.
    #[must_use]
    pub fn declarations(dark: bool) -> String {
        Self::ALL
            .iter()
            .map(|ink| {
                let (name, light_rgb, dark_rgb) = ink.sheet();
                format!("--{name}:{};", hex(if dark { dark_rgb } else { light_rgb }))
            })
            .collect()
    }
}

/// A colour as CSS and SVG write it, in capitals as the plotting library does.
#[must_use]
pub fn hex([red, green, blue]: [u8; 3]) -> String {
    format!("#{red:02X}{green:02X}{blue:02X}")
}

#[cfg(test)]
mod tests {
    use super::Ink;

    /// Relative luminance and contrast after WCAG 2.2.
    fn contrast(a: [u8; 3], b: [u8; 3]) -> f64 {
        let channel = |value: u8| {
            let share = f64::from(value) / 255.0;
            if share <= 0.04045 { share / 12.92 } else { ((share + 0.055) / 1.055).powf(2.4) }
        };
        let luminance = |c: [u8; 3]| 0.2126 * channel(c[0]) + 0.7152 * channel(c[1]) + 0.0722 * channel(c[2]);
        let (a, b) = (luminance(a), luminance(b));
        (a.max(b) + 0.05) / (a.min(b) + 0.05)
    }

    #[test]
    fn no_two_roles_share_a_light_colour() {
        for (i, one) in Ink::ALL.iter().enumerate() {
            assert!(Ink::ALL[..i].iter().all(|other| other.rgb() != one.rgb()), "{one:?}");
        }
    }

    #[test]
    fn words_and_curves_stand_off_the_paper() {
        for ink in Ink::ALL {
            let least = match ink {
                Ink::Text | Ink::Muted | Ink::Alarm => 4.5,
                Ink::Paper | Ink::Grid => continue,
                // Drawn thick, and named in the legend.
                Ink::Measured => 2.0,
                _ => 3.0,
            };
            let (_, light, dark) = ink.sheet();
            let (_, light_paper, dark_paper) = Ink::Paper.sheet();
            assert!(contrast(light, light_paper) >= least, "{ink:?} on light: {}", contrast(light, light_paper));
            assert!(contrast(dark, dark_paper) >= least, "{ink:?} on dark: {}", contrast(dark, dark_paper));
        }
    }
}
