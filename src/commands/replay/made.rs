//! What a replay was made from: the provenance of its report.

use govtwin_correction::shipped;
use govtwin_model::params::Sheet;
use govtwin_model::provenance::Provenance;

use super::super::bags::Mapped;
use super::super::model;
use super::super::provenance::{self, note, note_files};
use super::residual::{Driven, Shipped};
use super::{Args, Result};

/// What the figures are made from.
pub(super) fn describe(
    args: &Args,
    sheet: &Sheet,
    (driven, shipped): (Driven, &Shipped),
    mapped: &Mapped,
    results: &[Result],
) -> anyhow::Result<Provenance> {
    let mut made = provenance::new("replay", sheet, None)?;
    made.unit = provenance::unit_of(&args.bags);
    made.recordings = provenance::inputs(&results.iter().map(|one| one.read.clone()).collect::<Vec<_>>(), mapped)?;
    let said = results.iter().flat_map(|one| {
        let name = &one.replayed.recording.name;
        one.source.warnings.iter().map(move |warning| format!("{name}: {warning}"))
    });
    made.warnings = mapped.warnings.iter().cloned().chain(said).collect();
    let cut = govtwin_diagnosis::replay_summary::cut_id(args.cut.cut());
    note(&mut made, "cut", [cut]);
    note(&mut made, "rate-of-inputs", [driven.id()]);
    note_files(&mut made, "then", &args.then)?;
    note_files(&mut made, "residual", args.residual.iter().filter(|path| !model::is_none(path)))?;
    let residual = match shipped {
        Shipped::NotAsked => None,
        Shipped::Used => Some(shipped::file().to_string()),
        Shipped::Unfit(reason) => Some(format!("none: {reason}")),
    };
    note(&mut made, "residual", residual);
    note(&mut made, "adapt", args.adapt.then_some("given"));
    note(&mut made, "require", &args.require);
    if let Some(path) = &args.against {
        let worse_by = format!("{}, worse by at most {} %", provenance::file(path)?, 100.0 * args.worse_by);
        note(&mut made, "against", [worse_by]);
    }
    provenance::options(&args.topics, &args.map, &mut made)?;
    Ok(made)
}
