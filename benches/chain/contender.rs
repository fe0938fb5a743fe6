//! Who competes: the library's own methods, and programs that integrate the same tape.

use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

use govtwin_model::solver::Method;
use govtwin_model::twin::{Cut, Twin};
use rustix::time::{ClockId, clock_gettime};

use crate::tape::Tape;

/// Name of the method that the twin takes where nobody asks.
pub const DEFAULT: &str = "split, the default";

/// A program that takes longer than this for one run of the tape is far behind, and is stopped.
const PATIENCE: Duration = Duration::from_secs(40);

/// One run over the tape.
pub struct Run {
    /// Least processor time of all repeats, s.
    pub seconds_s: f64,
    /// Spool and servomotor position at every row, pu.
    pub positions: Vec<[f64; 2]>,
    /// What else is known of it.
    pub note: String,
}

/// A method with the settings to try, coarse to fine.
pub struct Contender {
    /// What the tables call it.
    pub name: &'static str,
    /// Names of the settings.
    pub settings: Vec<String>,
    how: How,
}

enum How {
    Own(Vec<Method>),
    /// A program, and per setting its words after tape, output and loop.
    Program(PathBuf, Vec<Vec<String>>),
}

impl Contender {
    /// Runs one setting; repeats own methods until a clock tells their time well. `None` where the program fails or runs on and on.
    pub fn run(&self, tape: &Tape, setting: usize, cut: Cut, repeats: u32, long_enough_s: f64) -> Option<Run> {
        match &self.how {
            How::Own(methods) => {
                let runs = (0..repeats).map(|_| own(tape, methods[setting], cut, long_enough_s));
                runs.min_by(|a, b| a.seconds_s.total_cmp(&b.seconds_s))
            }
            How::Program(program, words) => {
                let out = tape.path.with_file_name("positions.f64");
                let closed = if cut == Cut::None { "1" } else { "0" };
                let mut command = Command::new(program);
                command.arg(&tape.path).arg(&out).arg(closed).args(&words[setting]).arg(repeats.to_string());
                let said = patiently(&mut command, PATIENCE * repeats)?;
                let said = String::from_utf8_lossy(&said.stdout).into_owned();
                let numbers: Vec<f64> = said.split_whitespace().filter_map(|word| word.parse().ok()).collect();
                let [seconds_s, steps, evaluations] = numbers.as_slice() else { return None };
                let bytes = std::fs::read(&out).ok()?;
                let value = |at: usize| bytes[8 * at..8 * at + 8].try_into().map_or(f64::NAN, f64::from_le_bytes);
                let positions = (0..bytes.len() / 16).map(|row| [value(2 * row), value(2 * row + 1)]).collect();
                let ms = 1e3 * tape.duration_s();
                let note = format!("{:>7.1} steps{:>7.1} evaluations a tick", steps / ms, evaluations / ms);
                Some(Run { seconds_s: *seconds_s, positions, note })
            }
        }
    }
}

/// What a program says; none where it fails or takes too long.
fn patiently(command: &mut Command, patience: Duration) -> Option<Output> {
    let mut child = command.stdout(Stdio::piped()).stderr(Stdio::null()).spawn().ok()?;
    let begin = Instant::now();
    while child.try_wait().ok()?.is_none() {
        if begin.elapsed() > patience {
            child.kill().ok()?;
            child.wait().ok()?;
            return None;
        }
        std::thread::sleep(Duration::from_millis(5));
    }
    child.wait_with_output().ok().filter(|output| output.status.success())
}

/// Time that this process has had on a processor, s: what else runs on the machine does not count.
fn processor_s() -> f64 {
    let time = clock_gettime(ClockId::ProcessCPUTime);
    time.tv_sec as f64 + 1e-9 * time.tv_nsec as f64
}

/// Runs the twin over the tape, again and again until `long_enough_s` have passed; the mean time of one.
pub fn own(tape: &Tape, method: Method, cut: Cut, long_enough_s: f64) -> Run {
    let mut twin = Twin::with_method(&govtwin_model::params::reference(), method).with_cut(cut);
    let mut positions = Vec::new();
    let mut runs = 0_u32;
    let begin_s = processor_s();
    loop {
        positions.clear();
        for part in &tape.parts {
            twin.reset();
            positions.extend(part.frames.iter().map(|frame| {
                let signals = twin.step(frame).signals;
                [signals.spool_position_pu, signals.servomotor_position_pu]
            }));
        }
        runs += 1;
        let passed_s = processor_s() - begin_s;
        if passed_s >= long_enough_s {
            return Run { seconds_s: passed_s / f64::from(runs), positions, note: String::new() };
        }
    }
}

/// Everyone who can compete on this machine.
pub fn all(folder: &Path) -> Vec<Contender> {
    let methods = |name, method: fn(f64) -> Method, steps_us: &[f64]| Contender {
        name,
        settings: steps_us.iter().map(|step_us| format!("{step_us} us")).collect(),
        how: How::Own(steps_us.iter().map(|step_us| method(step_us * 1e-6)).collect()),
    };
    let split = |max_step_s| Method::Split { max_step_s };
    let rk4 = |max_step_s| Method::Rk4 { max_step_s };
    let rosenbrock = |max_step_s| Method::Rosenbrock { max_step_s };
    let mut all = vec![
        methods(DEFAULT, split, &[1e6 * govtwin_model::solver::split::SPOOL_STEP_S]),
        methods("split, other steps", split, &[1000.0, 250.0, 125.0]),
        methods("RK4", rk4, &[500.0, 250.0, 200.0, 125.0, 100.0, 50.0]),
        methods("Rosenbrock ROS2", rosenbrock, &[1000.0, 500.0, 250.0, 125.0, 100.0, 50.0]),
    ];
    let tolerances = ["3e-3", "1e-3", "5e-4", "3e-4", "2e-4", "1e-4", "1e-5"];
    let program = |name, program: &Path, heads: &[&[&str]]| {
        let words = heads.iter().flat_map(|head| {
            tolerances.iter().map(|tolerance| {
                head.iter().chain([tolerance, tolerance]).map(|word| (*word).to_owned()).collect::<Vec<_>>()
            })
        });
        let words: Vec<Vec<String>> = words.collect();
        let settings = words.iter().map(|words| {
            let history = if words[0] == "1" { "restarted" } else { "keeping on" };
            format!("{} {history}, {}", words[1], words[2])
        });
        Contender { name, settings: settings.collect(), how: How::Program(program.to_owned(), words.clone()) }
    };
    match sundials(folder) {
        Ok(path) => {
            all.push(program("CVODE BDF, order at most", &path, &[&["0", "5"], &["0", "2"], &["1", "5"], &["1", "2"]]))
        }
        Err(why) => complain("CVODE", &why),
    }
    match diffsol() {
        Ok(path) => {
            let heads: &[&[&str]] = &[&["0", "bdf"], &["0", "tr_bdf2"], &["0", "esdirk34"], &["1", "bdf"]];
            all.push(program("diffsol", &path, heads));
        }
        Err(why) => complain("diffsol", &why),
    }
    all
}

#[expect(clippy::print_stderr, reason = "a bench talks to a person")]
fn complain(name: &str, why: &str) {
    eprintln!("{name} does not compete: {why}");
}

/// Builds the C program.
fn sundials(folder: &Path) -> Result<PathBuf, String> {
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("benches/sundials/chain.c");
    let program = folder.join("chain");
    let libraries =
        ["cvode", "nvecserial", "sunlinsoldense", "sunmatrixdense"].map(|name| format!("-lsundials_{name}"));
    let built = Command::new("cc").arg("-O3").arg("-o").arg(&program).arg(source).args(libraries).arg("-lm").output();
    let built = built.map_err(|why| format!("no C compiler: {why}"))?;
    let said = String::from_utf8_lossy(&built.stderr);
    let first = said.lines().next().unwrap_or_default();
    if built.status.success() { Ok(program) } else { Err(format!("install libsundials-dev ({first})")) }
}

/// Builds the package beside this bench.
fn diffsol() -> Result<PathBuf, String> {
    let package = Path::new(env!("CARGO_MANIFEST_DIR")).join("benches/diffsol");
    let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let target = Path::new(env!("CARGO_MANIFEST_DIR")).join("target/diffsol");
    let mut command = Command::new(cargo);
    command.args(["build", "--release", "--locked", "--manifest-path"]).arg(package.join("Cargo.toml"));
    let built = command.arg("--target-dir").arg(&target).status();
    let built = built.map_err(|why| format!("no cargo: {why}"))?;
    if built.success() {
        Ok(target.join("release/govtwin-diffsol"))
    } else {
        Err("its package does not build".to_owned())
    }
}
