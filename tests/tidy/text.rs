//! Rules on single files: heads, lengths, commands, places, and what stays at the edges.

use super::source::Source;

/// Most lines of code in a source file: blank lines, comments, imports and unit tests are not counted.
const LONGEST_CODE: usize = 300;
/// Files that are still longer, with their own limit: they want to be cut.
const STILL_LONG: &[(&str, usize)] = &[];
/// Most lines of any Rust file, everything counted.
const LONGEST_FILE: usize = 450;

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
        let mut imports = false;
        let mut is_code = |code: &str| {
            let begins = code.trim_start_matches("pub ").starts_with("use ");
            let counts = !code.trim().is_empty() && !imports && !begins;
            imports = (imports || begins) && !code.ends_with(';');
            counts
        };
        let code = source.code().map(|(_, code)| code).filter(|code| is_code(code)).count();
        let all = source.text.lines().count();
        let own = STILL_LONG.iter().find(|(path, _)| *path == source.path);
        let longest = own.map_or(LONGEST_CODE, |(_, longest)| *longest);
        let long = all > LONGEST_FILE
            || (source.path.starts_with("src/") && !source.path.ends_with("/tests.rs") && code > longest);
        long.then(|| {
            let limits = format!("{LONGEST_CODE} and {LONGEST_FILE} are the most");
            format!("{}: {code} lines of code, {all} in all; {limits}", source.path)
        })
    };
    sources.iter().filter_map(breach).collect()
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

/// Rooms whose results depend on nothing but their arguments.
const PURE: &[&str] = &["src/model/", "src/correction/", "src/diagnosis/", "src/pages/"];

/// Ways to the world outside the process in rooms that know none; a parameter file is read through `govtwin_files`.
pub fn reach(sources: &[Source]) -> Vec<String> {
    let mut breaches = Vec::new();
    for source in sources.iter().filter(|source| PURE.iter().any(|room| source.is_at(room))) {
        for (line, code) in source.code() {
            let outside = ["fs", "net", "env", "process", "thread"].iter().find(|way| {
                code.split(&format!("std::{way}")).skip(1).any(|rest| rest.starts_with([':', ';', ',', ' ']))
            });
            breaches.extend(outside.map(|way| format!("{}:{line}: `std::{way}` in a pure room", source.path)));
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
    fn a_way_out_of_a_pure_room_is_seen() {
        for code in ["use std::fs;", "let x = std::env::var(y);", "use std::thread::spawn;"] {
            assert_eq!(reach(&at("src/model/twin.rs", code)).len(), 1, "{code}");
            assert!(reach(&at("src/bag/read.rs", code)).is_empty(), "{code}");
        }
        assert!(reach(&at("src/model/twin.rs", "use std::sync::Arc;\n// std::fs")).is_empty());
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
    fn a_place_on_a_machine_is_seen() {
        assert_eq!(places(&at("README.md", &format!("see {}x/y", "/ho".to_owned() + "me/"))).len(), 1);
        assert_eq!(places(&at("scripts/a", &format!("get {}", "pypi".to_owned() + ".org/x"))).len(), 1);
        assert!(places(&at("README.md", "see https://docs.rs/mcap and ~/bags")).is_empty());
    }
}
