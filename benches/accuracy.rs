//! How exact the default method is: its difference to RK4 at 50 µs over every shipped recording whose inputs are known to hold.
//!
//! `cargo bench --bench accuracy`. Root mean squares of spool and servomotor, by process and cut, over practice and reference
//! recordings (synthetic; see `bags/ORIGIN.txt`), with the data sheet's parameters. In closed loop the regulator decides every 10 ms
//! on an error that may lie within 1e-7 pu of its dead band's edge. Where two runs decide otherwise once, they go apart by
//! a whole correction of the servomotor, however exact both are. Recordings in which that happened stand in rows of their own.

#[path = "../tests/support/against.rs"]
mod against;

use std::io::Write;
use std::path::{Path, PathBuf};

use against::{Apart, apart};
use govtwin_bag::ReadOptions;
use govtwin_model::recording::{Process, Recording};
use govtwin_model::twin::Cut;
use rayon::iter::{IntoParallelRefIterator, ParallelIterator};

/// What the default method promises, pu.
const WITHIN_PU: f64 = 1e-4;

fn bags(folder: &Path, found: &mut Vec<PathBuf>) {
    let mut entries: Vec<PathBuf> =
        std::fs::read_dir(folder).expect("a folder").filter_map(|entry| entry.ok().map(|entry| entry.path())).collect();
    entries.sort();
    for path in entries {
        if path.is_dir() {
            bags(&path, found);
        } else if path.extension().is_some_and(|suffix| suffix == "mcap") {
            found.push(path);
        }
    }
}

fn main() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("bags");
    let mut paths = Vec::new();
    bags(&folder.join("practice"), &mut paths);
    bags(&folder.join("reference"), &mut paths);
    let read =
        |path: &PathBuf| govtwin_bag::read(path, &ReadOptions::default()).expect("a shipped recording").recording;
    let recordings: Vec<Recording> = paths.par_iter().map(read).collect();
    let unit = govtwin_model::params::reference();

    let mut out = std::io::stdout().lock();
    let mut say = |text: String| drop(out.write_all(text.as_bytes()));
    say(format!(
        "{:<20}{:<16}{:>11}{:>14}{:>14}{:>10}\n",
        "cut", "process", "recordings", "spool RMS", "servo RMS", "> 1e-4"
    ));
    for (cut, name) in [(Cut::Spool, "spool"), (Cut::Servomotor, "servomotor"), (Cut::None, "closed loop")] {
        for process in Process::ALL {
            let of_process: Vec<&Recording> = recordings.iter().filter(|one| one.process == process).collect();
            let results: Vec<Apart> = of_process.par_iter().map(|one| apart(&unit, cut, one)).collect();
            let (alike, flipped): (Vec<Apart>, Vec<Apart>) = results.iter().partition(|one| one.flips == 0);
            let mut row = |kind: &str, of: &[Apart]| {
                // The spool of a spool cut is the recording's own.
                let rms_pu =
                    [0, 1].map(|k| (of.iter().map(|one| one.rms_pu[k].powi(2)).sum::<f64>() / of.len() as f64).sqrt());
                let beyond = of.iter().filter(|one| one.rms_pu.iter().any(|rms_pu| *rms_pu > WITHIN_PU)).count();
                let [spool_pu, servomotor_pu] = rms_pu;
                say(format!(
                    "{:<20}{:<16}{:>11}{spool_pu:>14.1e}{servomotor_pu:>14.1e}{beyond:>10}\n",
                    format!("{name}{kind}"),
                    process.title(),
                    of.len()
                ));
            };
            row("", &alike);
            if !flipped.is_empty() {
                row(", flips", &flipped);
                let flips: usize = flipped.iter().map(|one| one.flips).sum();
                say(format!("{:34}{flips} decisions otherwise in {} recordings\n", "", flipped.len()));
            }
        }
    }
}
