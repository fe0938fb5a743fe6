//! `govtwin completions`: what a shell needs to complete commands, options and values.

use clap::Command;
use clap_complete::{Shell, generate};

use crate::commands::Outcome;
use crate::commands::output::print;

/// Arguments of `govtwin completions`.
#[derive(Debug, clap::Args)]
#[command(after_long_help = HELP)]
pub struct Args {
    /// Shell for which to print the script.
    #[arg(value_name = "SHELL", value_enum)]
    shell: Shell,
}

const HELP: &str = "\
Prints the script to standard output. Where shells look for it:
  bash  govtwin completions bash > ~/.local/share/bash-completion/completions/govtwin
  zsh   govtwin completions zsh > ~/.zfunc/_govtwin    # with fpath+=~/.zfunc before compinit
  fish  govtwin completions fish > ~/.config/fish/completions/govtwin.fish
The Debian package installs these scripts.

Exit codes: 0 ok, 2 wrong usage.";

/// Prints the script of a shell.
pub fn run(args: &Args, mut command: Command) -> anyhow::Result<Outcome> {
    let mut script = Vec::new();
    generate(args.shell, &mut command, "govtwin", &mut script);
    print(&String::from_utf8(script)?)?;
    Ok(Outcome::Ok)
}
