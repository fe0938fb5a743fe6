//! Slips on the command line: an error of their own, since their exit code is one.

use govtwin_model::params::nearest;

/// A slip in how the program was called, which no other file could mend: exit code 2.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct Usage(String);

/// An error for a slip on the command line.
pub fn usage(words: impl Into<String>) -> anyhow::Error {
    Usage(words.into()).into()
}

/// An error for a name that is none: the one that may be meant, or the command that lists them.
pub fn unknown<'a>(slip: &str, name: &str, known: impl Iterator<Item = &'a str>, lists: &str) -> anyhow::Error {
    let near = nearest(name, known).map(|near| format!("did you mean `{near}`?"));
    usage(format!("{slip}; {}", near.unwrap_or_else(|| format!("`{lists}` lists them"))))
}

/// An error for a slip on the command line, unless `is_right`.
pub fn expect(is_right: bool, words: impl FnOnce() -> String) -> anyhow::Result<()> {
    if is_right { Ok(()) } else { Err(usage(words())) }
}

/// Reads a number of the command line; who writes a unit behind it is told that the option has one.
pub fn number(text: &str) -> Result<f64, String> {
    text.trim().parse().map_err(|_| {
        let end = text.rfind(|c: char| c.is_ascii_digit()).map_or(0, |last| last + 1);
        match text.get(..end).filter(|number| number.parse::<f64>().is_ok()) {
            // What another unit is worth in that of the option is not guessed.
            Some(number) => match text[end..].trim() {
                unit if unit.eq_ignore_ascii_case("hz") || unit.eq_ignore_ascii_case("s") => {
                    format!("expected a number, without its unit: `{number}`")
                }
                unit => format!("expected a number in the unit of the option, found `{unit}` behind it"),
            },
            None => "expected a number, such as 100 or 0.5".to_owned(),
        }
    })
}
