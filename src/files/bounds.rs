//! What a YAML text may hold before a parser sees it: aliases unfold, and brackets nest, beyond what their text lets expect.

/// The most aliases and anchors in a text.
const MOST_ALIASES: usize = 10;

/// A text with aliases is at most so long, bytes: ten of them make at most 40 of it.
const LONGEST_WITH_ALIASES: usize = 1 << 16;

/// The most opening brackets in a text: to parse nested ones takes the parser their number squared.
const MOST_BRACKETS: usize = 10_000;

/// A YAML text that would unfold or nest without measure.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("expected at most {most} {what}, found {found}")]
#[non_exhaustive]
pub struct YamlBoundError {
    /// What there is too much of.
    pub what: &'static str,
    /// How much there may be.
    pub most: usize,
    /// How much there is.
    pub found: usize,
}

/// Refuses a YAML text that would unfold or nest without measure.
///
/// It counts in text and comments, too: a parser that knew better would be the one to be kept from it.
///
/// # Errors
/// On more aliases or brackets than any file of measured values needs.
pub fn check_yaml(text: &str) -> Result<(), YamlBoundError> {
    let aliases = aliases(text);
    if aliases > MOST_ALIASES {
        return Err(YamlBoundError { what: "anchors and aliases (& and *)", most: MOST_ALIASES, found: aliases });
    }
    if aliases > 0 && text.len() > LONGEST_WITH_ALIASES {
        let what = "bytes where there are aliases";
        return Err(YamlBoundError { what, most: LONGEST_WITH_ALIASES, found: text.len() });
    }
    let brackets = text.bytes().filter(|byte| matches!(byte, b'[' | b'{')).count();
    if brackets > MOST_BRACKETS {
        return Err(YamlBoundError { what: "opening brackets", most: MOST_BRACKETS, found: brackets });
    }
    Ok(())
}

/// Positions of `&` or `*` at the beginning of a word, as in an anchor or alias.
fn aliases(text: &str) -> usize {
    let mut before = b' ';
    let mut found = 0;
    let mut bytes = text.bytes().peekable();
    while let Some(byte) = bytes.next() {
        let begins = before.is_ascii_whitespace() || b"[{,:-?!\"'".contains(&before);
        let follows = bytes.peek().is_some_and(|next| !next.is_ascii_whitespace());
        found += usize::from(matches!(byte, b'&' | b'*') && begins && follows);
        before = byte;
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_would_unfold_or_nest_without_measure_is_refused() {
        let bomb: String = (1..30).map(|k| format!("a{k}: &a{k} [*a{0},*a{0}]\n", k - 1)).collect();
        assert!(
            check_yaml(&bomb).unwrap_err().to_string().contains("at most 10 anchors and aliases (& and *), found 87")
        );
        let long = format!("a: &a 1\nb: *a\nc: {}\n", "x".repeat(1 << 16));
        assert!(check_yaml(&long).unwrap_err().to_string().contains("at most 65536 bytes where there are aliases"));
        assert!(
            check_yaml(&"{a: ".repeat(10_001))
                .unwrap_err()
                .to_string()
                .contains("at most 10000 opening brackets, found 10001")
        );
        for sound in ["a: &b {c: 1}\nd: *b\n", "a: 2 * 3 & 4 # rates*times\n", "note: \"R&D, 5 * x\"\n", ""] {
            check_yaml(sound).unwrap();
        }
    }
}
