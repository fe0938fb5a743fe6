//! The laboratory's wall: what makes, scores and compares units with known faults is used by nothing that a user's unit needs.

use crate::source::Source;

/// Its modules of the library; all of them stand behind the cargo feature `lab`.
const ROOMS: [&str; 6] = ["baselines", "battery", "benchmark", "comparison", "params::labels", "report::comparison"];

/// Its commands, with what they share.
const COMMANDS: [&str; 6] = ["blind", "calibrate", "compare", "learn", "scored_report", "train"];

/// Files outside the laboratory that name one of its modules; unit tests may.
pub fn leaks(sources: &[Source]) -> Vec<String> {
    let rooms: Vec<String> = ROOMS.iter().map(|room| format!("src/{}", room.replace("::", "/"))).collect();
    let commands: Vec<String> = COMMANDS.iter().map(|command| format!("src/commands/{command}")).collect();
    let is_inside = |path: &str| {
        let stem = path.strip_suffix(".rs").unwrap_or(path);
        rooms.iter().chain(&commands).any(|room| stem == room || stem.starts_with(&format!("{room}/")))
    };
    let mut leaks = Vec::new();
    for source in sources.iter().filter(|source| source.path.starts_with("src/") && !is_inside(&source.path)) {
        for (number, line) in source.code() {
            for room in ROOMS.iter().filter(|room| names(line, room)) {
                leaks.push(format!("{}:{number}: uses the laboratory's `{room}`", source.path));
            }
        }
    }
    leaks
}

/// Whether a line of code names a module by its path: alone, or first of a group.
fn names(line: &str, room: &str) -> bool {
    let is_word = |c: char| c.is_alphanumeric() || c == '_';
    let (outer, inner) = room.rsplit_once("::").map_or(("", room), |(outer, inner)| (outer, inner));
    ["crate::", "govtwin::"].into_iter().any(|root| {
        let root = if outer.is_empty() { root.to_owned() } else { format!("{root}{outer}::") };
        line.match_indices(&root).any(|(at, _)| {
            let rest = &line[at + root.len()..];
            let group = rest.strip_prefix('{').and_then(|rest| rest.split('}').next()).unwrap_or(rest);
            let members = group.split(',').take(if rest.starts_with('{') { usize::MAX } else { 1 });
            members.map(|member| member.trim().split(|c| !is_word(c)).next()).any(|name| name == Some(inner))
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_use_of_the_laboratory_is_seen() {
        let of = |path: &str, code: &str| leaks(&[Source::new(path, code)]).len();
        for code in [
            "use crate::battery::Label;",
            "use crate::{benchmark, frame};",
            "use crate::params::{self, labels};",
            "let x = crate::report::comparison::page(y);",
        ] {
            assert_eq!(of("src/diagnosis/model/search.rs", code), 1, "{code}");
            assert_eq!(of("src/benchmark/score.rs", code), 0, "{code}");
        }
        assert_eq!(of("src/commands/diagnose.rs", "use govtwin_lab::benchmark::scored::ScoredUnit;"), 1);
        assert_eq!(of("src/commands/blind/cases.rs", "use govtwin_lab::benchmark::scored::ScoredUnit;"), 0);
        for code in ["use crate::report::comparison_table;", "use crate::benchmarks;", "/// [`crate::battery`]"] {
            assert_eq!(of("src/estimation/fit.rs", code), 0, "{code}");
        }
        let in_tests =
            "use crate::units;\n#[cfg(all(test, feature = \"lab\"))]\nmod tests {\n    use crate::battery;\n}\n";
        assert_eq!(of("src/estimation/fit.rs", in_tests), 0);
    }
}
