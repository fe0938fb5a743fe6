//! The floors of the house: who may use whom, and that ARCHITECTURE.md draws it so.

use std::collections::{BTreeMap, BTreeSet};

use crate::source::Source;

/// The floors from the top, each with its modules.
const FLOORS: &[(&str, &[&str])] = &[
    ("entry", &["main", "cli", "commands"]),
    ("edges", &["bag", "files", "import", "msg", "node", "params", "store"]),
    (
        "judgement",
        &[
            "acceptance",
            "baselines",
            "battery",
            "benchmark",
            "comparison",
            "diagnosis",
            "estimation",
            "fleet",
            "generate",
            "identification",
            "likelihood",
            "metrics",
            "replay",
            "report",
            "sheet",
            "stage_alone",
            "trend",
            "watch",
        ],
    ),
    ("heart", &["twin"]),
    ("corrections", &["effects", "residual"]),
    ("physics", &["plant", "solver"]),
    ("words", &["digest", "frame", "parameters", "provenance", "recording", "signal", "state", "stored", "units"]),
];

/// How far from the top a module's floor lies.
fn depth(module: &str) -> Option<usize> {
    FLOORS.iter().position(|(_, modules)| modules.contains(&module))
}

/// Whether a file stands below the edges, where nothing reaches outside the process.
pub fn below_edges(path: &str) -> bool {
    module_of(path).and_then(depth).is_some_and(|depth| FLOORS[depth].0 != "entry" && FLOORS[depth].0 != "edges")
}

/// Uses of a higher floor, and circles on one floor. Unit tests may stand on any floor.
pub fn breaches(sources: &[Source]) -> Vec<String> {
    let mut breaches = Vec::new();
    let mut uses: BTreeMap<&str, BTreeSet<&str>> = BTreeMap::new();
    for source in sources {
        let Some(module) = module_of(&source.path) else { continue };
        let Some(own) = depth(module) else { continue };
        for (line, used) in used_modules(source) {
            match depth(used) {
                _ if used == module => {}
                Some(other) if other < own => breaches.push(format!(
                    "{}:{line}: `{module}` ({}) uses `{used}` ({}), a higher floor",
                    source.path, FLOORS[own].0, FLOORS[other].0
                )),
                Some(other) if other == own => drop(uses.entry(module).or_default().insert(used)),
                _ => {}
            }
        }
    }
    for module in uses.keys() {
        if reaches(&uses, module, module, &mut BTreeSet::new()) {
            breaches.push(format!("`{module}` uses itself through other modules of its floor"));
        }
    }
    breaches
}

fn reaches<'a>(
    uses: &BTreeMap<&'a str, BTreeSet<&'a str>>,
    from: &str,
    to: &str,
    seen: &mut BTreeSet<&'a str>,
) -> bool {
    uses.get(from).into_iter().flatten().any(|&next| next == to || (seen.insert(next) && reaches(uses, next, to, seen)))
}

/// The module of the top level that a file belongs to.
fn module_of(path: &str) -> Option<&str> {
    let inner = path.strip_prefix("src/")?;
    let name = inner.split(['/', '.']).next()?;
    (name != "lib").then_some(name)
}

/// Modules of the top level that a file names, with the line.
fn used_modules(source: &Source) -> Vec<(usize, &str)> {
    let mut found = Vec::new();
    let is_name = |c: char| c.is_alphanumeric() || c == '_';
    for (line, code) in source.code() {
        for root in ["crate::", "govtwin::"] {
            for (at, _) in code.match_indices(root) {
                let before = code[..at].chars().next_back();
                if before.is_some_and(|c| is_name(c) || c == '$') {
                    continue;
                }
                let rest = &code[at + root.len()..];
                // `crate::{a::b, c}` names several; rustfmt breaks long ones over lines only below a module.
                let names = rest.strip_prefix('{').map_or_else(|| vec![rest], |group| group.split(',').collect());
                found.extend(names.into_iter().filter_map(|name| {
                    let name = name.trim_start().split(|c| !is_name(c)).next()?;
                    (!name.is_empty()).then_some((line, name))
                }));
            }
        }
    }
    found
}

/// Differences between the floors enforced here and the table in ARCHITECTURE.md.
pub fn map_breaches(map: &str) -> Vec<String> {
    let drawn: Vec<(String, Vec<String>)> = map
        .lines()
        .skip_while(|line| !line.starts_with("| floor |"))
        .skip(2)
        .take_while(|line| line.starts_with('|'))
        .map(|line| {
            let cells: Vec<&str> = line.split('|').map(str::trim).collect();
            let modules = cells[2].split(',').map(|module| module.trim().trim_matches('`').to_owned()).collect();
            (cells[1].to_owned(), modules)
        })
        .collect();
    let held: Vec<(String, Vec<String>)> = FLOORS
        .iter()
        .map(|(floor, modules)| ((*floor).to_owned(), modules.iter().map(|module| (*module).to_owned()).collect()))
        .collect();
    if drawn == held { vec![] } else { vec![format!("ARCHITECTURE.md draws {drawn:?}\nheld is {held:?}")] }
}

/// Modules without a floor, and floors with modules that do not exist.
pub fn module_breaches(sources: &[Source]) -> Vec<String> {
    let there: BTreeSet<&str> = sources.iter().filter_map(|source| module_of(&source.path)).collect();
    let drawn: BTreeSet<&str> = FLOORS.iter().flat_map(|(_, modules)| modules.iter().copied()).collect();
    let homeless = there.difference(&drawn).map(|module| format!("`{module}` stands on no floor; add it to the table"));
    let missing = drawn.difference(&there).map(|module| format!("`{module}` is on a floor but not in src/"));
    homeless.chain(missing).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_use_upwards_is_seen() {
        for code in ["use crate::bag::Reader;", "let x = crate::params::load(p);", "use crate::{frame::Frame, report};"]
        {
            assert_eq!(breaches(&[Source::new("src/twin.rs", code)]).len(), 1, "{code}");
        }
        for code in ["use crate::frame::Frame;", "// crate::bag", "//! [`crate::bag`]", "use other_crate::bag;"] {
            assert_eq!(breaches(&[Source::new("src/twin/a.rs", code)]), Vec::<String>::new(), "{code}");
        }
        let in_tests = "use crate::frame::Frame;\n#[cfg(test)]\nmod tests {\n    use crate::params;\n}\n";
        assert_eq!(breaches(&[Source::new("src/twin.rs", in_tests)]), Vec::<String>::new());
    }

    #[test]
    fn a_circle_on_one_floor_is_seen() {
        let circle = [
            Source::new("src/bag.rs", "use crate::msg::Time;"),
            Source::new("src/msg.rs", "use crate::files::write;"),
            Source::new("src/files.rs", "use crate::bag::Reader;"),
        ];
        assert_eq!(breaches(&circle).len(), 3);
        assert_eq!(breaches(&circle[..2]), Vec::<String>::new());
    }

    #[test]
    fn a_map_that_differs_is_seen() {
        let row = |(floor, modules): &(&str, &[&str])| {
            let modules: Vec<String> = modules.iter().map(|module| format!("`{module}`")).collect();
            format!("| {floor} | {} | words |\n", modules.join(", "))
        };
        let rows: Vec<String> = FLOORS.iter().map(row).collect();
        let head = "# Map\n\n| floor | modules | what |\n|---|---|---|\n";
        assert_eq!(map_breaches(&format!("{head}{}\nmore", rows.concat())), Vec::<String>::new());
        assert_eq!(map_breaches(&format!("{head}{}", rows[1..].concat())).len(), 1);
        assert_eq!(map_breaches("").len(), 1);
    }

    #[test]
    fn a_module_without_a_floor_is_seen() {
        let breaches = module_breaches(&[Source::new("src/attic.rs", "")]);
        assert!(breaches[0].contains("`attic` stands on no floor"));
        assert!(breaches.iter().any(|breach| breach.contains("`twin` is on a floor but not in src/")));
    }
}
