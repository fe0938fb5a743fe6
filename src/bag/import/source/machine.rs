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
    last: String,
    changes: u64,
    rows: u64,
}

/// A name in one spelling of all: `U03` is `u3`.
fn one_spelling(text: &str) -> (String, &str) {
    let digits = text.trim_start_matches(|letter: char| !letter.is_ascii_digit());
    (text[..text.len() - digits.len()].to_lowercase(), digits.trim_start_matches('0'))
}

impl MachineLook {
    pub(super) fn take(&mut self, text: &str) {
        // So many are no machines, whatever comes.
        if self.found.len() >= MOST {
            return;
        }
        let text = text.trim();
        self.rows += 1;
        if text != self.last && one_spelling(text) != one_spelling(&self.last) {
            self.changes += 1;
            text.clone_into(&mut self.last);
        }
        let as_written = self.found.iter().position(|(known, _)| known == text);
        let place =
            as_written.or_else(|| self.found.iter().position(|(known, _)| one_spelling(known) == one_spelling(text)));
        match place {
            Some(place) => self.found[place].1 += 1,
            None => self.found.push((text.to_owned(), 1)),
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
        if all { self.listed() } else { None }
    }

    /// The same in a column of numbers, where a bare number may be of anything: machines have letters before it.
    pub(super) fn several_with_letters(&self) -> Option<String> {
        let has_letter = |(text, _): &(String, u64)| text.starts_with(char::is_alphabetic);
        self.several().filter(|_| self.found.iter().all(has_letter))
    }

    /// Numbers or words by turns, where there are several: a count never comes back, and a state lasts.
    pub(super) fn by_turns(&self) -> Option<String> {
        let is_one = |text: &str| {
            text.starts_with(char::is_alphabetic) || (text.len() < 4 && text.bytes().all(|byte| byte.is_ascii_digit()))
        };
        let all = self.found.iter().all(|(text, count)| !text.is_empty() && is_one(text) && *count >= FEWEST_ROWS);
        if all && self.changes * 4 >= self.rows { self.listed() } else { None }
    }

    fn listed(&self) -> Option<String> {
        // `A` beside `B` is no ampere.
        let units = self.found.iter().all(|(text, _)| is_unit(text));
        let several = (2..MOST).contains(&self.found.len()) && !units;
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
        for texts in [["U3", "u3"], ["3", "03"], ["MS 1", "ms 01"]] {
            assert_eq!(several(&texts, 20), None, "{texts:?}");
        }
        assert_eq!(several(&["U3", "U30"], 20).as_deref(), Some("`U3`, `U30`"));
    }

    #[test]
    fn what_comes_by_turns_is_no_count_and_no_state() {
        let by_turns = |texts: &[&str], rows: usize| {
            let mut look = MachineLook::default();
            texts.iter().cycle().take(texts.len() * rows).for_each(|text| look.take(text));
            look.by_turns()
        };
        assert_eq!(by_turns(&["0", "1"], 20).as_deref(), Some("`0`, `1`"));
        assert_eq!(by_turns(&["nord", "süd", "nord", "süd", "west"], 20).as_deref(), Some("`nord`, `süd`, `west`"));
        let count: Vec<String> = (1..100).map(|k: u32| k.to_string()).collect();
        let states = [["run"; 9], ["stop"; 9]].concat();
        for texts in
            [&count.iter().map(String::as_str).collect::<Vec<_>>()[..], &states, &["1"], &["%", "bar"], &["0.5", "0.7"]]
        {
            assert_eq!(by_turns(texts, 20), None, "{texts:?}");
        }
    }
}
