//! The files of a diagnosis: report, page, two twins and the next test, and that no other unit's are replaced.

use std::collections::BTreeMap;
use std::path::Path;

use anyhow::{Context, bail};
use govtwin_diagnosis::result::schema::DiagnosisReport;
use govtwin_diagnosis::result::{Diagnosis, Fitted, NEXT_TEST, Verdict};
use govtwin_files::digest::sha256;
use govtwin_files::look_at;
use govtwin_model::parameters::Unit;
use govtwin_model::params::{self, Overlay};
use govtwin_model::provenance::Provenance;
use govtwin_pages::diagnosis as page;

use super::next_test;
use crate::commands::output::Output;
use crate::commands::report_file;

/// The machine-readable report.
pub const REPORT: &str = "report.json";

/// The sheet that was made of the recordings, where no other is known.
pub const ASSUMED: &str = "assumed.yaml";

/// What a diagnosis leaves.
pub const NAMES: [&str; 6] = [REPORT, "report.html", "refitted.yaml", FITTED, NEXT_TEST, ASSUMED];

/// The twin with what the diagnosis names.
pub const FITTED: &str = "fitted.yaml";

/// Refuses a folder that holds the files of another unit: those of a report that shares no recording with this one, or that says of none.
pub fn refuse_to_replace(out: &Path, made: &Provenance) -> anyhow::Result<()> {
    let way_out = "name another folder with --out, or replace them with --overwrite";
    let path = out.join(REPORT);
    let looking = || format!("--out: cannot look at {}", path.display());
    if !look_at(&path).with_context(looking)?.is_some_and(|kind| kind.is_file()) {
        return match NAMES.iter().find(|name| out.join(name).exists()) {
            Some(name) => bail!(
                "--out: {} is there without a {REPORT} beside it, so nobody can tell whose it is; {way_out}",
                out.join(name).display()
            ),
            None => Ok(()),
        };
    }
    let there = match report_file::provenance(&path) {
        Ok(Some(there)) => there,
        Ok(None) => bail!("--out: {} does not say which recordings it is of; {way_out}", path.display()),
        Err(error) => bail!("--out: {} does not say which recordings it is of ({error:#}); {way_out}", path.display()),
    };
    let (old, new) = (there.digests(), made.digests());
    if !old.iter().any(|digest| new.contains(digest)) {
        bail!("--out: {} is the report of `{}`, of other recordings than these; {way_out}", path.display(), there.unit);
    }
    Ok(())
}

/// Writes the files of a report into a folder, with the sheet that was made of the recordings where there is one; hands out the text of the report.
pub fn write(
    mut output: Output,
    diagnosis: &Diagnosis,
    (unit, assumed): (&Unit, Option<&str>),
    made: &Provenance,
    seconds: f64,
) -> anyhow::Result<String> {
    let mut written = BTreeMap::new();
    let mut file = |output: &mut Output, name: &str, bytes: &[u8]| {
        written.insert(name.to_owned(), sha256(bytes));
        output.add(name, bytes)
    };
    let what = "refitted within tolerances, without any effect";
    let text = overlay(&output, "refitted.yaml", &diagnosis.refitted, what, made, &[])?;
    file(&mut output, "refitted.yaml", text.as_bytes())?;
    let what = match diagnosis.verdict {
        Verdict::Named => "refitted with the effects that the diagnosis names",
        Verdict::Class => "refitted with the most probable of the effects that the diagnosis could not tell apart",
        _ => "refitted within tolerances; the diagnosis names no effect",
    };
    let text = overlay(&output, FITTED, &diagnosis.fitted, what, made, &diagnosis.parameters)?;
    file(&mut output, FITTED, text.as_bytes())?;
    match next_test::file(diagnosis, &output.path(NEXT_TEST), &unit.parameters)? {
        Some(script) => file(&mut output, NEXT_TEST, &script)?,
        None => output.remove(NEXT_TEST),
    }
    match assumed {
        Some(text) => file(&mut output, ASSUMED, text.as_bytes())?,
        None => output.remove(ASSUMED),
    }
    let mut report = DiagnosisReport::of(diagnosis, seconds);
    // By its digest a file is known as the one of this report.
    report.provenance = Some(Provenance { written, ..made.clone() });
    report.evidence.traces = page::kept_traces(&diagnosis.traces);
    let json = format!("{:#}\n", report.json());
    output.add("report.html", page::page(diagnosis, made).to_html().as_bytes())?;
    output.add(REPORT, json.as_bytes())?;
    output.place()?;
    Ok(json)
}

fn overlay(
    output: &Output,
    name: &str,
    unit: &Unit,
    what: &str,
    made: &Provenance,
    parameters: &[Fitted],
) -> anyhow::Result<String> {
    let mut unit = unit.clone();
    unit.own_effects.retain(|own| unit.effects.iter().any(|setting| setting.id == own.id));
    let comments: BTreeMap<String, String> = parameters
        .iter()
        .filter(|one| one.name.contains('.'))
        .map(|one| (one.name.clone(), format!("90 %: {:.4e} to {:.4e} {}", one.value.low, one.value.high, one.unit)))
        .collect();
    let head = [vec![format!("The unit {what}.")], made.comments()].concat();
    let overlay = Overlay { unit, name: String::new(), source: "govtwin diagnose".to_owned(), head, comments };
    Ok(params::overlay_text(&output.path(name), &overlay)?)
}
