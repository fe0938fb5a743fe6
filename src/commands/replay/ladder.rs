//! `replay --then`: the same recordings through further units and residuals, from rung to rung.

use std::path::Path;

use govtwin_correction::model::{Model, fingerprint};
use govtwin_diagnosis::replay_summary::{RecordingSource, ReplaySummary, summarise};
use govtwin_model::parameters::Unit;
use govtwin_model::params;
use govtwin_model::replay::Replayed;
use govtwin_model::replay::ladder::{Ladder, Rung};
use govtwin_model::signal::Signal;
use govtwin_model::twin::Twin;
use rayon::iter::{IntoParallelRefIterator, ParallelIterator};

use super::{Args, Result, residual};
use crate::commands::output::Progress;

/// One unit of the ladder with what it says of every recording.
struct Unitary {
    title: String,
    unit: Unit,
    replayed: Vec<Replayed>,
}

/// The last unit of the ladder, for pictures of before and after.
pub struct After {
    /// What it is called.
    pub title: String,
    /// What it makes of every recording.
    pub replayed: Vec<Replayed>,
}

/// Climbs the ladder, and hands out its last unit where there are several: the unit as given, those of `--then`, and each model on top of the unit that it was trained for.
pub fn climb(
    args: &Args,
    unit: &Unit,
    models: &[(&Path, Model)],
    results: &[Result],
    plain: &ReplaySummary,
) -> anyhow::Result<(Ladder, Option<After>)> {
    let given: Vec<Replayed> = results.iter().map(|one| one.replayed.clone()).collect();
    let first = args.params.as_deref().map_or_else(|| "as shipped".to_owned(), title);
    let mut units = vec![Unitary { title: first, unit: unit.clone(), replayed: given }];
    let progress = Progress::new(args.then.len() + models.len(), "units and models");
    for path in &args.then {
        let unit = params::load(path)?;
        let twin = Twin::new(&unit).with_cut(args.cut.cut());
        let replay = |one: &Result| Replayed::new(&mut twin.clone(), one.replayed.recording.clone());
        let replayed = results.par_iter().map(replay).collect();
        units.push(Unitary { title: title(path), unit, replayed });
        progress.step();
    }
    let rung = |title: String, replayed: &[Replayed]| {
        let source = RecordingSource::default();
        let together: Vec<_> = replayed.iter().map(|one| (one, &source)).collect();
        let whole = summarise(plain.parameters.clone(), args.cut.cut(), plain.inputs_between_samples, &together);
        Rung { title, model: None, unseen: vec![], processes: whole.processes, overall: whole.overall }
    };
    let mut rungs: Vec<Rung> = units.iter().map(|one| rung(one.title.clone(), &one.replayed)).collect();
    let mut signal = Signal::SpoolPosition;
    for (path, model) in models {
        let own = units.iter().find(|one| fingerprint(&one.unit) == model.twin);
        // If it fits none, the message is that of the first unit.
        let own = own.unwrap_or(&units[0]);
        let corrector = residual::ready(model, &own.unit, args.cut.cut())?;
        signal = corrector.signal();
        let replayed = own.replayed.par_iter().map(|one| residual::correct(&corrector, one).replayed);
        let replayed: Vec<Replayed> = replayed.collect();
        let stem = title(path);
        rungs.push(Rung {
            model: Some(path.display().to_string()),
            unseen: model.left_out().map(str::to_owned).collect(),
            ..rung(format!("{} + {stem}", own.title), &replayed)
        });
        progress.step();
    }
    drop(progress);
    let last = units.pop().filter(|_| !args.then.is_empty());
    let after = last.map(|Unitary { title, replayed, .. }| After { title, replayed });
    Ok((Ladder::new(signal, rungs), after))
}

/// What a file is called in tables: its name without folders; the folder's too where every diagnosis writes the same name.
fn title(path: &Path) -> String {
    let name = path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned();
    let usual = ["fitted.yaml", "refitted.yaml", "model.residual"].contains(&name.as_str());
    match path.parent().and_then(Path::file_name).filter(|_| usual) {
        Some(folder) => format!("{}/{name}", folder.to_string_lossy()),
        None => name,
    }
}
