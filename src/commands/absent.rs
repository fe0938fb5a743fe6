//! Commands that a build does not have: whatever their arguments are, the answer is which build has them.

use super::Outcome;

/// Any arguments.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[arg(hide = true, trailing_var_arg = true, allow_hyphen_values = true)]
    _anything: Vec<String>,
}

/// Says which build has a command.
pub fn run(command: &str, feature: &str) -> anyhow::Result<Outcome> {
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
