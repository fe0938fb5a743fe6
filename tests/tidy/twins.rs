//! Types of one name: what a stranger would take for one thing and is two.

use std::collections::BTreeMap;

use crate::source::Source;

/// What every command calls its own.
const OF_EACH: [&str; 1] = ["Args"];

/// Names that two types have which others than their own file can see. Wire types are called as ROS calls them.
pub fn twins(sources: &[Source]) -> Vec<String> {
    let mut places: BTreeMap<String, Vec<String>> = BTreeMap::new();
    for source in sources {
        let is_ours = source.path.starts_with("src/") && source.path.ends_with(".rs");
        if !is_ours || source.path == "src/msg.rs" || source.path.starts_with("src/msg/") {
            continue;
        }
        for (number, line) in source.text.lines().enumerate() {
            if let Some(name) = visible_type(line).filter(|name| !OF_EACH.contains(name)) {
                places.entry(name.to_owned()).or_default().push(format!("{}:{}", source.path, number + 1));
            }
        }
    }
    places.retain(|_, places| places.len() > 1);
    places.into_iter().map(|(name, places)| format!("`{name}` is {}", places.join(" and "))).collect()
}

/// The name of a type that a line declares for others than its file.
fn visible_type(line: &str) -> Option<&str> {
    let rest = line.trim_start().strip_prefix("pub")?;
    let rest = if rest.starts_with('(') { rest.split_once(')')?.1 } else { rest };
    let (kind, rest) = rest.trim_start().split_once(' ')?;
    let is_type = matches!(kind, "struct" | "enum" | "trait" | "type" | "union");
    is_type.then(|| rest.split(|c: char| !c.is_alphanumeric() && c != '_').next()).flatten()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_types_of_one_name_are_seen() {
        let of = |texts: [(&str, &str); 2]| twins(&texts.map(|(path, text)| Source::new(path, text))).len();
        assert_eq!(of([("src/a.rs", "pub struct Sample {"), ("src/b/c.rs", "    pub(super) enum Sample<T> {")]), 1);
        assert_eq!(of([("src/a.rs", "pub struct Sample {"), ("src/b.rs", "struct Sample {")]), 0);
        assert_eq!(of([("src/a.rs", "pub struct Args {"), ("src/b.rs", "pub struct Args {")]), 0);
        assert_eq!(of([("src/frame.rs", "pub enum EsvState {"), ("src/msg.rs", "pub struct EsvState {")]), 0);
        assert_eq!(of([("tests/a.rs", "pub struct Sample;"), ("src/b.rs", "pub struct Sample;")]), 0);
    }
}
