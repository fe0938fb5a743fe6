//! Explained fraction as it came true, on recordings that no diagnosis saw.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use govtwin_lab::benchmark::validation;
use govtwin_model::parameters::Unit;
use govtwin_model::params;
use govtwin_model::recording::Recording;

use super::cases::UnitFolder;
use crate::commands::bags::{self, TopicArgs};
use crate::commands::output::Progress;
use crate::commands::report_file::is_there;

/// Fractions by unit, and why others have none; `later` reads or makes the recordings of a unit, none where it has none.
pub fn fractions<T: Sync>(
    units: &[T],
    name: impl Fn(&T) -> &str + Sync,
    later: impl Fn(&T) -> anyhow::Result<Option<Vec<Recording>>> + Sync,
    out: &Path,
) -> (BTreeMap<String, f64>, Vec<String>) {
    let all = Progress::each(units, "explained fractions examined", |unit: &T| {
        (name(unit).to_owned(), fraction(&out.join(name(unit)), || later(unit)))
    });
    let (mut fractions, mut failed) = (BTreeMap::new(), Vec::new());
    for (name, fraction) in all {
        match fraction {
            Ok(fraction) => fractions.extend(fraction.map(|fraction| (name, fraction))),
            Err(error) => failed.push(format!("{name}: explained fraction not examined: {error:#}")),
        }
    }
    (fractions, failed)
}

/// Those of units whose folders have later recordings in the folder `later`.
pub fn of_folders(units: &[UnitFolder], out: &Path, sheet: &Unit) -> (BTreeMap<String, f64>, Vec<String>) {
    let later = |unit: &UnitFolder| {
        let Some(dir) = &unit.later else { return Ok(None) };
        read(dir, &unit.topics, sheet).map(Some)
    };
    fractions(units, |unit| &unit.name, later, out)
}

/// Recordings of a folder as a diagnosis reads them.
pub fn read(dir: &Path, topics: &TopicArgs, sheet: &Unit) -> anyhow::Result<Vec<Recording>> {
    Ok(bags::read(&[PathBuf::from(dir)], &topics.topics(), sheet)?.recordings)
}

/// That of a unit by the twins in its reports; none where they name nothing, or where nobody recorded later.
fn fraction(
    reports: &Path,
    later: impl FnOnce() -> anyhow::Result<Option<Vec<Recording>>>,
) -> anyhow::Result<Option<f64>> {
    let at = |file: &str| -> anyhow::Result<Option<Unit>> {
        let path = reports.join(file);
        Ok(if is_there(&path)? { Some(params::load(&path)?) } else { None })
    };
    let (Some(refitted), Some(improved)) = (at("refitted.yaml")?, at("fitted.yaml")?) else { return Ok(None) };
    if improved.effects.is_empty() {
        return Ok(None);
    }
    Ok(later()?.and_then(|recordings| validation::explained_fraction(recordings, &refitted, &improved)))
}
