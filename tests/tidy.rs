//! The rules of the house that compiler and linter do not know, held as tests.
//!
//! Every rule takes sources and returns what breaks it, so that each is tried on a breach of its own as well.

#[path = "tidy/names.rs"]
mod names;
#[path = "tidy/source.rs"]
mod source;
#[path = "tidy/text.rs"]
mod text;
#[path = "tidy/words.rs"]
mod words;

use source::{Source, tree};

/// Fails with every breach, one a line.
fn hold(breaches: &[String]) {
    assert!(breaches.is_empty(), "{} breaches:\n{}", breaches.len(), breaches.join("\n"));
}

/// The Rust sources below the folders `src`, `tests` and `benches`.
fn rust() -> Vec<Source> {
    tree().into_iter().filter(|source| source.path.ends_with(".rs")).collect()
}

#[test]
fn words_that_are_gone_stay_away() {
    hold(&words::gone(&tree()));
}

#[test]
fn pure_rooms_do_not_reach_out() {
    hold(&text::reach(&rust()));
}

#[test]
fn the_readme_names_every_command() {
    let text = |path: &str| tree().into_iter().find(|source| source.path == path).expect("the file is there").text;
    hold(&text::unnamed_commands(&text("src/cli.rs"), &text("README.md")));
}

#[test]
fn quantities_carry_their_units_in_their_names() {
    hold(&names::field_breaches(&rust()));
    hold(&names::entry_breaches());
}

#[test]
fn every_file_says_what_it_is_for() {
    hold(&text::heads(&rust()));
}

#[test]
fn files_stay_short() {
    hold(&text::lengths(&rust()));
}

#[test]
fn nothing_names_a_machine_or_a_registry() {
    hold(&text::places(&tree()));
}
