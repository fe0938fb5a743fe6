//! The rules of the house that compiler and linter do not know, held as tests.
//!
//! Every rule takes sources and returns what breaks it, so that each is tried on a breach of its own as well.

#[path = "tidy/circles.rs"]
mod circles;
#[path = "tidy/floors.rs"]
mod floors;
#[path = "tidy/laboratory.rs"]
mod laboratory;
#[path = "tidy/licences.rs"]
mod licences;
#[path = "tidy/names.rs"]
mod names;
#[path = "tidy/source.rs"]
mod source;
#[path = "tidy/text.rs"]
mod text;
#[path = "tidy/twins.rs"]
mod twins;
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
fn modules_use_only_lower_floors() {
    hold(&floors::breaches(&rust()));
}

#[test]
fn no_file_uses_what_uses_it() {
    hold(&circles::circles(&rust()));
}

#[test]
fn no_room_of_the_diagnosis_uses_one_that_uses_it() {
    hold(&circles::rooms(&rust()));
}

#[test]
fn nothing_outside_the_laboratory_uses_it() {
    hold(&laboratory::leaks(&rust()));
}

#[test]
fn words_that_are_gone_stay_away() {
    hold(&words::gone(&tree()));
}

#[test]
fn no_two_types_have_one_name() {
    hold(&twins::twins(&rust()));
}

#[test]
fn the_map_is_the_house() {
    let map = tree().into_iter().find(|source| source.path == "ARCHITECTURE.md").expect("ARCHITECTURE.md is there");
    hold(&floors::map_breaches(&map.text));
    hold(&floors::module_breaches(&rust()));
}

#[test]
fn libraries_are_known_only_where_they_belong() {
    hold(&text::who_knows_what(&rust()));
}

#[test]
fn one_place_prints() {
    hold(&text::voices(&rust()));
}

#[test]
fn nothing_below_the_edges_reaches_out() {
    hold(&text::reach(&rust(), floors::below_edges));
}

#[test]
fn the_readme_names_every_command() {
    let text = |path: &str| tree().into_iter().find(|source| source.path == path).expect("the file is there").text;
    hold(&text::unnamed_commands(&text("src/cli.rs"), &text("README.md")));
}

#[test]
fn every_effect_is_in_the_catalogue() {
    let catalogue: Vec<(&str, &str)> =
        govtwin_model::effects::CATALOGUE.iter().map(|spec| (spec.id, spec.source)).collect();
    hold(&text::unregistered(&rust(), &catalogue));
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
fn imports_are_named_and_layout_is_flat() {
    hold(&text::globs(&rust()));
    hold(&text::layout(&rust()));
}

#[test]
fn nothing_names_a_machine_or_a_registry() {
    hold(&text::places(&tree()));
}

#[test]
fn dependencies_are_licensed_and_come_from_the_registry() {
    hold(&licences::breaches());
}

#[test]
fn no_method_of_judging_knows_a_label() {
    hold(&text::peeks(&rust()));
}
