//! `replay --run`: how punctual the node was that ran while a recording was made, for its page.

use std::path::Path;

use anyhow::Context;
use govtwin_model::number::significant;
use govtwin_pages::page::PageBody;
use govtwin_pages::table::Table;
use serde::Deserialize;

/// Larger files are no figures of a run.
const LARGEST_BYTES: u64 = 1 << 20;

/// What `govtwin run --out` writes, as far as it is shown.
#[derive(Deserialize)]
pub struct NodeRun {
    #[serde(rename = "loop")]
    figures: LoopFigures,
}

#[derive(Deserialize)]
struct LoopFigures {
    ticks: u64,
    overruns: u64,
    skipped: u64,
    lateness: Percentiles,
    work: Percentiles,
}

#[derive(Deserialize)]
#[expect(clippy::struct_field_names, reason = "the names in the file")]
struct Percentiles {
    p50_us: f64,
    p99_us: f64,
    p99_9_us: f64,
    max_us: f64,
}

impl NodeRun {
    /// Reads the figures.
    pub fn read(path: &Path) -> anyhow::Result<Self> {
        let named = || format!("--run {}: expected the figures of one unit by `govtwin run --out`", path.display());
        serde_json::from_slice(&govtwin_files::read_bytes(path, LARGEST_BYTES).with_context(named)?).with_context(named)
    }

    /// Shows them.
    pub fn show(&self, body: &mut PageBody) {
        let LoopFigures { ticks, overruns, skipped, lateness, work } = &self.figures;
        let mut table = Table::new().words("µs");
        for name in ["median", "99 %", "99.9 %", "largest"] {
            table = table.numbers(name);
        }
        for (name, row) in [("wake-up after the deadline", lateness), ("work of a tick", work)] {
            let figures = [row.p50_us, row.p99_us, row.p99_9_us, row.max_us].map(|us| significant(us, 3));
            table.row([vec![name.to_owned()], figures.to_vec()].concat());
        }
        body.heading("Punctuality of the node");
        body.table(table, format!("{ticks} ticks, {overruns} of them longer than their period, {skipped} left out."));
    }
}
