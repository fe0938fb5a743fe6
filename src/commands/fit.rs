//! `govtwin fit`: parameters and chosen effects fitted to recordings by bounded, prior-weighted least squares.

mod figures;
mod serve;

use std::collections::BTreeMap;
use std::path::PathBuf;

use anyhow::{Context, bail};
use govtwin_diagnosis::identification::calibration::{Calibration, PARTS, calibrate};
use govtwin_diagnosis::identification::free_parameter::FreeParameter;
use govtwin_diagnosis::likelihood::noise;
use govtwin_diagnosis::likelihood::prepared::PreparedRecording;
use govtwin_diagnosis::likelihood::problem::Problem;
use govtwin_diagnosis::likelihood::qualification::{QualifiedRecordings, qualify_all};
use govtwin_diagnosis::model::FittedModel;
use govtwin_diagnosis::result::StageFigure;
use govtwin_diagnosis::stage_alone::plain::plain;
use govtwin_diagnosis::stage_alone::run::Run;
use govtwin_diagnosis::stage_alone::sheetless::sheetless;
use govtwin_diagnosis::stage_only::stage_figures::stage_figures;
use govtwin_model::parameters::{ENTRIES, Unit};
use govtwin_model::params::{self, Overlay, Sheet, number_text};
use govtwin_model::provenance::Provenance;
use govtwin_model::recording::Recording;
use govtwin_model::twin::Cut;

use super::bags::{self, MapArgs, Mapped, Recordings, StageWanted, TopicArgs};
use super::generate::effect;
use super::output::{Output, Progress, print, warn_all};
use super::provenance;
use crate::commands::{Outcome, sheet_of, unknown};

/// Arguments of `govtwin fit`.
#[derive(Debug, clap::Args)]
#[command(after_long_help = HELP)]
pub struct Args {
    /// Bags: files, bag folders, or folders that contain bags.
    #[arg(value_name = "BAG", required = true)]
    bags: Vec<PathBuf>,
    #[command(flatten)]
    topics: TopicArgs,
    #[command(flatten)]
    map: MapArgs,
    /// Data sheet (parameter file) of the unit.
    ///
    /// Without it, recordings with a command are fitted with the shipped reference unit, and recordings of a
    /// servomotor stage alone are fitted freely, from positions in any unit.
    #[arg(long, value_name = "FILE")]
    params: Option<PathBuf>,
    /// Also fit this effect, of `govtwin effects` or of the parameter file; may be repeated.
    #[arg(long = "effect", value_name = "ID")]
    effects: Vec<String>,
    /// Fit this parameter of the sheet over its whole physical range, without a tolerance; may be repeated.
    #[arg(long = "free", value_name = "KEY")]
    free: Vec<String>,
    /// Also fit the effects that this parameter file defines (docs/own_effect.md); may be repeated.
    #[arg(long = "candidate", value_name = "FILE")]
    candidates: Vec<PathBuf>,
    /// Number of starting points: the best sizes of profiles of all effects, from which the fit goes on.
    #[arg(long, value_name = "N", default_value_t = 3, value_parser = clap::value_parser!(u16).range(1..=100))]
    starts: u16,
    /// Print JSON instead of a table.
    #[arg(long)]
    json: bool,
    /// Folder for fitted.yaml and fit.json; created if missing.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// After the fit, answer each line of free parameter positions on standard input with the residuals, as JSON: for other solvers.
    #[arg(long, hide = true)]
    serve: bool,
}

const HELP: &str = "\
Every parameter with a tolerance in the data sheet is fitted. The fit minimises the sum of squared
residuals, each divided by its expected noise, and of squared distances from the sheet, each divided
by its tolerance. Signals that a recording lacks are ignored. Recordings may have different rates.

The table shows for each parameter
  ci90 from, to  interval of at least 90 %; local, with twenty residuals counted as one, because a
                 model error affects many samples alike
  sd from sheet  distance from the sheet in tolerances
  learned        1 − variance after / variance before the fit: what the recordings add to the sheet

DIR/fitted.yaml is a parameter file for every command, with the intervals as comments.

Examples:
  govtwin fit bags/practice/case_03 --effect backlash --out fit_03
  govtwin fit bags/reference --free oil.bulk_modulus_pa --json

Exit codes: 0 ok, 1 not possible, 2 wrong usage, 3 finished with warnings: a parameter at a bound,
too little excitation, a recording left out, or an error that no fitted parameter explains.";

/// Fits, prints the tables, writes the files.
pub fn run(args: &Args) -> anyhow::Result<Outcome> {
    let mut sheet = sheet_of(args.params.as_deref())?;
    for path in &args.candidates {
        adopt(&params::load(path)?, params::load_candidates(path)?, &mut sheet.unit)?;
    }
    let mut turned = free_parameters(args, &mut sheet.unit)?;
    let output = args.out.as_ref().map(|out| Output::claim(out, &["fitted.yaml", "fit.json"])).transpose()?;
    let mapped = args.map.open(&args.bags)?;
    let read = read(args, &mapped.paths, &sheet.unit)?;
    let mut made = describe(args, &sheet, &mapped, &read)?;
    let (recordings, found) = taken(read, &mut made)?;
    let mut warnings = [mapped.warnings, found].concat();
    let mut expected = noise::expected(&sheet.unit.sensors);
    let recordings = if args.params.is_none() && recordings.iter().all(|(_, cut)| *cut == Cut::Spool) {
        let whole = recordings.into_iter().map(|(recording, _)| recording).collect();
        let ready = sheetless(whole, &sheet.unit, true)
            .context("spool or servomotor stand still, so that neither says what drives what")?;
        warnings.extend(ready.notes.into_iter().map(|note| note.trim_end_matches('.').to_owned()));
        // What was asked for goes on top of the unit of no sheet.
        (sheet.unit.parameters, sheet.unit.tolerances) = (ready.unit.parameters, ready.unit.tolerances);
        sheet.unit.recorded = ready.unit.recorded;
        sheet.unit.effects.splice(0..0, ready.unit.effects);
        "servomotor stage without a data sheet".clone_into(&mut sheet.name);
        turned = free_parameters(args, &mut sheet.unit)?;
        turned.extend(
            ready
                .free_parameters
                .into_iter()
                .filter(|free_parameter| matches!(free_parameter, FreeParameter::Effect { .. })),
        );
        expected = ready.noise;
        ready.pieces
    } else {
        if args.params.is_none() {
            warnings.push("no data sheet given: the shipped reference unit's is taken (--params)".to_owned());
        }
        prepared(recordings, &mut warnings)
    };
    let starts = usize::from(args.starts);
    let progress = Progress::new(PARTS, "parts of the fit");
    let (problem, fitted) = calibrate(recordings, &sheet.unit, turned, &expected, starts, &|| progress.step());
    drop(progress);
    if !fitted.fit.square.is_finite() {
        bail!("the residuals are not finite; do the recordings belong to this parameter file?");
    }
    if args.serve {
        serve::serve(&problem, &sheet.unit, &fitted)?;
        return Ok(Outcome::Ok);
    }
    let parameter_warnings = fitted.warnings();
    warnings.extend(parameter_warnings);
    made.warnings.clone_from(&warnings);
    let told = stage(&problem, &sheet.unit, &fitted);
    let mut json = figures::json(&problem, &sheet, &fitted, &told, &warnings);
    json["provenance"] = serde_json::to_value(&made).context("cannot write the provenance as JSON")?;
    let json = format!("{json:#}\n");
    if let Some(mut output) = output {
        let fitted = params::overlay_text(&output.path("fitted.yaml"), &overlay(&problem, &sheet, &fitted, &made))?;
        output.add("fitted.yaml", fitted.as_bytes())?;
        output.add("fit.json", json.as_bytes())?;
        output.place()?;
    }
    print(&if args.json { json } else { figures::text(&problem, &sheet.unit, &fitted, &told) })?;
    if let (Some(out), false) = (&args.out, args.json) {
        print(&format!("\nFitted parameters: {}\n", out.join("fitted.yaml").display()))?;
    }
    warn_all(&warnings);
    Ok(if warnings.is_empty() { Outcome::Ok } else { Outcome::Warnings })
}

/// What the fit is made from, but for its warnings.
fn describe(args: &Args, sheet: &Sheet, mapped: &Mapped, read: &Recordings) -> anyhow::Result<Provenance> {
    let mut made = provenance::new("fit", sheet, None)?;
    made.unit = provenance::unit_of(&args.bags);
    made.recordings = provenance::inputs(&read.read, mapped)?;
    provenance::options(&args.topics, &args.map, &mut made)?;
    provenance::note(&mut made, "starts", [args.starts.to_string()]);
    provenance::note(&mut made, "effect", &args.effects);
    provenance::note(&mut made, "free", &args.free);
    provenance::note_files(&mut made, "candidate", &args.candidates)?;
    Ok(made)
}

/// A recording with the cut that it is judged at.
type CutRecording = (Recording, Cut);

/// Reads all bags.
fn read(args: &Args, paths: &[PathBuf], unit: &Unit) -> anyhow::Result<Recordings> {
    let topics = args.topics.topics();
    if args.params.is_some() {
        return bags::read(paths, &topics, unit);
    }
    let (mut found, only_stages) = bags::read_without_sheet(paths, &topics, unit, StageWanted::IfNoCommand, true)?;
    if only_stages {
        // A command in another unit than pu drives no chain.
        let frames = found.recordings.iter_mut().flat_map(|recording| &mut recording.frames);
        frames.for_each(|frame| frame.inputs.opening_command_pu = f64::NAN);
    }
    Ok(found)
}

/// Takes in what can be used, recordings without a command as those of the servomotor stage; also warnings.
fn taken(read: Recordings, made: &mut Provenance) -> anyhow::Result<(Vec<CutRecording>, Vec<String>)> {
    let Recordings { recordings, mut warnings, .. } = read;
    let whole_or_stage = |recording: &Recording| if recording.has_command() { Cut::None } else { Cut::Spool };
    let QualifiedRecordings { qualified, notes, refused } = qualify_all(recordings, whole_or_stage);
    if qualified.is_empty() {
        bail!("no recording can be used:\n  {}", refused.join("\n  "));
    }
    warnings.extend(notes);
    provenance::note_left_out(made, "", &refused);
    warnings.extend(refused.into_iter().map(|reason| format!("{reason} (left out)")));
    Ok((qualified, warnings))
}

/// Recordings as they are fitted to with a sheet.
fn prepared(recordings: Vec<CutRecording>, warnings: &mut Vec<String>) -> Vec<PreparedRecording> {
    let each = recordings.into_iter().map(|(recording, cut)| {
        if cut == Cut::Spool {
            warnings.push(format!("{}: no command: only the servomotor stage, driven by its spool", recording.name));
            PreparedRecording::servomotor_stage(recording)
        } else {
            PreparedRecording::new(recording)
        }
    });
    each.collect()
}

/// What was fitted of a servomotor stage alone, in the numbers of its recordings; nothing where whole chains were.
fn stage(problem: &Problem, base: &Unit, fitted: &Calibration) -> Vec<StageFigure> {
    if problem.recordings.iter().any(|recording| recording.cut != Cut::Spool) {
        return vec![];
    }
    let Some(law) = plain(&Run::all(&problem.recordings)) else { return vec![] };
    stage_figures(
        &FittedModel::new(vec![], base.clone(), fitted.free_parameters.clone(), fitted.fit.clone()),
        &law,
        &problem.recordings,
    )
}

/// Takes the effects that a file defines into a unit, with the values that the file gives them.
fn adopt(from: &Unit, candidates: Vec<govtwin_model::parameters::OwnEffect>, unit: &mut Unit) -> anyhow::Result<()> {
    for own in candidates {
        if unit.own_effects.iter().any(|known| known.id == own.id && *known != own) {
            bail!("`{}` is defined twice, and not alike; give one of the two another id", own.id);
        }
        if unit.own_effects.iter().all(|known| known.id != own.id) {
            unit.effects.extend(from.effects.iter().find(|setting| setting.id == own.id).cloned());
            unit.own_effects.push(own);
        }
    }
    Ok(())
}

/// What to turn: tolerances, free parameters, effects.
fn free_parameters(args: &Args, unit: &mut Unit) -> anyhow::Result<Vec<FreeParameter>> {
    let mut free = vec![];
    for key in &args.free {
        let Some(index) = ENTRIES.iter().position(|entry| entry.key == key) else {
            let (slip, known) =
                (format!("--free {key}: there is no such parameter"), ENTRIES.iter().map(|entry| entry.key));
            return Err(unknown(&slip, key, known, "govtwin check"));
        };
        free.push(index);
    }
    let mut free_parameters = FreeParameter::nuisances(unit);
    free_parameters.retain(
        |free_parameter| !matches!(free_parameter, FreeParameter::Parameter { index, .. } if free.contains(index)),
    );
    free.sort_unstable();
    free.dedup();
    free_parameters.extend(free.into_iter().map(|index| FreeParameter::free(unit, index)));
    let candidates = if args.candidates.is_empty() { &[] } else { &unit.own_effects[..] };
    let mut ids: Vec<String> = candidates.iter().map(|own| own.id.clone()).collect();
    ids.splice(0..0, args.effects.iter().cloned());
    let mut seen: Vec<&str> = vec![];
    for id in &ids {
        if seen.contains(&id.as_str()) {
            continue;
        }
        seen.push(id);
        let spec = effect::known(unit, id)?;
        let at = unit.effect_at(spec);
        free_parameters.extend(spec.parameters.iter().enumerate().map(|(parameter, spec)| FreeParameter::Effect {
            effect: at,
            parameter,
            spec,
        }));
    }
    if free_parameters.is_empty() {
        bail!("nothing to fit: the sheet gives no tolerance; name parameters with --free or an effect with --effect");
    }
    Ok(free_parameters)
}

/// The fitted unit as a parameter file.
fn overlay(problem: &Problem, sheet: &Sheet, fitted: &Calibration, made: &Provenance) -> Overlay {
    let comment = |row: &govtwin_diagnosis::identification::calibration::CalibrationRow| {
        let [low, high] = row.ci90.map(number_text);
        let bound = if row.at_bound { ", at a bound" } else { "" };
        (row.key.clone(), format!("ci90 [{low}, {high}], sheet {}{bound}", number_text(row.sheet)))
    };
    let names: Vec<&str> = problem.recordings.iter().map(|recording| recording.name.as_str()).collect();
    Overlay {
        unit: fitted.unit.clone(),
        name: sheet.name.clone(),
        source: format!("govtwin fit on {}", names.join(", ")),
        head: [
            vec!["A fit; behind each value its 90 % interval.".to_owned()],
            made.comments(),
            vec![format!("Left over, in times the noise to be expected: {}.", figures::leftover(fitted))],
        ]
        .concat(),
        comments: fitted.rows.iter().map(comment).collect::<BTreeMap<_, _>>(),
    }
}
