//! Diagnoses a unit from its recordings, prints the summary, and leaves report and page in a folder.
//!
//! ```sh
//! cargo run --release --example diagnose_unit                       # a shipped unit with a planted fault: synthetic
//! cargo run --release --example diagnose_unit -- OUT BAG...          # yours, judged by the reference unit's data sheet
//! ```
//! It takes some 20 s on two cores. `govtwin diagnose` does the same with more care for files and for those who read them.

use std::error::Error;
use std::fs;
use std::path::{Path, PathBuf};

use govtwin::{
    DiagnosisReport, DiagnosisSettings, Interpolation, Provenance, ReadOptions, Recording, Stream, diagnose,
    diagnosis_page, diagnosis_text, read_bag, reference_unit,
};

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args_os().skip(1).map(PathBuf::from);
    let out = arguments.next().unwrap_or_else(|| std::env::temp_dir().join("diagnose_unit"));
    let mut bags: Vec<PathBuf> = arguments.collect();
    if bags.is_empty() {
        let unit = Path::new(env!("CARGO_MANIFEST_DIR")).join("bags/practice/case_03");
        bags = ["startup", "load_increase", "shutdown", "load_rejection"]
            .map(|name| unit.join(format!("{name}.mcap")))
            .into();
        println!("{}: synthetic, made by a simulator that is independent of the twin", unit.display());
    }
    let options = ReadOptions {
        interpolation: Interpolation::Sharp { period_ns: 1_000_000 },
        // What is not recorded is made up for: without commands the servomotor stage alone is judged.
        required: vec![Stream::ServoState],
        ..ReadOptions::default()
    };
    let read = |bag: &PathBuf| read_bag(bag, &options).map(|loaded| loaded.recording);
    let recordings: Vec<Recording> = bags.iter().map(read).collect::<Result<_, _>>()?;

    let progress = |what: &str, share: f64| eprintln!("{:3.0} % {what}", 100.0 * share);
    let diagnosis = diagnose(recordings, &reference_unit(), &DiagnosisSettings::default(), &progress)?;
    println!("{}", diagnosis_text(&diagnosis, 100));

    fs::create_dir_all(&out)?;
    let made = Provenance { unit: out.display().to_string(), ..Provenance::default() };
    fs::write(out.join("report.html"), diagnosis_page(&diagnosis, &made).to_html())?;
    fs::write(out.join("report.json"), serde_json::to_string_pretty(&DiagnosisReport::of(&diagnosis, f64::NAN))?)?;
    println!("report: {}", out.join("report.html").display());
    Ok(())
}
