//! Finding bags in folders, and reading them as recordings.

use std::path::PathBuf;

use govtwin_bag::Topics;
use govtwin_diagnosis::generate::{self, Scenario};
use govtwin_model::params;
use govtwin_model::recording::Process;

use super::{find, read};
use crate::commands::generate::write;

fn names(paths: &[std::path::PathBuf]) -> Vec<String> {
    find(paths).unwrap().into_iter().map(|bag| bag.name).collect()
}

#[test]
fn a_proposed_test_is_a_recording_only_where_it_is_named() {
    let dir = tempfile::tempdir().unwrap();
    for file in ["shutdown.mcap", "next_test.mcap"] {
        std::fs::write(dir.path().join(file), "").unwrap();
    }
    assert_eq!(names(&[dir.path().to_owned()]), ["shutdown"]);
    assert_eq!(names(&[dir.path().join("next_test.mcap")]), ["next_test"]);
}

#[test]
fn folders_are_bags_or_hold_bags_and_names_differ() {
    let dir = tempfile::tempdir().unwrap();
    let root = dir.path();
    for file in ["one/shutdown.mcap", "two/shutdown.mcap", "two/startup.mcap", "whole/metadata.yaml", "whole/w_0.mcap"]
    {
        std::fs::create_dir_all(root.join(file).parent().unwrap()).unwrap();
        std::fs::write(root.join(file), "").unwrap();
    }
    std::fs::create_dir(root.join(".part.unfinished")).unwrap();
    std::fs::write(root.join(".part.unfinished/part_0.mcap"), "").unwrap();
    assert_eq!(names(&[root.to_owned()]), ["one/shutdown", "two/shutdown", "startup", "whole"]);
    // The same bag named twice is read once.
    assert_eq!(names(&[root.join("two"), root.join("two/../two/startup.mcap")]), ["shutdown", "startup"]);
}

#[test]
fn a_folder_without_bags_is_an_error() {
    let dir = tempfile::tempdir().unwrap();
    assert!(find(&[dir.path().to_owned()]).unwrap_err().to_string().contains("no bag in this folder"));
}

#[test]
fn what_the_twin_simulated_says_nothing_beside_what_was_measured() {
    let dir = tempfile::tempdir().unwrap();
    let scenario = Scenario {
        unit: params::reference(),
        process: Process::LoadIncrease,
        rate_hz: 50.0,
        duration_s: 5.0,
        rich: false,
        seed: 1,
    };
    let streams = generate::streams(&scenario);
    let own_and_other = [("own", ("generate", govtwin_bag::TWIN)), ("other", ("blind --generate", "another"))];
    let [own, other] = own_and_other.map(|(name, by)| {
        let path = dir.path().join(name);
        write(by, scenario.process, scenario.seed, &streams, &path).unwrap().place().unwrap();
        path
    });
    let read = |paths: &[PathBuf]| read(paths, &Topics::default(), &scenario.unit).unwrap();
    let both = read(&[own.clone(), other]);
    assert_eq!(both.recordings.iter().map(|one| one.name.as_str()).collect::<Vec<_>>(), ["other"]);
    assert!(both.warnings.iter().any(|warning| warning.starts_with("own: simulated by govtwin's own twin")));
    // Alone it may be read: that is how a bench or a diagnosis is tried.
    assert_eq!(read(&[own]).recordings.len(), 1);
}

#[test]
fn a_path_that_is_not_there_is_left_to_the_reader() {
    assert_eq!(names(&["/nowhere/a.mcap".into()]), ["a"]);
}
