//! Types of one name: what a stranger would take for one thing and is two.

use std::collections::BTreeMap;

use crate::source::Source;

/// What every command calls its own: its arguments, and the commands below it.
const OF_EACH: [&str; 2] = ["Args", "Command"];

/// Names that two types at the level of modules have, whoever can see them. A type inside a function or among the tests that end a file counts
/// only where others see it. Wire types are called as ROS calls them, and what a macro makes, such as the sections of parameters, is called as the
/// block of the plant that it is of: neither counts.
pub fn twins(sources: &[Source]) -> Vec<String> {
    let mut places: BTreeMap<String, Vec<String>> = BTreeMap::new();
    for source in sources {
        let is_ours = source.path.starts_with("src/") && source.path.ends_with(".rs");
        if !is_ours || source.path == "src/msg.rs" || source.path.starts_with("src/msg/") {
            continue;
        }
        let is_of_command = source.path == "src/cli.rs" || source.path.starts_with("src/commands/");
        for (number, line) in source.code() {
            let Some(name) = declared(line) else { continue };
            let places = places.entry(name.to_owned()).or_default();
            if is_of_command && OF_EACH.contains(&name) {
                // All of them count as one.
                if places.iter().all(|place| place != "of each command") {
                    places.push("of each command".to_owned());
                }
            } else {
                places.push(format!("{}:{number}", source.path));
            }
        }
    }
    places.retain(|_, places| places.len() > 1);
    places.into_iter().map(|(name, places)| format!("`{name}` is {}", places.join(" and "))).collect()
}

/// The name of a type that a line declares for its module or for others.
fn declared(line: &str) -> Option<&str> {
    let rest = match line.trim_start().strip_prefix("pub") {
        Some(rest) if rest.starts_with('(') => rest.split_once(')')?.1,
        Some(rest) => rest,
        None if line.starts_with(' ') => return None,
        None => line,
    };
    let (kind, rest) = rest.trim_start().split_once(' ')?;
    let is_type = matches!(kind, "struct" | "enum" | "trait" | "type" | "union");
    is_type
        .then(|| rest.split(|c: char| !c.is_alphanumeric() && c != '_').next())
        .flatten()
        .filter(|name| !name.is_empty())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_types_of_one_name_are_seen() {
        let of = |texts: [(&str, &str); 2]| twins(&texts.map(|(path, text)| Source::new(path, text))).len();
        assert_eq!(of([("src/a.rs", "pub struct Sample {"), ("src/b/c.rs", "    pub(super) enum Sample<T> {")]), 1);
        assert_eq!(of([("src/a.rs", "pub struct Sample {"), ("src/b.rs", "struct Sample {")]), 1);
        assert_eq!(of([("src/a.rs", "type Sample = f64;"), ("src/b.rs", "trait Sample {")]), 1);
        assert_eq!(of([("src/a.rs", "struct Sample {"), ("src/b.rs", "fn f() {\n    struct Sample;\n}")]), 0);
        assert_eq!(
            of([("src/a.rs", "struct Sample {"), ("src/b.rs", "\n#[cfg(test)]\nmod tests {\nstruct Sample;\n}")]),
            0
        );
        assert_eq!(of([("src/a.rs", "struct Sample {"), ("src/b.rs", "// struct Sample;\n/// type Sample of\n")]), 0);
        assert_eq!(of([("src/commands/a.rs", "pub struct Args {"), ("src/commands/b.rs", "pub struct Args {")]), 0);
        assert_eq!(of([("src/cli.rs", "enum Command {"), ("src/commands/b.rs", "enum Command {")]), 0);
        assert_eq!(of([("src/cli.rs", "enum Command {"), ("src/bag/b.rs", "struct Command(f64);")]), 1);
        assert_eq!(of([("src/frame.rs", "pub enum EsvState {"), ("src/msg.rs", "pub struct EsvState {")]), 0);
        assert_eq!(of([("tests/a.rs", "pub struct Sample;"), ("src/b.rs", "pub struct Sample;")]), 0);
    }
}
