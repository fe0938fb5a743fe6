//! The full chain on one core: time per simulated second of each method at equal accuracy, beside SUNDIALS CVODE and the crate diffsol.
//!
//! `cargo bench --bench chain -- [REPEATS]`. The four processes of practice unit 1 (synthetic, 100 Hz) drive the reference
//! unit's plant, regulator included. Each contender is tried with coarse to fine steps or tolerances; the fastest whose error
//! stays within 1e-4 pu counts. Errors are root mean squares against RK4 at 25 µs, the largest of spool and servomotor in any
//! process, with the measured servomotor position fed to the regulator, so that no decision of its dead band hangs on the seventh
//! digit. Speeds are told for that and for the closed loop. Every contender sees the same inputs, stops wherever
//! the valve's current changes (every millisecond) and gives both positions every 10 ms.
//! CVODE needs `libsundials-dev` and `cc`; diffsol is built from `benches/diffsol`, a package of its own. What is missing is left out.

mod contender;
mod tape;

use std::io::Write;

use contender::{Contender, DEFAULT, Run};
use govtwin_model::solver::Method;
use govtwin_model::twin::Cut;
use tape::Tape;

/// Greatest error of a contender that counts, pu.
const WITHIN_PU: f64 = 1e-4;

/// Shortest time of a contender's run that a clock tells well, s.
const LONG_ENOUGH_S: f64 = 0.2;

/// Rounds of the last comparison, in which all run in turns.
const ROUNDS: usize = 5;

/// One setting of a contender, with what it took.
struct Tried<'a> {
    contender: &'a Contender,
    setting: usize,
    error_pu: f64,
    seconds_s: f64,
}

fn main() {
    let repeats = std::env::args().find_map(|word| word.parse().ok()).unwrap_or(3);
    let folder = tempfile::tempdir().expect("a folder");
    let tape = Tape::read(folder.path());
    let mut out = std::io::stdout().lock();
    let mut say = |text: String| {
        let _ = out.write_all(text.as_bytes());
        let _ = out.flush();
    };
    let reference = contender::own(&tape, Method::Rk4 { max_step_s: 2.5e-5 }, Cut::Servomotor, 0.0);
    say(format!(
        "{:.0} s simulated; error in pu RMS; speed in times real time, processor time, of {repeats} runs the best\n\n",
        tape.duration_s()
    ));
    let contenders = contender::all(folder.path());
    let mut best: Vec<Tried> = Vec::new();
    for contender in &contenders {
        say(format!("{}\n", contender.name));
        let mut fastest: Option<Tried> = None;
        for (setting, name) in contender.settings.iter().enumerate() {
            let run = contender.run(&tape, setting, Cut::Servomotor, repeats, LONG_ENOUGH_S);
            let Some(Run { seconds_s, positions, note }) = run else {
                say(format!("    {name:<34} failed, or stopped as far too slow\n"));
                continue;
            };
            let error_pu = tape.apart_pu(&positions, &reference.positions);
            say(format!("    {name:<34}{error_pu:>9.1e}{:>10.0} x{note}\n", tape.duration_s() / seconds_s));
            if error_pu <= WITHIN_PU && fastest.as_ref().is_none_or(|fastest| seconds_s < fastest.seconds_s) {
                fastest = Some(Tried { contender, setting, error_pu, seconds_s });
            }
        }
        best.extend(fastest);
    }

    say(format!("\nthe fastest of each within {WITHIN_PU:.0e} pu, in turns once more\n"));
    let mut least_s = vec![[f64::INFINITY; 2]; best.len()];
    for _ in 0..ROUNDS {
        for (tried, least_s) in best.iter().zip(&mut least_s) {
            for (cut, least_s) in [Cut::Servomotor, Cut::None].into_iter().zip(least_s) {
                let run = tried.contender.run(&tape, tried.setting, cut, 1, LONG_ENOUGH_S);
                *least_s = least_s.min(run.map_or(f64::INFINITY, |run| run.seconds_s));
            }
        }
    }
    let ours_s = best.iter().position(|tried| tried.contender.name == DEFAULT).map_or([f64::NAN; 2], |at| least_s[at]);
    say(format!(
        "{:<46}{:>9}{:>10}{:>12}{:>12}{:>10}{:>12}\n",
        "", "error", "us per s", "speed", "closed", "slower", "closed"
    ));
    for (Tried { contender, setting, error_pu, .. }, seconds_s) in best.iter().zip(least_s) {
        let name = format!("{}, {}", contender.name, contender.settings[*setting]);
        let us_per_s = 1e6 * seconds_s[0] / tape.duration_s();
        let speed = seconds_s.map(|seconds_s| tape.duration_s() / seconds_s);
        let slower = [seconds_s[0] / ours_s[0], seconds_s[1] / ours_s[1]];
        say(format!(
            "{name:<46}{error_pu:>9.1e}{us_per_s:>10.1}{:>10.0} x{:>10.0} x{:>8.1} x{:>10.1} x\n",
            speed[0], speed[1], slower[0], slower[1]
        ));
    }
}
