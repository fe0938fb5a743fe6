//! Reading bags: the shipped recordings, and what a bag is turned into.

use std::path::{Path, PathBuf};

use govtwin::bag::{self, ReadOptions};
use govtwin::recording::Process;

fn shipped(relative: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("bags").join(relative)
}

#[test]
fn the_reference_recordings_have_every_row_and_their_process() {
    let mut servo_rows = 0;
    for (name, process) in [
        ("startup", Process::Startup),
        ("load_increase", Process::LoadIncrease),
        ("shutdown", Process::Shutdown),
        ("load_rejection", Process::LoadRejection),
    ] {
        for number in 1..=4 {
            let path = shipped(&format!("reference/{name}_0{number}.mcap"));
            let loaded = bag::read(&path, &ReadOptions::default()).unwrap();
            assert_eq!(loaded.recording.process, process, "{}", loaded.recording.name);
            assert!(loaded.health.is_clean(), "{:?}", loaded.health.warnings);
            let frames = &loaded.recording.frames;
            assert!(frames.windows(2).all(|pair| pair[0].time_ns < pair[1].time_ns));
            servo_rows += frames.iter().filter(|frame| frame.measured.servomotor_position_pu.is_finite()).count();
            assert!((loaded.health.streams[0].rate_hz - 5.0).abs() < 0.05);
        }
    }
    assert_eq!(servo_rows, 23_293, "the whole set");
}
