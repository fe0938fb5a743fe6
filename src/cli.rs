//! Parse, dispatch, and turn the outcome into an exit code.

use std::process::ExitCode;
use std::sync::LazyLock;

use anyhow::Context as _;
use clap::{CommandFactory as _, Parser, Subcommand};

use crate::commands;
use crate::commands::{Outcome, Usage};

/// What `--version` prints; `-V` prints the number alone.
static LONG_VERSION: LazyLock<String> = LazyLock::new(|| {
    let version = env!("CARGO_PKG_VERSION");
    #[cfg(feature = "node")]
    let built_for = govtwin_node::environment::Distribution::of_build().words();
    #[cfg(feature = "node")]
    let text = format!("{version}, the node for {built_for}\n{}", govtwin_node::transport::DESCRIPTION);
    #[cfg(not(feature = "node"))]
    let text = format!("{version}, built without the node");
    text
});

/// Simulate the servo system of a hydro-turbine governor, and diagnose why a real unit differs from it.
#[derive(Debug, Parser)]
#[command(version, long_version = LONG_VERSION.as_str(), arg_required_else_help = true, after_long_help = HELP)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

const HELP: &str = "\
Examples:
  govtwin replay bags/reference --out look     # measured against simulated signals, as a page
  govtwin diagnose bags/practice/case_03       # why this unit differs from its twin
  govtwin run --optional esv tank_pressure     # the twin as a ROS 2 node, driven by a command

`govtwin COMMAND --help` describes all options of a command.

Exit codes: 0 ok, 1 error, 2 wrong usage, 3 finished with warnings, 4 a limit of `replay` is broken.";

#[derive(Debug, Subcommand)]
enum Command {
    /// Measure a unit against acceptance limits, as found and without each of its faults.
    Accept(commands::accept::Args),
    /// Diagnose every unit of a folder, and score the verdicts if the true faults are known.
    #[cfg(feature = "lab")]
    #[command(visible_alias = "benchmark")]
    Blind(commands::blind::Args),
    /// Diagnose every unit of a folder, and score the verdicts if the true faults are known (not in this build).
    #[cfg(not(feature = "lab"))]
    #[command(visible_alias = "benchmark")]
    Blind(Absent),
    /// Learn the numbers of the posterior from diagnosed units whose faults are known.
    #[cfg(feature = "lab")]
    Calibrate(commands::calibrate::Args),
    /// Learn the numbers of the posterior from diagnosed units whose faults are known (not in this build).
    #[cfg(not(feature = "lab"))]
    Calibrate(Absent),
    /// Validate a parameter file, and print the unit that it describes.
    Check(commands::check::Args),
    /// Diagnose why a unit differs from its twin: where, which effect, and how much it explains.
    Diagnose(commands::diagnose::Args),
    /// Check the integrity of bags, and report how to repair damaged ones.
    Doctor(commands::doctor::Args),
    /// List the effects that a real unit may show beyond the nominal model, or document one of them.
    Effects(commands::effects::Args),
    /// Fit parameters and chosen effects to recordings, and report how well the recordings determine them.
    Fit(commands::fit::Args),
    /// Diagnose many units over many periods on any engine that runs commands, and gather the results.
    Fleet(commands::fleet::Args),
    /// Generate synthetic recordings of the four processes, to test a bench or a diagnosis.
    Generate(commands::generate::Args),
    /// Convert a plant's recordings to a bag: CSV, Parquet, or bags with other types.
    Import(commands::import::Args),
    /// Report what a bag contains: topics, types, counts, rates, gaps, health.
    Info(commands::info::Args),
    /// Save every readable message of a damaged or unfinished bag into a new bag.
    Recover(commands::recover::Args),
    /// Simulate recordings, and compare simulated with measured signals.
    Replay(commands::replay::Args),
    /// Make a data sheet (parameter file) from a name plate.
    Sheet(commands::sheet::Args),
    /// Make the page of a diagnosis again from its JSON report.
    Report(commands::report::Args),
    /// Train a learned correction of the twin, the residual model of `replay` and `run`.
    #[cfg(feature = "residual")]
    Train(commands::train::Args),
    /// Train a learned correction of the twin, the residual model of `replay` and `run` (not in this build).
    #[cfg(not(feature = "residual"))]
    Train(Absent),
    /// Compare the twin, data-only models and hybrids, as in Liu et al. 2025.
    #[cfg(feature = "residual")]
    Compare(commands::compare::Args),
    /// Compare the twin, data-only models and hybrids, as in Liu et al. 2025 (not in this build).
    #[cfg(not(feature = "residual"))]
    Compare(Absent),
    /// Run the twin as a ROS 2 node.
    #[cfg(feature = "node")]
    Run(commands::run::Args),
    /// Run the twin as a ROS 2 node (not in this build).
    #[cfg(not(feature = "node"))]
    Run(Absent),
    /// Publish a recording over DDS with its timing.
    #[cfg(feature = "node")]
    Play(commands::play::Args),
    /// Publish a recording over DDS with its timing (not in this build).
    #[cfg(not(feature = "node"))]
    Play(Absent),
    /// Record topics from DDS into a bag.
    #[cfg(feature = "node")]
    Record(commands::record::Args),
    /// Record topics from DDS into a bag (not in this build).
    #[cfg(not(feature = "node"))]
    Record(Absent),
    /// Watch a unit: diagnose each process that it records, and warn when a fault has grown.
    Watch(commands::watch::Args),
    /// Print the completion script of a shell for commands, options and values.
    Completions(commands::completions::Args),
    /// Print the manual page, or write one for every command.
    Man(commands::man::Args),
}

/// Arguments of a command that this build does not have: whatever they are, the answer is which build has it.
#[cfg(not(all(feature = "lab", feature = "residual", feature = "node")))]
#[derive(Debug, clap::Args)]
struct Absent {
    #[arg(hide = true, trailing_var_arg = true, allow_hyphen_values = true)]
    _anything: Vec<String>,
}

/// Which build has a command.
#[cfg(not(all(feature = "lab", feature = "residual", feature = "node")))]
fn absent(command: &str, feature: &str) -> anyhow::Result<Outcome> {
    let needs = match feature {
        "residual" => "it needs CMake 3.28, a C++ compiler and libclang, which scripts/test sets up",
        "lab" => "it is the laboratory, which measures the program and is no part of it",
        _ => "it needs Linux, and is in the default build",
    };
    anyhow::bail!(
        "`govtwin {command}` is not in this build, which was made without the cargo feature `{feature}`; `cargo install --path . --features \
         {feature}` makes one that has it ({needs})"
    )
}

/// Starts the threads that share the work: where there is no room for them their library would end the process amid it.
fn start_threads(command: &Command) -> anyhow::Result<()> {
    #[cfg(feature = "node")]
    if matches!(command, Command::Run(_) | Command::Play(_) | Command::Record(_)) {
        // The node's threads are its own.
        return Ok(());
    }
    if matches!(command, Command::Completions(_) | Command::Man(_)) {
        return Ok(());
    }
    let started = rayon::ThreadPoolBuilder::new().build_global();
    started.context("cannot start the threads that share the work; RAYON_NUM_THREADS=1 asks for one alone, and `ulimit -a` says what is limited")
}

/// Runs the command line; exit codes: 0 ok, 1 error, 2 usage, 3 finished with warnings, 4 a limit is broken.
pub fn main() -> ExitCode {
    commands::output::hear_of_file_sizes();
    let command = Cli::try_parse().unwrap_or_else(|told| commands::output::leave(&told)).command;
    if let Err(error) = commands::parent::follow().and_then(|()| start_threads(&command)) {
        commands::output::fail(&error);
        return ExitCode::FAILURE;
    }
    let outcome = match command {
        Command::Accept(args) => commands::accept::run(&args),
        #[cfg(feature = "lab")]
        Command::Blind(args) => commands::blind::run(&args),
        #[cfg(not(feature = "lab"))]
        Command::Blind(_) => absent("blind", "lab"),
        #[cfg(feature = "lab")]
        Command::Calibrate(args) => commands::calibrate::run(&args),
        #[cfg(not(feature = "lab"))]
        Command::Calibrate(_) => absent("calibrate", "lab"),
        Command::Diagnose(args) => commands::diagnose::run(&args),
        Command::Check(args) => commands::check::run(&args),
        Command::Doctor(args) => commands::doctor::run(&args),
        Command::Effects(args) => commands::effects::run(&args),
        Command::Fit(args) => commands::fit::run(&args),
        Command::Fleet(args) => commands::fleet::run(&args),
        Command::Generate(args) => commands::generate::run(&args),
        Command::Import(args) => commands::import::run(&args),
        Command::Info(args) => commands::info::run(&args),
        Command::Recover(args) => commands::recover::run(&args),
        Command::Replay(args) => commands::replay::run(&args),
        Command::Sheet(args) => commands::sheet::run(&args),
        Command::Report(args) => commands::report::run(&args),
        Command::Watch(args) => commands::watch::run(&args),
        Command::Completions(args) => commands::completions::run(&args, Cli::command()),
        Command::Man(args) => commands::man::run(&args, Cli::command()),
        #[cfg(not(feature = "residual"))]
        Command::Train(_) => absent("train", "residual"),
        #[cfg(not(feature = "residual"))]
        Command::Compare(_) => absent("compare", "residual"),
        #[cfg(not(feature = "node"))]
        Command::Run(_) => absent("run", "node"),
        #[cfg(not(feature = "node"))]
        Command::Play(_) => absent("play", "node"),
        #[cfg(not(feature = "node"))]
        Command::Record(_) => absent("record", "node"),
        #[cfg(feature = "residual")]
        Command::Train(args) => commands::train::run(&args),
        #[cfg(feature = "residual")]
        Command::Compare(args) => commands::compare::run(&args),
        #[cfg(feature = "node")]
        Command::Run(args) => commands::run::run(&args),
        #[cfg(feature = "node")]
        Command::Play(args) => commands::play::run(&args),
        #[cfg(feature = "node")]
        Command::Record(args) => commands::record::run(&args),
    };
    match outcome {
        Ok(Outcome::Ok) => ExitCode::SUCCESS,
        Ok(Outcome::Warnings) => ExitCode::from(3),
        Ok(Outcome::Failed) => ExitCode::from(4),
        Err(error) => {
            commands::output::fail(&error);
            if error.downcast_ref::<Usage>().is_some() { ExitCode::from(2) } else { ExitCode::FAILURE }
        }
    }
}
