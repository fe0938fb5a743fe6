//! Licences and sources of all dependencies, by the same list that `cargo deny` reads.

use std::process::Command;

use serde_json::Value;

/// Packages that carry a licence file but no licence expression, read by hand; `cargo deny` reads the file itself.
const READ_BY_HAND: &[(&str, &str)] = &[("ros2args", "Apache-2.0")];

/// Packages built into the program with any feature, or building it, whose licence or source `.deny.toml` does not allow.
pub fn breaches() -> Vec<String> {
    let top = env!("CARGO_MANIFEST_DIR");
    let deny = std::fs::read_to_string(format!("{top}/.deny.toml")).expect(".deny.toml is there");
    let host = Command::new(env!("CARGO")).args(["-vV"]).output().expect("cargo runs").stdout;
    let host = String::from_utf8_lossy(&host).lines().find_map(|line| line.strip_prefix("host: ").map(str::to_owned));
    let output = Command::new(env!("CARGO"))
        .args([
            "metadata",
            "--format-version",
            "1",
            "--locked",
            "--all-features",
            "--filter-platform",
            &host.expect("cargo names its host"),
        ])
        .current_dir(top)
        .output()
        .expect("cargo runs");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let metadata: Value = serde_json::from_slice(&output.stdout).expect("cargo metadata is JSON");
    let packages = metadata["packages"].as_array().expect("packages");
    assert!(packages.len() > 50, "the dependencies are in the list");
    check(packages, &deny)
}

fn check(packages: &[Value], deny: &str) -> Vec<String> {
    let allowed = allowed(deny);
    let mut breaches = Vec::new();
    for package in packages {
        let name = package["name"].as_str().unwrap_or_default();
        let by_hand = || READ_BY_HAND.iter().find(|(package, _)| *package == name).map(|(_, licence)| *licence);
        let licence = package["license"].as_str().or_else(by_hand);
        if !licence.is_some_and(|licence| fulfilled(licence, &allowed)) {
            breaches.push(format!("{name}: its licence {licence:?} is not among those of .deny.toml"));
        }
        let source = package["source"].as_str();
        if source.is_some_and(|source| !source.starts_with("registry+")) {
            breaches.push(format!("{name}: comes from {source:?}, not from the registry"));
        }
    }
    breaches
}

/// Whether an SPDX expression can be fulfilled with the allowed licences. `AND` binds tighter than `OR`.
fn fulfilled(expression: &str, allowed: &[&str]) -> bool {
    let expression = expression.replace('/', " OR ");
    let mut text = expression.as_str();
    let value = either(&mut text, allowed);
    value && text.trim().is_empty()
}

fn either(text: &mut &str, allowed: &[&str]) -> bool {
    let mut value = all(text, allowed);
    while let Some(rest) = text.trim_start().strip_prefix("OR ") {
        *text = rest;
        value |= all(text, allowed);
    }
    value
}

fn all(text: &mut &str, allowed: &[&str]) -> bool {
    let mut value = one(text, allowed);
    while let Some(rest) = text.trim_start().strip_prefix("AND ") {
        *text = rest;
        value &= one(text, allowed);
    }
    value
}

fn one(text: &mut &str, allowed: &[&str]) -> bool {
    let start = text.trim_start();
    if let Some(rest) = start.strip_prefix('(') {
        *text = rest;
        let value = either(text, allowed);
        let Some(rest) = text.trim_start().strip_prefix(')') else { return false };
        *text = rest;
        return value;
    }
    let end = [" OR ", " AND ", ")"].iter().filter_map(|stop| start.find(stop)).min().unwrap_or(start.len());
    let (name, rest) = start.split_at(end);
    *text = rest;
    allowed.contains(&name.trim())
}

/// The quoted names between `allow = [` and `]`.
fn allowed(deny: &str) -> Vec<&str> {
    let list = deny.split_once("allow = [").and_then(|(_, rest)| rest.split_once(']')).map_or("", |(list, _)| list);
    list.split('"').skip(1).step_by(2).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    const DENY: &str = "allow = [\n    \"Apache-2.0\",\n    \"MIT\",\n]\n";

    #[test]
    fn expressions_are_understood() {
        for (expression, expected) in [
            ("MIT", true),
            ("GPL-3.0", false),
            ("GPL-3.0 OR MIT", true),
            ("GPL-3.0/MIT", true),
            ("MIT AND GPL-3.0", false),
            ("(MIT OR GPL-3.0) AND Zlib", true),
            ("(MIT OR Zlib) AND GPL-3.0", false),
            ("GPL-3.0 OR MIT AND Zlib", true),
            ("MIT WITH odd-exception", false),
            ("(MIT", false),
            ("", false),
        ] {
            assert_eq!(fulfilled(expression, &["MIT", "Zlib"]), expected, "{expression}");
        }
    }

    #[test]
    fn a_stranger_is_seen() {
        let good = json!({"name": "b", "license": "MIT", "source": "registry+https://example.org"});
        let by_hand = json!({"name": "ros2args", "license": null, "source": null});
        assert_eq!(check(&[good, by_hand], DENY), Vec::<String>::new());
        assert_eq!(check(&[json!({"name": "c", "license": "GPL-3.0", "source": null})], DENY).len(), 1);
        assert_eq!(check(&[json!({"name": "c", "license": null, "source": null})], DENY).len(), 1);
        assert_eq!(
            check(&[json!({"name": "c", "license": "MIT", "source": "git+https://example.org"})], DENY).len(),
            1
        );
    }
}
