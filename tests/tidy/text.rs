//! Rules on single files: who knows which library, heads, lengths, imports, layout, places.

use crate::source::Source;

/// Libraries, and the only places that name them.
const KNOWN_BY: &[(&str, &[&str])] = &[
    ("serde_yaml", &["src/params/yaml.rs", "src/bag/metadata.rs", "tests/"]),
    ("csv", &["src/import/csv_file.rs", "src/fleet/units.rs", "src/fleet/table.rs"]),
    ("encoding_rs", &["src/import/csv_file.rs"]),
    ("encoding_rs_io", &["src/import/csv_file.rs"]),
    ("jiff", &["src/import/clock.rs", "src/commands/"]),
    ("object_store", &["src/store/remote.rs"]),
    ("tokio", &["src/store/remote.rs"]),
    ("parquet", &["src/import/parquet_file.rs", "src/fleet/parquet_table.rs", "tests/"]),
    ("sha2", &["src/digest.rs"]),
    ("mcap", &["src/bag/", "src/bag.rs", "tests/", "benches/"]),
    ("ros2_client", &["src/node/", "src/node.rs", "src/msg/", "src/msg.rs"]),
    ("rustdds", &["src/node/", "src/node.rs", "src/msg/", "src/msg.rs"]),
    ("ros2args", &["src/node/", "src/node.rs", "src/commands/"]),
    ("libc", &["src/node/realtime.rs", "tests/faults/trace.rs"]),
    ("rustix", &["src/node/realtime.rs", "src/files/rename.rs", "src/commands/parent.rs", "benches/", "tests/fuzz.rs"]),
    ("tempfile", &["src/files/", "src/store/", "src/commands/", "tests/", "benches/", "fuzz/"]),
    ("signal_hook", &["src/node/", "src/node.rs", "src/commands/"]),
    ("lightgbm3", &["src/residual/booster.rs", "src/residual/booster/"]),
    ("egobox_gp", &["src/residual/search.rs"]),
    ("candle_core", &["src/residual/deep.rs"]),
    ("candle_nn", &["src/residual/deep.rs"]),
    ("linfa", &["src/residual/search.rs"]),
    ("pulp", &["src/plant/lanes.rs"]),
    ("plotters", &["src/report/", "src/report.rs"]),
    ("maud", &["src/report/", "src/report.rs"]),
    ("indicatif", &["src/commands/"]),
    ("anyhow", &["src/cli.rs", "src/commands/", "tests/", "benches/"]),
    ("clap", &["src/cli.rs", "src/commands/"]),
    ("clap_complete", &["src/commands/completions.rs"]),
    ("clap_mangen", &["src/commands/man.rs"]),
    ("terminal_size", &["src/commands/output.rs"]),
];

/// Most lines of code in a source file: blank lines, comments and unit tests are not counted.
const LONGEST_CODE: usize = 300;
/// Most lines of any Rust file, everything counted.
const LONGEST_FILE: usize = 450;

/// Ways to the world outside the process, which only the edges and what stands above them may take.
const WORLD: &[&str] = &["fs", "net", "env", "process", "thread"];

/// Where text goes to a terminal: control characters in it are shown there, and nowhere else. Lines of numbers need none of that.
const VOICES: &[&str] = &["src/commands/output.rs", "src/commands/output/", "src/commands/fit/serve.rs"];

/// Ways to standard output and standard error beside the one place that prints.
pub fn voices(sources: &[Source]) -> Vec<String> {
    let elsewhere =
        |source: &&Source| source.path.starts_with("src/") && !VOICES.iter().any(|place| source.is_at(place));
    let mut breaches = Vec::new();
    for source in sources.iter().filter(elsewhere) {
        for (line, code) in source.code() {
            if ["io::stdout", "io::stderr", "{stdout", "{stderr"].iter().any(|way| code.contains(way)) {
                breaches.push(format!("{}:{line}: prints; print through src/commands/output.rs", source.path));
            }
        }
    }
    breaches
}

/// Uses of the world outside the process below the edges, and unsafe code outside its one file.
pub fn reach(sources: &[Source], below_edges: impl Fn(&str) -> bool) -> Vec<String> {
    let mut breaches = Vec::new();
    for source in sources.iter().filter(|source| source.path.starts_with("src/")) {
        for (line, code) in source.code() {
            let at = format!("{}:{line}", source.path);
            let words = || code.split(|c: char| !(c.is_alphanumeric() || c == '_'));
            if words().any(|word| word == "unsafe" || word == "unsafe_code") && source.path != "src/node/realtime.rs" {
                breaches.push(format!("{at}: unsafe code belongs in src/node/realtime.rs"));
            }
            let Some((_, path)) = code.split_once("std::") else { continue };
            let group = path.strip_prefix('{').unwrap_or(path.split("::").next().unwrap_or_default());
            let outside = group.split(',').find_map(|name| {
                let name = name.trim().split(|c: char| !(c.is_alphanumeric() || c == '_')).next().unwrap_or_default();
                WORLD.contains(&name).then(|| name.to_owned())
            });
            if let (Some(name), true) = (outside, below_edges(&source.path)) {
                breaches.push(format!("{at}: `std::{name}` below the edges; let an edge do it"));
            }
        }
    }
    breaches
}

/// Commands of the command line that the README does not name.
pub fn unnamed_commands(cli: &str, readme: &str) -> Vec<String> {
    let named = |command: &str| {
        readme.contains(&format!("`govtwin {command}`")) || readme.contains(&format!("`govtwin {command} "))
    };
    cli.split("(commands::")
        .skip(1)
        .filter_map(|rest| rest.split_once("::Args)").map(|(command, _)| command))
        .filter(|command| !named(command))
        .map(|command| format!("README.md: does not name `govtwin {command}`"))
        .collect()
}

/// Effects whose file is not in the catalogue under its own name.
pub fn unregistered(sources: &[Source], catalogue: &[(&str, &str)]) -> Vec<String> {
    let mut breaches = Vec::new();
    for source in sources.iter().filter(|source| source.text.contains("\npub const SPEC: EffectSpec")) {
        let stem = source.path.rsplit('/').next().and_then(|name| name.strip_suffix(".rs")).unwrap_or_default();
        if !catalogue.iter().any(|(id, text)| *id == stem && *text == source.text) {
            breaches.push(format!("{}: the catalogue holds no effect `{stem}` with this source", source.path));
        }
    }
    breaches
}

/// Files that name a library which is not theirs to know.
pub fn who_knows_what(sources: &[Source]) -> Vec<String> {
    let mut breaches = Vec::new();
    for source in sources {
        for (library, places) in KNOWN_BY.iter().filter(|(_, places)| !places.iter().any(|place| source.is_at(place))) {
            let names = |code: &str| {
                code.match_indices(&format!("{library}::"))
                    .any(|(at, _)| !code[..at].ends_with(|c: char| c.is_alphanumeric() || c == '_' || c == ':'))
                    || code.trim() == format!("use {library};")
            };
            let lines = source.code().filter(|(_, code)| names(code));
            breaches.extend(lines.map(|(line, _)| {
                format!("{}:{line}: names `{library}`, which only {} may know", source.path, places.join(", "))
            }));
        }
    }
    breaches
}

/// Files that do not begin with a sentence on what they are for.
pub fn heads(sources: &[Source]) -> Vec<String> {
    let headless = |source: &&Source| {
        let paragraph: Vec<&str> =
            source.text.lines().map_while(|line| line.strip_prefix("//! ")).map(str::trim).collect();
        let text = paragraph.join(" ");
        !(text.ends_with(['.', ':']) && text.split(' ').count() >= 3)
    };
    let breach = |source: &Source| format!("{}: must begin with `//! ` and a sentence on what it is for", source.path);
    sources.iter().filter(headless).map(breach).collect()
}

/// Files that have grown too long to be one thing.
pub fn lengths(sources: &[Source]) -> Vec<String> {
    let breach = |source: &Source| {
        let code = source.code().filter(|(_, code)| !code.trim().is_empty()).count();
        let all = source.text.lines().count();
        let long = all > LONGEST_FILE || (source.path.starts_with("src/") && code > LONGEST_CODE);
        long.then(|| {
            let limits = format!("{LONGEST_CODE} and {LONGEST_FILE} are the most");
            format!("{}: {code} lines of code, {all} in all; {limits}", source.path)
        })
    };
    sources.iter().filter_map(breach).collect()
}

/// Uses of what is truly in a unit by those who judge it: the scorer alone may know.
pub fn peeks(sources: &[Source]) -> Vec<String> {
    let judges = [
        "src/diagnosis",
        "src/likelihood",
        "src/estimation",
        "src/identification",
        "src/stage_alone",
        "src/baselines",
        "src/commands/diagnose",
    ];
    let truth = ["battery::", "Label", "labels::", "TrueFault"];
    let mut breaches = Vec::new();
    for source in sources.iter().filter(|source| judges.iter().any(|judge| source.path.starts_with(judge))) {
        for (line, code) in source.code() {
            if truth.iter().any(|word| code.contains(word)) {
                breaches.push(format!("{}:{line}: who judges a unit must not know what is in it", source.path));
            }
        }
    }
    breaches
}

/// Imports of everything, outside unit tests.
pub fn globs(sources: &[Source]) -> Vec<String> {
    let breaches = |source: &Source| {
        let lines: Vec<usize> = source
            .code()
            .filter(|(_, code)| {
                code.trim_start().trim_start_matches("pub ").starts_with("use ") && code.contains("::*")
            })
            .map(|(line, _)| line)
            .collect();
        lines
            .into_iter()
            .map(|line| format!("{}:{line}: imports everything; name what is used", source.path))
            .collect::<Vec<_>>()
    };
    sources.iter().flat_map(breaches).collect()
}

/// Files in the other layout for modules.
pub fn layout(sources: &[Source]) -> Vec<String> {
    let old = |source: &&Source| source.path.ends_with("/mod.rs") || source.path.ends_with("prelude.rs");
    sources
        .iter()
        .filter(old)
        .map(|source| format!("{}: modules are `foo.rs` and `foo/`, without prelude", source.path))
        .collect()
}

/// Text that names a place on one machine, or the host of a package registry.
pub fn places(sources: &[Source]) -> Vec<String> {
    // In pieces, so that this list does not find itself.
    let forbidden: Vec<String> = [
        ["/wo", "rk/"],
        ["/ro", "ot/"],
        ["/ho", "me/"],
        ["/Us", "ers/"],
        ["index.crates", ".io"],
        ["static.crates", ".io"],
        ["files.python", "hosted.org"],
        ["pypi", ".org"],
        ["deb.debian", ".org"],
        ["archive.ubuntu", ".com"],
        ["registry.npm", "js.org"],
    ]
    .iter()
    .map(|pieces| pieces.concat())
    .collect();
    let mut breaches = Vec::new();
    for source in sources {
        for (index, line) in source.text.lines().enumerate() {
            if let Some(place) = forbidden.iter().find(|place| line.contains(place.as_str())) {
                breaches.push(format!("{}:{}: names `{place}`", source.path, index + 1));
            }
        }
    }
    breaches
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(path: &str, text: &str) -> [Source; 1] {
        [Source::new(path, text)]
    }

    #[test]
    fn a_library_out_of_place_is_seen() {
        assert_eq!(who_knows_what(&at("src/params/merge.rs", "use serde_yaml::Value;")).len(), 1);
        assert_eq!(who_knows_what(&at("src/twin.rs", "let x = libc::time();")).len(), 1);
        assert_eq!(who_knows_what(&at("src/report.rs", "use mcap;")).len(), 1);
        assert!(who_knows_what(&at("src/params/yaml.rs", "use serde_yaml::Value;")).is_empty());
        assert!(who_knows_what(&at("src/twin.rs", "use crate::mcap::x; // mcap::y\nnot_libc::z();")).is_empty());
    }

    #[test]
    fn a_way_out_below_the_edges_is_seen() {
        let below = |path: &str| path == "src/twin.rs";
        for code in ["use std::fs;", "let x = std::env::var(y);", "use std::{fmt, net};", "use std::thread::spawn;"] {
            assert_eq!(reach(&at("src/twin.rs", code), below).len(), 1, "{code}");
            assert!(reach(&at("src/params.rs", code), below).is_empty(), "{code}");
        }
        assert!(reach(&at("src/twin.rs", "use std::sync::Arc;\nuse std::fmt::Write;\n// std::fs"), below).is_empty());
        assert_eq!(reach(&at("src/bag.rs", "unsafe { x() }"), below).len(), 1);
        assert_eq!(reach(&at("src/bag.rs", "#![allow(unsafe_code)]"), below).len(), 1);
        assert!(reach(&at("src/node/realtime.rs", "unsafe { x() }"), below).is_empty());
    }

    #[test]
    fn a_second_voice_is_seen() {
        assert_eq!(voices(&at("src/commands/run.rs", "let x = std::io::stderr().lock();")).len(), 1);
        assert!(voices(&at("src/commands/output.rs", "let x = io::stdout();")).is_empty());
        assert!(voices(&at("src/commands/blind.rs", "let x = ended.stderr;")).is_empty());
    }

    #[test]
    fn a_command_without_a_word_in_the_readme_is_seen() {
        let cli = "enum Command {\n    Run(commands::run::Args),\n    Dig(commands::dig::Args),\n}\nCommand::Run(args) => commands::run::run(&args)";
        assert_eq!(
            unnamed_commands(cli, "`govtwin run` and `govtwin digest`"),
            ["README.md: does not name `govtwin dig`"]
        );
        assert!(unnamed_commands(cli, "`govtwin run`, `govtwin dig HOLE`").is_empty());
    }

    #[test]
    fn an_effect_outside_the_catalogue_is_seen() {
        let file = at("src/effects/a.rs", "//! A.\n\npub const SPEC: EffectSpec = EffectSpec {};\n");
        assert_eq!(unregistered(&file, &[]).len(), 1);
        assert_eq!(unregistered(&file, &[("b", &file[0].text)]).len(), 1);
        assert_eq!(unregistered(&file, &[("a", "other")]).len(), 1);
        assert!(unregistered(&file, &[("a", &file[0].text)]).is_empty());
    }

    #[test]
    fn a_file_without_head_is_seen() {
        for text in
            ["", "use x;", "//! Two words.", "//! No full stop at all\nuse x;", "// A plain comment is no head."]
        {
            assert_eq!(heads(&at("src/a.rs", text)).len(), 1, "{text}");
        }
        assert!(heads(&at("src/a.rs", "//! What it is for,\n//! over two lines.\n//!\n//! More")).is_empty());
    }

    #[test]
    fn a_long_file_is_seen() {
        let tests = |count| format!("\n#[cfg(test)]\nmod tests {{\n{}}}\n", "    x\n".repeat(count));
        assert_eq!(lengths(&at("src/a.rs", &"x\n".repeat(301))).len(), 1);
        assert_eq!(lengths(&at("src/a.rs", &("x\n".repeat(250) + &tests(200)))).len(), 1);
        assert_eq!(lengths(&at("tests/a.rs", &"x\n".repeat(451))).len(), 1);
        assert!(lengths(&at("src/a.rs", &("x\n".repeat(290) + &"\n// y\n".repeat(30) + &tests(50)))).is_empty());
    }

    #[test]
    fn a_peek_at_the_answers_is_seen() {
        assert_eq!(peeks(&at("src/diagnosis/model/search.rs", "use crate::battery::Label;")).len(), 1);
        assert_eq!(peeks(&at("src/baselines/bank.rs", "let x = labels::read(t);")).len(), 1);
        assert!(peeks(&at("src/benchmark/score.rs", "use crate::battery::Label;")).is_empty());
    }

    #[test]
    fn a_glob_import_is_seen() {
        assert_eq!(globs(&at("src/a.rs", "use crate::frame::*;")).len(), 1);
        assert_eq!(globs(&at("src/a.rs", "pub use frame::{a::*, b};")).len(), 1);
        assert!(globs(&at("src/a.rs", "use x::y;\n#[cfg(test)]\nmod tests {\n    use super::*;\n}\n")).is_empty());
    }

    #[test]
    fn the_other_layout_is_seen() {
        assert_eq!(layout(&at("src/bag/mod.rs", "")).len(), 1);
        assert_eq!(layout(&at("src/prelude.rs", "")).len(), 1);
        assert!(layout(&at("src/bag/model.rs", "")).is_empty());
    }

    #[test]
    fn a_place_on_a_machine_is_seen() {
        assert_eq!(places(&at("README.md", &format!("see {}x/y", "/ho".to_owned() + "me/"))).len(), 1);
        assert_eq!(places(&at("scripts/a", &format!("get {}", "pypi".to_owned() + ".org/x"))).len(), 1);
        assert!(places(&at("README.md", "see https://docs.rs/mcap and ~/bags")).is_empty());
    }
}
