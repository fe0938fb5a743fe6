//! What a replay was made from: the provenance of its report.

use std::path::PathBuf;

use govtwin_correction::shipped;
use govtwin_model::params::Sheet;
use govtwin_model::provenance::Provenance;

use super::super::bags::Mapped;
use super::super::{model, provenance};
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
    made.options.extend([("cut".to_owned(), cut.to_owned()), ("rate-of-inputs".to_owned(), driven.id().to_owned())]);
    let residuals: Vec<PathBuf> = args.residual.iter().filter(|path| !model::is_none(path)).cloned().collect();
    for (name, paths) in [("then", &args.then), ("residual", &residuals)] {
        let files: Vec<String> =
            paths.iter().map(|path| Ok(provenance::file(path)?.to_string())).collect::<anyhow::Result<_>>()?;
        made.options.extend((!files.is_empty()).then(|| (name.to_owned(), files.join(", "))));
    }
    let residual = match shipped {
        Shipped::NotAsked => None,
        Shipped::Used => Some(shipped::file().to_string()),
        Shipped::Unfit(reason) => Some(format!("none: {reason}")),
    };
    made.options.extend(residual.map(|words| ("residual".to_owned(), words)));
    made.options.extend(args.adapt.then(|| ("adapt".to_owned(), "given".to_owned())));
    made.options.extend((!args.require.is_empty()).then(|| ("require".to_owned(), args.require.join(", "))));
    if let Some(path) = &args.against {
        let worse_by = format!("{}, worse by at most {} %", provenance::file(path)?, 100.0 * args.worse_by);
        made.options.insert("against".to_owned(), worse_by);
    }
    provenance::options(&args.topics, &args.map, &mut made)?;
    Ok(made)
}
