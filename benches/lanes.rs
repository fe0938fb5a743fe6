//! Several units side by side in lanes: simulations per core of every width that the processor has, and the residuals of many units at once.
//!
//! `cargo bench --bench lanes`. The four processes of practice unit 1 (synthetic, 100 Hz) are simulated by the mean twins of slightly
//! different units, as the slopes of a fit need them: each parameter of the sheet moved by a hundredth. All run in turns; processor time of
//! one thread, the fastest round.
//!
//! On a processor whose AVX-512 registers are two halves (Zen 4), times the simulations of twins one by one:
//!
//! | two lanes | four | eight (2 × AVX2) | sixteen (2 × AVX-512) | residuals of 32 units at once |
//! |---|---|---|---|---|
//! | 1.8 | 3.6 | 4.5 | 5.2 | 6.1 |

use std::hint::black_box;
use std::io::Write;
use std::path::Path;

use govtwin_bag::ReadOptions;
use govtwin_diagnosis::likelihood::noise;
use govtwin_diagnosis::likelihood::prepared::PreparedRecording;
use govtwin_diagnosis::likelihood::problem::Problem;
use govtwin_model::parameters::{ENTRIES, Unit};
use govtwin_model::params;
use govtwin_model::plant::lanes::Width;
use govtwin_model::recording::Process;
use govtwin_model::twin::Twin;
use rustix::time::{ClockId, clock_gettime};

/// Units that are judged at once.
const UNITS: usize = 32;

/// Twins that are simulated by every width.
const SIDE_BY_SIDE: usize = 16;

/// Rounds, of which the fastest counts.
const ROUNDS: usize = 7;

/// Noise inside the loop over which the twins are means, pu.
const DITHER_PU: f64 = 1.5e-4;

fn main() {
    let units = units();
    let recordings: Vec<PreparedRecording> = Process::ALL.into_iter().map(recording).collect();
    let twins: Vec<Twin> = units.iter().map(|unit| Twin::new(unit).with_dither(DITHER_PU)).collect();
    let mut out = std::io::stdout().lock();
    let mut say = |text: String| {
        let _ = out.write_all(text.as_bytes());
        let _ = out.flush();
    };

    let widths = Width::all();
    let mut least_s = vec![f64::INFINITY; widths.len() + 1];
    for _ in 0..ROUNDS {
        least_s[0] = least_s[0].min(time_s(|| {
            for recording in &recordings {
                for twin in &twins[..SIDE_BY_SIDE] {
                    black_box(recording.run(&mut twin.clone()));
                }
            }
        }));
        for (least_s, width) in least_s[1..].iter_mut().zip(&widths) {
            *least_s = least_s.min(time_s(|| {
                for recording in &recordings {
                    for batch in twins[..SIDE_BY_SIDE].chunks(width.lanes()) {
                        black_box(recording.run_batch_of(*width, &mut batch.to_vec()));
                    }
                }
            }));
        }
    }
    let names =
        std::iter::once("one by one".to_owned()).chain(widths.iter().map(|width| format!("lanes: {}", width.lanes())));
    say(format!("{:<34}{:>20}{:>10}\n", "", "simulations/s", "ratio"));
    for (name, seconds_s) in names.zip(&least_s) {
        let per_s = SIDE_BY_SIDE as f64 * recordings.len() as f64 / seconds_s;
        say(format!("{name:<34}{per_s:>20.1}{:>10.2}\n", least_s[0] / seconds_s));
    }

    let reference = params::reference();
    let problem = Problem::new(recordings, &reference, &noise::expected(&reference.sensors));
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a thread");
    let (mut apart_s, mut together_s) = (f64::INFINITY, f64::INFINITY);
    for _ in 0..ROUNDS {
        apart_s = apart_s.min(time_s(|| {
            for unit in &units {
                for recording in 0..problem.recordings.len() {
                    black_box(problem.residuals(unit, recording));
                }
            }
        }));
        together_s = together_s.min(pool.install(|| time_s(|| drop(black_box(problem.residuals_of(&units))))));
    }
    say(format!("\nmisses of {UNITS} units, one thread\n"));
    for (name, seconds_s) in [("one by one", apart_s), ("at once", together_s)] {
        let per_s = (UNITS * problem.recordings.len()) as f64 / seconds_s;
        say(format!("{name:<34}{per_s:>20.1}{:>10.2}\n", apart_s / seconds_s));
    }
}

/// Processor time of this thread that some work takes, s.
fn time_s(work: impl FnOnce()) -> f64 {
    let now_s = || {
        let now = clock_gettime(ClockId::ThreadCPUTime);
        now.tv_sec as f64 + 1e-9 * now.tv_nsec as f64
    };
    let start_s = now_s();
    work();
    now_s() - start_s
}

fn recording(process: Process) -> PreparedRecording {
    let bags = Path::new(env!("CARGO_MANIFEST_DIR")).join("bags/practice/case_01");
    let path = bags.join(process.id()).with_extension("mcap");
    PreparedRecording::new(govtwin_bag::read(&path, &ReadOptions::default()).expect("a shipped recording").recording)
}

/// The shipped unit with each of its first parameters moved a little.
fn units() -> Vec<Unit> {
    let reference = params::reference();
    let moved = |entry: &govtwin_model::parameters::ParameterEntry| {
        let mut unit = reference.clone();
        let value = (entry.get)(&unit.parameters);
        (entry.set)(&mut unit.parameters, 1.01 * value);
        unit
    };
    let periods = ["large_loop_period_s", "small_loop_period_s"];
    let entries = ENTRIES.iter().filter(|entry| !periods.iter().any(|period| entry.key.ends_with(period)));
    entries.filter(|entry| (entry.get)(&reference.parameters) != 0.0).map(moved).take(UNITS).collect()
}
