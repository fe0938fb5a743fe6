//! The shipped recordings: whole, unchanged, and what they are said to be.

use std::fs;

use govtwin_bag::ReadOptions;
use govtwin_files::digest::sha256;
use govtwin_model::recording::Process;

use super::make::{All, read_both_ways, shipped};

#[test]
fn checksums_hold_and_cover_every_recording() {
    let list = fs::read_to_string(shipped("SHA256SUMS")).unwrap();
    let mut listed = vec![];
    for line in list.lines() {
        let (sum, name) = line.split_once("  ").unwrap();
        assert_eq!(sha256(fs::read(shipped(name)).unwrap()), sum, "{name}");
        listed.push(name.to_owned());
    }
    let mut found = vec![];
    for set in ["reference", "practice", "sealed"] {
        let mut folders = vec![shipped(set)];
        while let Some(folder) = folders.pop() {
            for entry in fs::read_dir(folder).unwrap() {
                let path = entry.unwrap().path();
                if path.is_dir() {
                    folders.push(path);
                } else if path.extension().is_some_and(|suffix| suffix == "mcap") {
                    found.push(path.strip_prefix(shipped("")).unwrap().to_string_lossy().into_owned());
                }
            }
        }
    }
    found.sort();
    listed.retain(|name| name.ends_with(".mcap"));
    assert_eq!(found, listed);
    assert_eq!(found.len(), 16 + 8 * 4 + 24 * 4);
}

#[test]
fn reference_recordings_have_every_row_and_their_process() {
    let mut servo_rows = 0;
    for process in Process::ALL {
        for number in 1..=4 {
            let path = shipped(&format!("reference/{}_0{number}.mcap", process.id()));
            let loaded = read_both_ways(&path, &ReadOptions::default()).unwrap();
            assert_eq!(loaded.recording.process, process, "{}", loaded.recording.name);
            assert!(loaded.health.is_clean(), "{:?}", loaded.health.warnings);
            let frames = &loaded.recording.frames;
            assert!(frames.windows(2).all(|pair| pair[0].time_ns < pair[1].time_ns));
            servo_rows += frames.iter().filter(|frame| frame.measured.servomotor_position_pu.is_finite()).count();
            assert!((loaded.health.streams[0].pace.rate_hz - 5.0).abs() < 0.05);
        }
    }
    assert_eq!(servo_rows, 23_293, "the whole set");
}

#[test]
fn sound_recordings_are_read_row_by_row() {
    for name in ["reference/startup_02.mcap", "practice/case_03/shutdown.mcap", "sealed/case_11/load_increase.mcap"] {
        let mut all = All::default();
        govtwin_bag::read_rows(&shipped(name), &ReadOptions::default(), &mut all).unwrap();
        assert!(!all.restarted && all.frames.len() > 100, "{name}");
    }
}

#[test]
fn every_unit_has_four_clean_processes() {
    for (set, units) in [("practice", 8), ("sealed", 24)] {
        for unit in 1..=units {
            for process in Process::ALL {
                let path = shipped(&format!("{set}/case_{unit:02}/{}.mcap", process.id()));
                let loaded = read_both_ways(&path, &ReadOptions::default()).unwrap();
                assert!(loaded.health.is_clean(), "{}: {:?}", path.display(), loaded.health.warnings);
                assert_eq!(loaded.recording.process, process, "{}", path.display());
            }
        }
    }
}
