//! Colours by role: one meaning keeps one colour in every picture, in light and in dark.
//!
//! The hues are those of Okabe and Ito 2008, "Color Universal Design", which stay apart for every
//! common kind of colour blindness; some are darkened or lightened to stand off their background.

/// Declares the roles: the name of each one's CSS variable without the dashes, and its colours on light and on dark paper.
macro_rules! inks {
    ($($(#[$doc:meta])+ $ink:ident = $name:literal, $light:literal, $dark:literal;)+) => {
        /// The meaning of a colour.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub enum Ink {
            $($(#[$doc])+ $ink,)+
        }

        impl Ink {
            const ALL: &[Self] = &[$(Self::$ink,)+];

            const fn sheet(self) -> (&'static str, u32, u32) {
                match self {
                    $(Self::$ink => ($name, $light, $dark),)+
                }
            }
        }
    };
}

inks! {
    /// Words and outlines.
    Text = "ink-text", 0x1A_1D_21, 0xE8_EA_ED;
    /// Axis labels and lesser words.
    Muted = "ink-muted", 0x5A_62_6B, 0xA3_AB_B5;
    /// Grid lines and frames.
    Grid = "ink-grid", 0xE1_E4_E8, 0x36_3B_42;
    /// The background.
    Paper = "ink-paper", 0xFF_FF_FE, 0x16_18_1C;
    /// What was commanded.
    Command = "ink-command", 0x8A_90_98, 0x8B_93_9C;
    /// What was measured.
    Measured = "ink-measured", 0xE6_9F_00, 0xE6_9F_01;
    /// Simulated by the twin.
    Simulated = "ink-simulated", 0x00_5F_9E, 0x6C_C4_F5;
    /// Simulated minus measured.
    Difference = "ink-difference", 0x9C_3F_7B, 0xE0_93_BD;
    /// Noise floors, intervals, tolerances.
    Band = "ink-band", 0x7F_88_92, 0x9A_A3_AD;
    /// Trips, alarms, errors.
    Alarm = "ink-alarm", 0xC2_4E_00, 0xFF_8A_4A;
    /// What is right.
    Good = "ink-good", 0x00_86_62, 0x2B_C4_9A;
    /// Further series, for comparisons: a further model, a further candidate.
    Extra1 = "ink-extra1", 0xB0_56_89, 0xCC_79_A7;
    /// See [`Ink::Extra1`].
    Extra2 = "ink-extra2", 0x3D_9B_D1, 0x56_B4_E8;
    /// See [`Ink::Extra1`].
    Extra3 = "ink-extra3", 0x8C_82_00, 0xF0_E4_42;
}

impl Ink {
    /// Colours for series that have no role of their own, in the order to take them.
    pub const SERIES: [Self; 6] =
        [Self::Simulated, Self::Measured, Self::Good, Self::Extra1, Self::Extra2, Self::Extra3];

    /// The CSS value: a variable that the page sets, with the light colour where no page does.
    pub(crate) fn css(self) -> String {
        let (name, light, _) = self.sheet();
        format!("var(--{name},#{light:06X})")
    }

    /// The declarations of all variables, for light or for dark paper.
    pub(crate) fn declarations(dark: bool) -> String {
        let of = |ink: &Self| {
            let (name, light, dark_one) = ink.sheet();
            format!("--{name}:#{:06X};", if dark { dark_one } else { light })
        };
        Self::ALL.iter().map(of).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::Ink;

    /// Relative luminance and contrast after WCAG 2.2.
    fn contrast(a: u32, b: u32) -> f64 {
        let channel = |value: u32| {
            let share = f64::from(value & 0xFF) / 255.0;
            if share <= 0.04045 { share / 12.92 } else { ((share + 0.055) / 1.055).powf(2.4) }
        };
        let luminance = |c: u32| 0.2126 * channel(c >> 16) + 0.7152 * channel(c >> 8) + 0.0722 * channel(c);
        let (a, b) = (luminance(a), luminance(b));
        (a.max(b) + 0.05) / (a.min(b) + 0.05)
    }

    #[test]
    fn no_two_roles_share_a_light_colour() {
        for (i, one) in Ink::ALL.iter().enumerate() {
            assert!(Ink::ALL[..i].iter().all(|other| other.sheet().1 != one.sheet().1), "{one:?}");
        }
    }

    #[test]
    fn words_and_curves_stand_off_the_paper() {
        for &ink in Ink::ALL {
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
