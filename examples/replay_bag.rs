//! Replays a bag through the twin of a data sheet, and says how far measured and simulated are apart.
//!
//! ```sh
//! cargo run --release --example replay_bag                    # a shipped recording, made by a simulator: synthetic
//! cargo run --release --example replay_bag -- BAG [SHEET]     # yours, with your parameter file
//! ```

use std::error::Error;
use std::path::Path;

use govtwin::{
    Interpolation, Positions, ReadOptions, Replayed, Signal, Unit, load_unit, read_bag, reference_unit, replay,
};

pub fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args_os().skip(1);
    let bag = arguments.next().map_or_else(
        || {
            println!("no bag given; this one is synthetic, made by a simulator that is independent of the twin");
            Path::new(env!("CARGO_MANIFEST_DIR")).join("bags/reference/load_increase_01.mcap")
        },
        Into::into,
    );
    let unit = arguments.next().map_or_else(|| Ok(reference_unit()), |sheet| load_unit(Path::new(&sheet)))?;
    replay_bag(&bag, &unit).map(drop)
}

/// Replays one bag and prints the figures of every signal that was measured.
pub fn replay_bag(bag: &Path, unit: &Unit) -> Result<Replayed, Box<dyn Error>> {
    let options = ReadOptions {
        // Between two slow samples the command runs straight; rows of 1 ms show the twin its slope.
        interpolation: Interpolation::Sharp { period_ns: 1_000_000 },
        positions: Positions::of(unit.recorded),
        ..ReadOptions::default()
    };
    let loaded = read_bag(bag, &options)?;
    if loaded.health.about("synthetic") == Some("true") {
        println!("synthetic: {}", loaded.health.about("origin").unwrap_or("the bag says no more"));
    }
    for warning in &loaded.health.warnings {
        println!("warning: {warning}");
    }
    let replayed = replay(unit, loaded.recording);
    println!("{} ({}), {} rows", replayed.recording.name, replayed.recording.process.title(), replayed.rows);
    for signal in Signal::ALL {
        let figures = replayed.scores.figures(signal);
        if figures.count > 0 {
            let (title, unit) = (signal.title(), signal.unit());
            println!("{title}: MAE {:.5} {unit}, RMSE {:.5} {unit}, R2 {:.5}", figures.mae, figures.rmse, figures.r2);
        }
    }
    Ok(replayed)
}
