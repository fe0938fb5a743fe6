//! The default method's promise: within 1e-4 pu of the reference method wherever the dead band decides alike.
//!
//! `cargo bench --bench accuracy` has the same for every shipped recording, as a table.

#[path = "support/against.rs"]
mod against;

use std::path::Path;

use against::apart;
use govtwin_bag::ReadOptions;
use govtwin_model::recording::{Process, Recording};
use govtwin_model::twin::Cut;
use rayon::iter::{IntoParallelIterator, ParallelIterator};

/// Longest stretch that is simulated, s: the manoeuvre is in it.
const STRETCH_S: f64 = 120.0;

/// A shipped recording's first minutes.
fn recordings(folder: &str, suffix: &str) -> Vec<Recording> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("bags").join(folder);
    let read = |process: Process| {
        let path = folder.join(format!("{}{suffix}.mcap", process.id()));
        let mut recording = govtwin_bag::read(&path, &ReadOptions::default()).unwrap().recording;
        assert_eq!(recording.process, process);
        let until_ns = recording.frames[0].time_ns + (STRETCH_S * 1e9) as i64;
        recording.frames.retain(|frame| frame.time_ns <= until_ns);
        recording
    };
    Process::ALL.map(read).into()
}

#[test]
fn the_default_method_is_within_a_ten_thousandth() {
    let unit = govtwin_model::params::reference();
    let mut tasks = Vec::new();
    for recording in [recordings("practice/case_01", ""), recordings("reference", "_01")].concat() {
        tasks.extend([Cut::None, Cut::Servomotor, Cut::Spool].map(|cut| (recording.clone(), cut)));
    }
    let one = |(recording, cut): (Recording, Cut)| {
        let apart = apart(&unit, cut, &recording);
        let what = format!("{}, {cut:?}: {apart:?}", recording.process.id());
        // A single decision otherwise moves the servomotor by a correction; such runs say nothing about the method.
        let bounds_pu = match cut {
            Cut::None if apart.flips > 0 => return false,
            Cut::None => [1e-4, 1e-5],
            Cut::Servomotor => [1e-4, 5e-6],
            _ => [1e-12, 1e-4],
        };
        assert!(apart.rms_pu.iter().zip(bounds_pu).all(|(rms_pu, bound_pu)| *rms_pu <= bound_pu), "{what}");
        assert!(cut == Cut::None || apart.flips == 0, "{what}");
        true
    };
    let held: Vec<bool> = tasks.into_par_iter().map(one).collect();
    // 16 cuts never flip; of the 8 closed loops most do not.
    assert!(held.iter().filter(|held| **held).count() >= 20, "{held:?}");
}
