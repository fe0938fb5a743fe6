//! The supply chain: duplicates and accepted advisories stand with their reasons, and the bill of materials is whole.

use std::collections::{BTreeMap, BTreeSet};
use std::process::Command;

const TOP: &str = env!("CARGO_MANIFEST_DIR");

fn deny() -> String {
    std::fs::read_to_string(format!("{TOP}/.deny.toml")).unwrap()
}

/// The entries of a list in `.deny.toml` that have this key, each with its reason.
fn entries(key: &str) -> BTreeMap<String, String> {
    let begin = format!("{{ {key} = \"");
    let text = deny();
    let lines = text.lines().filter_map(|line| line.trim().strip_prefix(&begin));
    let entry = |line: &str| {
        let (name, rest) = line.split_once("\", reason = \"").unwrap_or_else(|| panic!("no reason: {line}"));
        (name.to_owned(), rest.trim_end_matches("\" },").to_owned())
    };
    lines.map(entry).collect()
}

#[test]
fn every_duplicate_crate_has_its_reason() {
    let output = Command::new(env!("CARGO"))
        .args([
            "tree",
            "--locked",
            "--all-features",
            "--target",
            "all",
            "--edges",
            "normal,build",
            "--prefix",
            "none",
            "--format",
            "{p}",
        ])
        .current_dir(TOP)
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let mut versions: BTreeMap<String, BTreeSet<Vec<u64>>> = BTreeMap::new();
    for line in String::from_utf8(output.stdout).unwrap().lines() {
        let mut words = line.split(' ');
        let (Some(name), Some(version)) = (words.next(), words.next().and_then(|word| word.strip_prefix('v'))) else {
            continue;
        };
        let numbers = version.split(['.', '+', '-']).map_while(|part| part.parse().ok()).collect();
        versions.entry(name.to_owned()).or_default().insert(numbers);
    }
    assert!(versions.len() > 150, "{}", versions.len());
    let mut expected = BTreeSet::new();
    for (name, versions) in versions {
        for older in versions.iter().rev().skip(1) {
            let text: Vec<String> = older.iter().map(u64::to_string).collect();
            expected.insert(format!("{name}@{}", text.join(".")));
        }
    }
    let listed: BTreeSet<String> = entries("crate").into_keys().collect();
    assert_eq!(listed, expected, "left: .deny.toml; right: Cargo.lock");
}

#[test]
fn every_accepted_advisory_has_a_date_and_a_reason() {
    let accepted = entries("id");
    assert!(!accepted.is_empty());
    for (id, reason) in accepted {
        let (date, words) = reason.split_once(": ").unwrap_or_default();
        let is_date = date.len() == 10 && date.split('-').all(|part| part.parse::<u16>().is_ok());
        assert!(id.starts_with("RUSTSEC-") && is_date && words.split(' ').count() > 5, "{id}: {reason}");
    }
}

#[cfg(unix)]
#[test]
fn the_bill_of_materials_is_whole_and_the_same_again() {
    let run = || {
        let output = Command::new("python3").arg(format!("{TOP}/scripts/sbom")).output().unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        output.stdout
    };
    let bytes = run();
    assert_eq!(bytes, run());
    let bill: serde_json::Value = serde_json::from_slice(&bytes).unwrap();
    assert_eq!((bill["bomFormat"].as_str(), bill["specVersion"].as_str()), (Some("CycloneDX"), Some("1.5")));
    let components = bill["components"].as_array().unwrap();
    let name = |component: &serde_json::Value| component["name"].as_str().unwrap().to_owned();
    let names: BTreeSet<String> = components.iter().map(name).collect();
    for needed in ["serde_yaml", "mcap", "nalgebra", "rustdds", "zstd-sys"] {
        assert!(names.contains(needed), "{needed}");
    }
    assert!(!names.contains("criterion") && !names.contains("proptest"), "what only tests know is not in it");
    // Cargo has the sum of everything but what stands in this tree.
    let unsummed: Vec<String> = components.iter().filter(|one| one["hashes"].is_null()).map(name).collect();
    let others: Vec<&String> = unsummed.iter().filter(|name| !name.starts_with("govtwin-")).collect();
    assert_eq!(others, ["rustdds"]);
    let text = String::from_utf8(bytes).unwrap();
    assert!(!text.contains(TOP), "no path of this machine");
}
