//! Bags by the paths of a command line: files, bag folders, and folders that hold many bags; each with a name that tells it from the others.

use std::collections::BTreeSet;
use std::ffi::OsStr;
use std::path::{Path, PathBuf};

use anyhow::Context;
use govtwin_diagnosis::result::NEXT_TEST;
use govtwin_files::look_at;

use super::Bag;
use crate::commands::usage;

/// Folders within folders deeper than this are a mistake.
const DEEPEST: usize = 16;

/// All bags that the paths name, each once, in the order given and by name within a folder.
///
/// A folder with `metadata.yaml` is one bag; any other stands for the bags in it, however deep.
pub fn find(paths: &[PathBuf]) -> anyhow::Result<Vec<Bag>> {
    let mut found = vec![];
    for path in paths {
        if path.as_os_str() == "-" {
            return Err(usage(
                "`-`: a bag cannot be read from a pipe, since it is read at more than one place; write it to a file first and name that",
            ));
        }
        let before = found.len();
        collect(path, &mut vec![], &mut found)?;
        if found.len() == before && path.is_dir() {
            anyhow::bail!(
                "{}: no bag in this folder: expected `metadata.yaml`, or .mcap files in it or below it",
                path.display()
            );
        }
    }
    let mut seen = BTreeSet::new();
    found.retain(|path| seen.insert(path.canonicalize().unwrap_or_else(|_| path.clone())));
    let names = names(&found);
    Ok(found.into_iter().zip(names).map(|(path, name)| Bag { path, name }).collect())
}

#[cfg(feature = "lab")]
/// Whether a path is a folder with bags in it.
pub fn holds_bags(path: &Path) -> anyhow::Result<bool> {
    let mut found = vec![];
    collect(path, &mut vec![], &mut found)?;
    // A file is meant itself.
    Ok(!found.is_empty() && (found != [path] || check_bag_folder(path)?))
}

/// Whether a folder is one bag, where it can be looked at.
pub fn is_bag_folder(path: &Path) -> bool {
    check_bag_folder(path).unwrap_or(false)
}

/// Whether a folder is one bag.
fn check_bag_folder(path: &Path) -> anyhow::Result<bool> {
    let file = path.join("metadata.yaml");
    let kind = look_at(&file).with_context(|| format!("cannot look at {}", file.display()))?;
    Ok(kind.is_some_and(|kind| kind.is_file()))
}

/// Whether a file is called as a bag's: `.mcap`, or compressed as a whole `.mcap.zstd`.
fn is_bag_file(path: &Path) -> bool {
    let has = |path: &Path, suffix: &str| path.extension().is_some_and(|found| found.eq_ignore_ascii_case(suffix));
    has(path, "mcap") || (has(path, "zstd") && has(&path.with_extension(""), "mcap"))
}

/// `above` are the real paths of the folders on the way.
fn collect(path: &Path, above: &mut Vec<PathBuf>, found: &mut Vec<PathBuf>) -> anyhow::Result<()> {
    let kind = look_at(path).with_context(|| format!("cannot look at {}", path.display()))?;
    if !kind.is_some_and(|kind| kind.is_dir()) || check_bag_folder(path)? {
        found.push(path.to_owned());
        return Ok(());
    }
    let reading = || format!("cannot read the folder {}", path.display());
    let real = path.canonicalize().with_context(reading)?;
    if above.contains(&real) {
        // A link that leads back: everything below it is found without it.
        return Ok(());
    }
    if above.len() > DEEPEST {
        anyhow::bail!(
            "{}: folders go deeper than {DEEPEST} levels; name one that is nearer to the bags",
            path.display()
        );
    }
    above.push(real);
    let mut entries = vec![];
    for entry in path.read_dir().with_context(reading)? {
        entries.push(entry.with_context(reading)?.path());
    }
    entries.sort();
    for entry in entries {
        // A proposed test is a script for a governor, and is beside the recordings if a diagnosis is written into their folder.
        let is_no_recording = |name: &OsStr| name.as_encoded_bytes().starts_with(b".") || name == NEXT_TEST;
        let hidden = entry.file_name().is_some_and(is_no_recording);
        let looking = || format!("cannot look at {}", entry.display());
        if !hidden && (is_bag_file(&entry) || look_at(&entry).with_context(looking)?.is_some_and(|kind| kind.is_dir()))
        {
            collect(&entry, above, found)?;
        }
    }
    above.pop();
    Ok(())
}

/// The shortest names that differ: a file's name without suffix, then with its folder, and so on.
fn names(paths: &[PathBuf]) -> Vec<String> {
    let parts: Vec<Vec<String>> = paths.iter().map(|path| parts(path)).collect();
    let name = |i: usize, levels: usize| parts[i][parts[i].len().saturating_sub(levels)..].join("/");
    let deepest = parts.iter().map(Vec::len).max().unwrap_or(0);
    (0..paths.len())
        .map(|i| {
            let alone = |levels: &usize| (0..paths.len()).all(|k| k == i || name(k, *levels) != name(i, *levels));
            name(i, (1..deepest).find(alone).unwrap_or(deepest))
        })
        .collect()
}

/// The parts of a path that name it, from the root down.
fn parts(path: &Path) -> Vec<String> {
    let full = path.canonicalize().unwrap_or_else(|_| path.to_owned());
    let stem = if full.is_dir() { full.file_name() } else { full.file_stem() };
    let parents = full.parent().map(Path::components).into_iter().flatten();
    let normal = parents.filter_map(|part| match part {
        std::path::Component::Normal(name) => Some(name),
        _ => None,
    });
    normal.chain(stem).map(|name| name.to_string_lossy().into_owned()).collect()
}
