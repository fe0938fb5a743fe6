//! `govtwin man`: the manual pages, made from the text of `--help`.

use std::path::PathBuf;

use anyhow::Context;
use clap::Command;
use clap_mangen::Man;

use crate::commands::Outcome;
use crate::commands::output::{Output, print};

/// Arguments of `govtwin man`.
#[derive(Debug, clap::Args)]
#[command(after_long_help = HELP)]
pub struct Args {
    /// Folder for govtwin.1 and a page for every command; without it, govtwin.1 is printed.
    ///
    /// Pages are called govtwin-COMMAND.1, such as govtwin-diagnose.1 or govtwin-fleet-plan.1.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
}

const HELP: &str = "\
The Debian package installs these pages.

Examples:
  govtwin man | man -l -
  govtwin man --out ~/.local/share/man/man1    # then `man govtwin-diagnose`

Exit codes: 0 ok, 1 not possible, 2 wrong usage.";

/// Prints or writes the pages.
pub fn run(args: &Args, command: Command) -> anyhow::Result<Outcome> {
    // `help` has no page that another could lead to.
    let of_pages = |of: Command| of.disable_help_subcommand(true);
    let mut command = of_pages(command).mut_subcommands(of_pages);
    command.build();
    let Some(out) = &args.out else {
        print(&page(command)?)?;
        return Ok(Outcome::Ok);
    };
    let mut pages = vec![("govtwin.1".to_owned(), page(command.clone())?)];
    pages_below(&command, "govtwin", &mut pages)?;
    let names: Vec<&str> = pages.iter().map(|(name, _)| name.as_str()).collect();
    let mut output = Output::claim(out, &names)?;
    for (name, text) in &pages {
        output.add(name, text.as_bytes())?;
    }
    output.place()?;
    print(&format!("{}: {} pages\n", out.display(), pages.len()))?;
    Ok(Outcome::Ok)
}

/// A page for each command below one, `fleet plan` like `fleet`.
fn pages_below(command: &Command, name: &str, pages: &mut Vec<(String, String)>) -> anyhow::Result<()> {
    for of in command.get_subcommands().filter(|of| !of.is_hide_set() && of.get_name() != "help") {
        let name = format!("{name}-{}", of.get_name());
        pages.push((format!("{name}.1"), page(of.clone().display_name(&name))?));
        pages_below(of, &name, pages)?;
    }
    Ok(())
}

fn page(command: Command) -> anyhow::Result<String> {
    let mut page = Vec::new();
    let title = command.get_display_name().unwrap_or("govtwin").to_owned();
    Man::new(command).title(title).render(&mut page).context("cannot write the manual page")?;
    Ok(String::from_utf8(page)?)
}
