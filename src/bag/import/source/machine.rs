//! What a column that may say of which machine a row is holds.

use crate::import::convert::is_unit;

/// More different texts are no machines.
const MOST: usize = 9;
/// Rows of one machine, at least.
const FEWEST_ROWS: u64 = 10;

/// Texts of the column, and how often.
#[derive(Clone, Debug, Default)]
pub(super) struct MachineLook {
    found: Vec<(String, u64)>,
}

impl MachineLook {
    pub(super) fn take(&mut self, text: &str) {
        let text = text.trim();
        if let Some((_, count)) = self.found.iter_mut().find(|(known, _)| known == text) {
            *count += 1;
        } else if self.found.len() < MOST {
            self.found.push((text.to_owned(), 1));
        }
    }

    /// The machines, where there are several; states and units of measure are none, and neither are numbers that begin at 0.
    pub(super) fn several(&self) -> Option<String> {
        let numbered = |text: &str| {
            let number = text.trim_start_matches(|letter: char| letter.is_alphabetic() || " _-#".contains(letter));
            !number.is_empty() && number.len() < 4 && number.bytes().all(|byte| byte.is_ascii_digit()) && number != "0"
        };
        // Names of plants and machines have as many rows each.
        let most = self.found.iter().map(|(_, count)| *count).max().unwrap_or(0);
        let named = |text: &str, count: u64| {
            text.chars().next().is_some_and(char::is_uppercase)
                && (text.chars().any(char::is_lowercase) || text.chars().count() == 1)
                && count * 10 > most * 9
        };
        let is_machine = |text: &str, count: u64| numbered(text) || named(text, count);
        let all = self.found.iter().all(|(text, count)| is_machine(text, *count) && *count >= FEWEST_ROWS);
        // `A` beside `B` is no ampere.
        let units = self.found.iter().all(|(text, _)| is_unit(text));
        let several = (2..MOST).contains(&self.found.len()) && all && !units;
        several.then(|| self.found.iter().map(|(text, _)| format!("`{text}`")).collect::<Vec<_>>().join(", "))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn machines_have_numbers_and_rows() {
        let several = |texts: &[&str], rows: usize| {
            let mut look = MachineLook::default();
            texts.iter().cycle().take(texts.len() * rows).for_each(|text| look.take(text));
            look.several()
        };
        assert_eq!(several(&["U3", "U5"], 20).as_deref(), Some("`U3`, `U5`"));
        assert_eq!(several(&["1", "2", "3"], 20).as_deref(), Some("`1`, `2`, `3`"));
        assert_eq!(several(&["A", "B"], 20).as_deref(), Some("`A`, `B`"));
        assert_eq!(several(&["Ybbs", "Melk"], 20).as_deref(), Some("`Ybbs`, `Melk`"));
        for texts in [&["U3"][..], &["%", "bar"], &["0", "1"], &["RUN", "STOP"], &["63.4", "63.5"]] {
            assert_eq!(several(texts, 20), None, "{texts:?}");
        }
        assert_eq!(several(&["U3", "U5"], 5), None);
    }
}
