//! `govtwin recover`: every message of a damaged bag that can be saved, in a new bag.

use std::path::{Path, PathBuf};

use anyhow::Context as _;
use govtwin_bag::{BagError, Recovered, Warning};
use govtwin_files::Claim;
use serde_json::json;

use super::output::{print, warn};
use crate::commands::{Outcome, usage};

/// Save every message of a damaged bag into a new bag.
///
/// Reads what `govtwin info` can read: files that were cut short, bags without index or metadata.yaml, broken-off
/// recordings, damaged chunks, compressed bags. Each message is written as it stands, in the order of recording, with its
/// topic, schema, type hash and quality of service; the new bag has checksums, an index and metadata.yaml. The damaged
/// bag is never touched.
#[derive(Debug, clap::Args)]
#[command(after_long_help = HELP)]
pub struct Args {
    /// Bag to recover: a file, a folder, or the name of a recording that was interrupted.
    #[arg(value_name = "BAG")]
    bag: PathBuf,
    /// Folder of the new bag; by default BAG_recovered, or the intended name of an interrupted recording.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Print JSON instead of text.
    #[arg(long)]
    json: bool,
}

const HELP: &str = "\
The damaged bag is not changed. A recorder that is killed leaves `.NAME.unfinished` beside NAME:

  govtwin record --out run         # killed
  govtwin recover run              # reads .run.unfinished, writes run

Exit codes: 0 all messages were saved, 1 not readable as a bag or not writable, 2 wrong usage,
3 saved, but something was lost.";

/// Saves what can be saved.
pub fn run(args: &Args) -> anyhow::Result<Outcome> {
    let source = govtwin_bag::broken_off(&args.bag).unwrap_or_else(|| args.bag.clone());
    let out = args.out.clone().unwrap_or_else(|| place(&source));
    if out == args.bag && args.bag.exists() {
        return Err(usage("--out names the damaged bag itself; name another folder"));
    }
    let _claim = Claim::name(&out).context("--out")?;
    let recovered = govtwin_bag::recover(&source, &out).map_err(|error| match error {
        BagError::InTheWay { path } => {
            anyhow::anyhow!("{}: is there already; name another folder with --out", path.display())
        }
        other => other.into(),
    })?;
    let lost_bytes = recovered.lost_bytes();
    let saved: u64 = recovered.messages.values().sum();
    if args.json {
        let warnings: Vec<String> = recovered.warnings.iter().map(Warning::to_string).collect();
        let value = json!({
            "schema": "govtwin-recover/1", "from": source, "bag": recovered.bag, "messages": recovered.messages,
            "saved": saved, "lost_bytes": lost_bytes, "damage": warnings, "attachments": recovered.attachments,
            "metadata": recovered.metadata, "lost": recovered.lost,
        });
        print(&format!("{value:#}\n"))?;
    } else {
        print(&text(&recovered, &source, saved))?;
        recovered.warnings.iter().for_each(|warning| warn(&warning.to_string()));
        recovered.lost.iter().for_each(|words| warn(&format!("{words}; it is not in the new bag")));
    }
    // A file that only was not finished has lost nothing.
    let is_loss = |warning: &Warning| !matches!(warning, Warning::Damaged { damage, .. } if damage.lost_bytes == 0);
    let lost = lost_bytes > 0 || !recovered.lost.is_empty() || recovered.warnings.iter().any(is_loss);
    Ok(if lost { Outcome::Warnings } else { Outcome::Ok })
}

/// Where the new bag goes by default.
fn place(source: &Path) -> PathBuf {
    if let Some(place) = govtwin_bag::intended_place(source).filter(|place| !place.exists()) {
        return place;
    }
    let name = source.file_stem().unwrap_or(source.as_os_str()).to_string_lossy();
    source.with_file_name(format!("{}_recovered", name.trim_start_matches('.')))
}

fn text(recovered: &Recovered, source: &Path, saved: u64) -> String {
    let mut text = String::new();
    for (topic, count) in &recovered.messages {
        text.push_str(&format!("{topic:<32}{count:>9} saved\n"));
    }
    let lost_bytes = recovered.lost_bytes();
    let lost = if lost_bytes > 0 { format!("; {lost_bytes} bytes could not be read") } else { String::new() };
    text.push_str(&format!("{saved} messages saved{lost}\n"));
    for (what, names) in [("attachment", &recovered.attachments), ("metadata record", &recovered.metadata)] {
        for name in names {
            text.push_str(&format!("{what} `{}` saved\n", super::output::one_line(name)));
        }
    }
    text.push_str(&format!("bag: {}\n", recovered.bag.display()));
    text.push_str(&format!("{} is unchanged; remove it once you have checked the new bag\n", source.display()));
    text
}
