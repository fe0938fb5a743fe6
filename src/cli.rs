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
    /// Diagnose every unit of a folder, and score the verdicts if the true faults are known
    #[cfg_attr(not(feature = "lab"), doc = "(not in this build)")]
    #[command(visible_alias = "benchmark")]
    Blind(commands::blind::Args),
    /// Learn the numbers of the posterior from diagnosed units whose faults are known
    #[cfg_attr(not(feature = "lab"), doc = "(not in this build)")]
    Calibrate(commands::calibrate::Args),
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
    /// Train a learned correction of the twin, the residual model of `replay` and `run`
    #[cfg_attr(not(feature = "residual"), doc = "(not in this build)")]
    Train(commands::train::Args),
    /// Compare the twin, data-only models and hybrids, as in Liu et al. 2025
    #[cfg_attr(not(feature = "residual"), doc = "(not in this build)")]
    Compare(commands::compare::Args),
    /// Run the twin as a ROS 2 node
    #[cfg_attr(not(feature = "node"), doc = "(not in this build)")]
    Run(commands::run::Args),
    /// Publish a recording over DDS with its timing
    #[cfg_attr(not(feature = "node"), doc = "(not in this build)")]
    Play(commands::play::Args),
    /// Record topics from DDS into a bag
    #[cfg_attr(not(feature = "node"), doc = "(not in this build)")]
    Record(commands::record::Args),
    /// Watch a unit: diagnose each process that it records, and warn when a fault has grown.
    Watch(commands::watch::Args),
    /// Print the completion script of a shell for commands, options and values.
    Completions(commands::completions::Args),
    /// Print the manual page, or write one for every command.
    Man(commands::man::Args),
}

/// Starts the threads that share the work: where there is no room for them their library would end the process amid it.
fn start_threads(command: &Command) -> anyhow::Result<()> {
    // The node's threads are its own.
    let is_node = matches!(command, Command::Run(_) | Command::Play(_) | Command::Record(_));
    if is_node || matches!(command, Command::Completions(_) | Command::Man(_)) {
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
        Command::Blind(args) => commands::blind::run(&args),
        Command::Calibrate(args) => commands::calibrate::run(&args),
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
        Command::Train(args) => commands::train::run(&args),
        Command::Compare(args) => commands::compare::run(&args),
        Command::Run(args) => commands::run::run(&args),
        Command::Play(args) => commands::play::run(&args),
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
