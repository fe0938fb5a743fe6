//! `govtwin report`: the page of a diagnosis again from its JSON.

use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use govtwin_diagnosis::result::schema::SCHEMA;
use govtwin_files::{Claim, check_regular, folder_of, is_same};
use govtwin_model::provenance::Provenance;
use govtwin_pages::diagnosis as page;

use super::output::{check_place, claim_place, print, width, write_atomically};
use super::report_file;
use crate::commands::Outcome;

/// Arguments of `govtwin report`.
#[derive(Debug, clap::Args)]
#[command(after_long_help = HELP)]
pub struct Args {
    /// Report of a diagnosis, report.json.
    #[arg(value_name = "FILE.json")]
    report: PathBuf,
    /// Page to write [default: FILE.html beside the report].
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Print the report itself, as `govtwin diagnose --json` does.
    #[arg(long)]
    json: bool,
}

const HELP: &str = "\
Prints the summary that `govtwin diagnose` prints, and writes its page: for a report without a page,
or to get the page in the wording of a newer program. A report contains the signals of the recording
with the largest error; only these are plotted.

Example:
  govtwin report diagnosis/case_03/report.json --out case_03.html    # after `diagnose`

Exit codes: 0 ok, 1 not possible, 2 wrong usage.";

/// Prints the summary and writes the page.
pub fn run(args: &Args) -> anyhow::Result<Outcome> {
    let shown = args.report.display();
    let out = args.out.clone().unwrap_or_else(|| args.report.with_extension("html"));
    if is_same(&out, &args.report) {
        bail!("--out: {}: the page would replace the report itself; name another file", out.display());
    }
    check_regular(&args.report).with_context(|| format!("cannot read {shown}"))?;
    let _claim = claim(&args.report, &out)?;
    let report: serde_json::Value = serde_json::from_str(&report_file::text(&args.report)?).with_context(|| {
        format!("{shown}: expected JSON as `govtwin diagnose` writes it to report.json, found something else")
    })?;
    let schema = report["schema"].as_str().unwrap_or_default();
    if schema.is_empty() {
        bail!("{shown}: expected a report of the schema {SCHEMA}, found JSON that states none");
    }
    if schema == govtwin_diagnosis::replay_summary::SCHEMA {
        bail!(
            "{shown} holds the figures of a replay; its pictures come from the bags: `govtwin replay --out DIR BAG` makes them again"
        );
    }
    let mut read = report_file::of_json(&report, &args.report)?;
    let made = read.provenance.take().unwrap_or_else(|| Provenance {
        warnings: vec!["the report does not say what it was made from".to_owned()],
        ..Provenance::default()
    });
    let diagnosis = read.into();
    let html = page::page(&diagnosis, &made).to_html();
    write_atomically(&out, html.as_bytes())?;
    let text = if args.json {
        format!("{report:#}\n")
    } else {
        format!("{}\npage: {}\n", page::summary(&diagnosis, width()), out.display())
    };
    print(&text)?;
    Ok(Outcome::Ok)
}

/// Claims the place of the page before the report is read: beside the report the whole folder, since a diagnosis would replace both.
fn claim(report: &Path, page: &Path) -> anyhow::Result<Claim> {
    if !is_same(folder_of(report), folder_of(page)) {
        return claim_place("--out", page);
    }
    let claim = Claim::folder(folder_of(page)).context("--out")?;
    check_place("--out", page)?;
    Ok(claim)
}
