//! What the program prints about itself, held by snapshots in `tests/snapshots`: the help of every command, and the catalogue of effects.
//! With `GOVTWIN_WRITE_REFERENCE=1` they are written instead of compared.
#![cfg(all(feature = "cli", feature = "node", feature = "residual"))]

use std::path::Path;
use std::process::Command;

use serde_json::Value;

/// What the program prints.
fn printed(arguments: &[&str]) -> String {
    let output = Command::new(env!("CARGO_BIN_EXE_govtwin")).args(arguments).env_remove("COLUMNS").output().unwrap();
    assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

/// Names below "Commands:" in a help text.
fn subcommands(help: &str) -> Vec<String> {
    let below = help.lines().skip_while(|line| *line != "Commands:").skip(1).take_while(|line| !line.is_empty());
    let names = below.filter_map(|line| line.strip_prefix("  ").filter(|rest| !rest.starts_with(' ')));
    names.filter_map(|rest| rest.split_whitespace().next()).filter(|name| *name != "help").map(str::to_owned).collect()
}

fn help_of(path: &[&str], page: &mut String) {
    let help = printed(&[path, &["--help"]].concat());
    let title = [&["govtwin"], path].concat().join(" ");
    *page += &format!("\n## {title}\n```text\n{}\n```\n", help.trim_end());
    for name in subcommands(&help) {
        help_of(&[path, &[name.as_str()]].concat(), page);
    }
}

fn commands() -> String {
    let mut page = "# Commands\nWhat `--help` says of every command, in a build with all that a release has. Written by `tests/reference_pages.rs`.\n"
        .to_owned();
    help_of(&[], &mut page);
    page
}

/// A number as it stands in JSON; nothing where it is unbounded.
fn number(value: &Value) -> String {
    if value.is_null() { String::new() } else { value.to_string() }
}

fn effects() -> String {
    let catalogue: Value = serde_json::from_str(&printed(&["effects", "--json"])).unwrap();
    let mut page = "# Effects\nWhat a real unit may do beyond the nominal model, from the catalogue in `src/effects` (`govtwin effects --json`). Sizes and ranges are those of the reference unit. Written by `tests/reference_pages.rs`.\n"
        .to_owned();
    for effect in catalogue["effects"].as_array().unwrap() {
        let text = |key: &str| effect[key].as_str().unwrap_or_default().to_owned();
        page += &format!("\n## {}\n{}\n\n", text("id"), text("summary"));
        page += &format!("- Stage: {}\n- Equation: {}\n", text("stage").replace('_', " "), text("equation"));
        for symbol in effect["symbols"].as_array().into_iter().flatten() {
            let [name, unit, meaning] =
                ["symbol", "unit", "meaning"].map(|key| symbol[key].as_str().unwrap_or_default());
            page += &format!("- {name} ({unit}): {meaning}\n");
        }
        page += &format!("- Without it: {}\n- Limits: {}\n", text("symptom"), text("limits"));
        page += "\n| parameter | unit | neutral | typical | from | to | meaning |\n|---|---|---|---|---|---|---|\n";
        for parameter in effect["parameters"].as_array().into_iter().flatten() {
            let [name, unit, doc] = ["name", "unit", "doc"].map(|key| parameter[key].as_str().unwrap_or_default());
            let [neutral, typical, min, max] = ["neutral", "typical", "min", "max"].map(|key| number(&parameter[key]));
            let scaling = parameter["proportional_to"]
                .as_str()
                .map_or(String::new(), |words| format!("; sizes on other units in proportion to {words}"));
            page += &format!("| `{name}` | {unit} | {neutral} | {typical} | {min} | {max} | {doc}{scaling} |\n");
        }
    }
    page
}

fn holds(name: &str, page: &str) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/snapshots").join(name);
    if std::env::var_os("GOVTWIN_WRITE_REFERENCE").is_some() {
        std::fs::write(&path, page).unwrap();
        return;
    }
    let there = std::fs::read_to_string(&path).unwrap_or_default();
    let differs = there.lines().zip(page.lines()).position(|(there, here)| there != here);
    assert!(
        there == page,
        "tests/snapshots/{name} is not what the program prints, from line {}; write it anew: \
         GOVTWIN_WRITE_REFERENCE=1 cargo test --features humble,sqlite,residual --test house -- reference_pages::",
        differs.unwrap_or_else(|| there.lines().count().min(page.lines().count())) + 1
    );
}

#[test]
fn the_page_of_commands_is_their_help() {
    let page = commands();
    assert!(page.contains("## govtwin sheet new\n") && page.contains("## govtwin diagnose\n"));
    holds("help.txt", &page);
}

#[test]
fn the_page_of_effects_is_the_catalogue() {
    let page = effects();
    assert!(page.contains("## backlash\n") && page.contains("| `play_pu` | pu |"));
    holds("effects.txt", &page);
}
