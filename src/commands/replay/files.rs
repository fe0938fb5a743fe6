//! What a replay leaves in a folder: page, figures, and a bag beside each recording.

use std::path::Path;

use govtwin_bag::{Interpolation, Sealed};
use govtwin_diagnosis::replay_summary::ReplaySummary;
use govtwin_diagnosis::replay_validation::{Check, Validation};
use govtwin_files::remove_stale;
use govtwin_model::parameters::Unit;
use govtwin_model::replay::Replayed;
use govtwin_model::twin::Twin;
use govtwin_pages::replay::{Beside, Pictures, page};
use rayon::iter::{IndexedParallelIterator, IntoParallelRefIterator, ParallelIterator};

use super::ladder::After;
use super::node_run::NodeRun;
use super::{Args, FIGURES, PAGE, Result, options, rows, simulated};
use crate::commands::bags::Bag;
use crate::commands::output::{Output, Progress, print};

/// Nothing may be replaced by the bags that are written but bags of an earlier replay: neither what is read, nor others, nor one another.
pub fn refuse_to_overwrite(out: &Path, bags: &[Bag]) -> anyhow::Result<()> {
    for bag in bags {
        if let Some(inner) = bags.iter().find(|other| *other != bag && Path::new(&other.name).starts_with(&bag.name)) {
            anyhow::bail!(
                "--out {}: the simulated bag {} of {} would lie inside {} of {}; replay the two apart",
                out.display(),
                inner.name,
                inner.path.display(),
                bag.name,
                bag.path.display()
            );
        }
        let target = out.join(&bag.name);
        if let (Ok(from), Ok(to)) = (bag.path.canonicalize(), target.canonicalize())
            && from.starts_with(&to)
        {
            anyhow::bail!(
                "--out {}: the simulated bag would take the place of {}, which is read; choose another folder",
                out.display(),
                bag.path.display()
            );
        }
        simulated::check(&target)?;
        if let Some(folder) = target.parent() {
            remove_stale(folder);
        }
    }
    Ok(())
}

/// Writes the simulated bag of a replay, anew where not all of its rows were kept.
fn write_bag(bag: &Bag, dir: &Path, one: &Result, unit: &Unit, args: &Args) -> anyhow::Result<Sealed> {
    let topics = args.topics.topics();
    let (replayed, about) = (&one.replayed, &one.about);
    if replayed.every == 1 {
        return simulated::write(&bag.path, dir, replayed, &topics, about);
    }
    // Only a replay row by row leaves rows out, and there inputs hold.
    let options = options(args, Interpolation::Hold, unit);
    let mut twin = Twin::new(unit).with_cut(args.cut.cut());
    let measured = replayed.scores.are_measured();
    if let Some(sealed) = rows::write((&bag.path, about), dir, &options, &mut twin, measured, &topics)? {
        return Ok(sealed);
    }
    let recording = govtwin_bag::read(&bag.path, &options)?.recording;
    simulated::write(&bag.path, dir, &Replayed::new(&mut twin, recording), &topics, about)
}

/// Writes the bags, the page and the figures.
pub fn write_all(
    mut output: Output,
    summary: &ReplaySummary,
    results: &[Result],
    bags: &[Bag],
    unit: &Unit,
    (after, node_run): (Option<&After>, Option<&NodeRun>),
    args: &Args,
) -> anyhow::Result<()> {
    let written = Progress::each(results.par_iter().zip(bags), "bags written", |(one, bag)| {
        write_bag(bag, &output.path(&bag.name), one, unit, args)
    });
    output.add_bags(written.into_iter().collect::<anyhow::Result<Vec<_>>>()?);
    let replayed: Vec<&Replayed> = results.iter().map(|one| &one.replayed).collect();
    let pictures = draw(results, summary, unit, after);
    let mut page = page(summary, &replayed, &pictures, &unit.sensors);
    if let Some(run) = node_run {
        run.show(&mut page.body);
    }
    let html_path = output.path(PAGE);
    output.add(PAGE, page.to_html().as_bytes())?;
    output.add_json(FIGURES, summary)?;
    output.place()?;
    if args.json { Ok(()) } else { print(&format!("Page: {}\n", html_path.display())) }
}

/// The pictures of all recordings, in their order.
fn draw(results: &[Result], summary: &ReplaySummary, unit: &Unit, after: Option<&After>) -> Vec<Pictures> {
    let then = |at: usize| {
        let after = after?;
        Some(Beside::Unit { title: &after.title, replayed: after.replayed.get(at)? })
    };
    let drawn = results.par_iter().enumerate().map(|(at, one)| {
        let corrected = one.corrected.as_ref().map(|corrected| Beside::Residual {
            signal: corrected.signal,
            replayed: &corrected.replayed,
            half_width: &corrected.half_width,
            coverage_share: corrected.coverage_share,
        });
        let pictures = Pictures::draw(&one.replayed, then(at).or(corrected), &unit.sensors);
        let broken = summary.validation.iter().flat_map(Validation::broken);
        let broken: Vec<&Check> = broken.filter(|check| check.recording == Some(at)).collect();
        pictures.with_broken(one.judged(), &broken, &unit.sensors)
    });
    drawn.collect()
}
