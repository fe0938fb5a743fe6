//! Circles among files: what uses a file stands above it, so that a reader meets each file once.

use std::collections::{BTreeMap, BTreeSet};

use crate::source::Source;

/// Files that use each other, each circle once. A file and those of its own folder are one room: they may.
pub fn circles(sources: &[Source]) -> Vec<String> {
    let names: BTreeSet<String> = sources.iter().filter_map(|source| name_of(&source.path)).collect();
    let uses: BTreeMap<String, BTreeSet<String>> = sources
        .iter()
        .filter_map(|source| Some((name_of(&source.path)?, used_by(source, &names))))
        .map(|(own, used)| (own.clone(), used.into_iter().filter(|used| !is_same_room(&own, used)).collect()))
        .collect();
    of(&uses).into_iter().map(|circle| format!("files use each other: {}", circle.join(", "))).collect()
}

/// Rooms of the diagnosis that use each other: a file with its folder is one.
pub fn rooms(sources: &[Source]) -> Vec<String> {
    let names: BTreeSet<String> = sources.iter().filter_map(|source| name_of(&source.path)).collect();
    let room = |name: &str| {
        let mut parts = name.split("::");
        (parts.next() == Some("diagnosis")).then(|| parts.next().map(str::to_owned)).flatten()
    };
    let mut uses: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
    for source in sources {
        let Some(own) = name_of(&source.path).as_deref().and_then(room) else { continue };
        let used: BTreeSet<String> = used_by(source, &names).iter().filter_map(|used| room(used)).collect();
        uses.entry(own.clone()).or_default().extend(used.into_iter().filter(|used| *used != own));
    }
    of(&uses).into_iter().map(|circle| format!("rooms use each other: {}", circle.join(", "))).collect()
}

/// Those that use each other, each circle once.
fn of(uses: &BTreeMap<String, BTreeSet<String>>) -> BTreeSet<Vec<&str>> {
    let reached: BTreeMap<&str, BTreeSet<&str>> =
        uses.keys().map(|from| (from.as_str(), all_from(uses, from))).collect();
    let mut circles: BTreeSet<Vec<&str>> = BTreeSet::new();
    for (from, all) in &reached {
        let circle: Vec<&str> = all.iter().copied().filter(|to| reached[to].contains(from)).collect();
        if !circle.is_empty() {
            circles.insert(circle);
        }
    }
    circles
}

/// All that is used from a file on, step by step.
fn all_from<'a>(uses: &'a BTreeMap<String, BTreeSet<String>>, from: &str) -> BTreeSet<&'a str> {
    let mut seen = BTreeSet::new();
    let mut open: Vec<&'a String> = uses.get(from).into_iter().flatten().collect();
    while let Some(next) = open.pop() {
        if seen.insert(next.as_str()) {
            open.extend(uses.get(next).into_iter().flatten());
        }
    }
    seen
}

/// The module that a file holds, such as `diagnosis::evidence`.
fn name_of(path: &str) -> Option<String> {
    let name = path.strip_prefix("src/")?.strip_suffix(".rs")?.replace('/', "::");
    (!matches!(name.as_str(), "lib" | "main")).then_some(name)
}

/// Whether one is the other's folder.
fn is_same_room(one: &str, other: &str) -> bool {
    let holds = |outer: &str, inner: &str| inner.strip_prefix(outer).is_some_and(|rest| rest.starts_with("::"));
    holds(one, other) || holds(other, one)
}

/// Files that a file names by a path from the crate or from the module above.
fn used_by(source: &Source, names: &BTreeSet<String>) -> BTreeSet<String> {
    let own = name_of(&source.path).unwrap_or_default();
    let above = own.rsplit_once("::").map_or("", |(above, _)| above);
    let code: String = source.code().map(|(_, line)| line.trim()).collect::<Vec<_>>().join(" ");
    let is_path = |c: char| c.is_alphanumeric() || c == '_' || c == ':';
    let mut used = BTreeSet::new();
    for (root, prefix) in [("crate::", String::new()), ("super::", format!("{above}::"))] {
        for (at, _) in code.match_indices(root) {
            if code[..at].chars().next_back().is_some_and(is_path) {
                continue;
            }
            let rest = &code[at + root.len()..];
            let path: String = rest.chars().take_while(|c| is_path(*c)).collect();
            let members = rest[path.len()..].strip_prefix('{').and_then(|group| group.split('}').next()).unwrap_or("");
            // A group names its members, alone a path names itself.
            for member in members.split(',') {
                let whole = format!("{prefix}{path}{}", member.trim());
                used.extend(file_of(&whole, names).filter(|file| *file != own));
            }
        }
    }
    used
}

/// The file in which a path ends: its longest beginning that is one.
fn file_of(path: &str, names: &BTreeSet<String>) -> Option<String> {
    let mut path = path.trim_end_matches(':').trim_start_matches(':');
    loop {
        if names.contains(path) {
            return Some(path.to_owned());
        }
        path = path.rsplit_once("::")?.0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_circle_among_files_is_seen_once() {
        let circle = [
            Source::new("src/estimation/fit.rs", "use crate::estimation::{linear::normal, free_parameter};"),
            Source::new("src/estimation/linear.rs", "use super::noise::Noise;"),
            Source::new("src/estimation/noise.rs", "let x = crate::estimation::fit::prior();"),
            Source::new("src/estimation/prior.rs", "use crate::units;"),
        ];
        assert_eq!(circles(&circle), ["files use each other: estimation::fit, estimation::linear, estimation::noise"]);
        assert_eq!(circles(&circle[..2]), Vec::<String>::new());
        // A facade and what stands behind it.
        let room = [
            Source::new("src/solver.rs", "use crate::solver::rk4::Rk4;"),
            Source::new("src/solver/rk4.rs", "use crate::solver::Method;"),
        ];
        assert_eq!(circles(&room), Vec::<String>::new());
    }

    #[test]
    fn rooms_that_use_each_other_are_seen_whatever_files_do_it() {
        let rooms_of = |code: &str| {
            rooms(&[
                Source::new("src/diagnosis/evidence.rs", "use crate::diagnosis::model::Model;"),
                Source::new("src/diagnosis/model.rs", "pub struct Model;"),
                Source::new("src/diagnosis/model/support.rs", code),
                Source::new("src/diagnosis/evidence/law_error.rs", "pub const ERROR: f64 = 0.1;"),
            ])
        };
        assert_eq!(
            rooms_of("use crate::diagnosis::evidence::law_error::ERROR;"),
            ["rooms use each other: evidence, model"]
        );
        assert_eq!(rooms_of("use crate::diagnosis::model::Model;"), Vec::<String>::new());
    }
}
