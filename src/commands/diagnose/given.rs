//! What a diagnosis is given: recordings, and what they are judged by, which is a data sheet, the reference unit, a sheet made of the recordings, or nothing.

use std::path::PathBuf;

use govtwin_bag::Topics;
use govtwin_diagnosis::result::Setup;
use govtwin_diagnosis::sheet::recorded::fill;
use govtwin_diagnosis::sheet::{Derived, Plate, derive};
use govtwin_model::parameters::Unit;
use govtwin_model::params;
use govtwin_model::provenance::{Provenance, SheetUsed};
use govtwin_model::recording::Recording;

use super::files::ASSUMED;
use crate::commands::bags::{self, Recordings, StageWanted};
use crate::commands::sheet;

/// Which unit recordings are judged by, on the command line.
#[derive(Clone, Debug, Default, clap::Args)]
pub struct UnitArgs {
    /// Data sheet (parameter file) of the unit; without it, the shipped reference unit.
    #[arg(long, value_name = "FILE")]
    pub params: Option<PathBuf>,
    /// Estimate a data sheet from the recordings, with wide tolerances.
    ///
    /// The estimated sheet is written to DIR/assumed.yaml, and the whole chain is diagnosed with it. If the
    /// recordings are not sufficient for a sheet (they must contain command, tank pressure, spool and servomotor,
    /// with positions in pu), the servomotor stage alone is diagnosed as with --stage-alone, and the report gives the
    /// reason.
    #[arg(long, conflicts_with = "params")]
    pub no_sheet: bool,
    /// Diagnose only the servomotor stage, without a data sheet, from positions in any unit.
    ///
    /// The recorded spool drives the stage; if no spool was recorded, the command replaces it. All parameters of the stage
    /// are fitted freely. This is the default if no recording contains a command and no sheet is given.
    #[arg(long, alias = "free", conflicts_with_all = ["params", "no_sheet"])]
    pub stage_alone: bool,
}

/// What recordings are judged by.
#[derive(Debug)]
pub enum By {
    /// The data sheet of `--params`.
    Sheet,
    /// The shipped reference unit, as no sheet is named.
    Reference,
    /// A sheet made of the recordings: its text, and a sentence on it.
    Recordings {
        /// The text of its parameter file.
        text: String,
        /// What was read off the recordings, and what was assumed.
        note: String,
    },
    /// Nothing: the servomotor stage alone, fitted freely; why not the whole chain, where that was asked for.
    Nothing {
        /// A sentence.
        note: Option<String>,
    },
}

/// Recordings and the unit that they are judged by.
pub struct Given {
    /// The recordings.
    pub recordings: Recordings,
    /// The unit.
    pub unit: Unit,
    /// Where it comes from.
    pub by: By,
}

/// Reads the recordings that a command line names, and finds what they are judged by.
pub fn read(args: &UnitArgs, paths: &[PathBuf], topics: &Topics, sheet: &Unit) -> anyhow::Result<Given> {
    let unit = sheet.clone();
    if args.params.is_some() {
        return Ok(Given { recordings: bags::read(paths, topics, &unit)?, unit, by: By::Sheet });
    }
    let stage = if args.stage_alone { StageWanted::Uncut } else { StageWanted::IfNoCommand };
    let (recordings, only_stages) = bags::read_without_sheet(paths, topics, &unit, stage, !args.no_sheet)?;
    if only_stages {
        return Ok(Given { recordings, unit, by: By::Nothing { note: None } });
    }
    if !args.no_sheet {
        return Ok(Given { recordings, unit, by: By::Reference });
    }
    match made_of(&recordings.recordings, &unit) {
        Ok((unit, text, note)) => Ok(Given { recordings, unit, by: By::Recordings { text, note } }),
        Err(reason) => {
            let (recordings, _) = bags::read_without_sheet(paths, topics, &unit, StageWanted::Always, false)?;
            let note = format!("The whole chain is not judged without a data sheet: {reason}.");
            Ok(Given { recordings, unit, by: By::Nothing { note: Some(note) } })
        }
    }
}

/// A unit made of recordings, the text of its sheet and a sentence on it; or why there is none.
fn made_of(recordings: &[Recording], reference: &Unit) -> Result<(Unit, String, String), String> {
    let mut plate = Plate { name: "unit made of its recordings".to_owned(), ..Plate::default() };
    let recorded = fill(&mut plate, recordings, reference).map_err(|reason| reason.to_string())?;
    let derived = derive(&plate, reference).map_err(|problems| problems.join("; "))?;
    let derived = sheet::with_recorded(derived, Some(recorded));
    // Reads back what it writes, and refuses a unit that cannot be.
    let text = params::whole_text(ASSUMED.as_ref(), &derived.unit, &sheet::whole(&plate, &derived, None));
    let text = text.map_err(|error| error.to_string())?;
    let note = note(&plate, &derived);
    Ok((derived.unit, text, note))
}

/// What was read off the recordings, and what was assumed.
fn note(plate: &Plate, derived: &Derived) -> String {
    let shown = plate.values.iter().filter(|(_, given)| given.tolerance_share != Some(0.0));
    let shown = shown.map(|(key, given)| format!("{} {}", key.replace('_', " "), given.text));
    format!(
        "No data sheet: the unit was made of the recordings ({ASSUMED}). They show: {}. Assumed: {}; all else by the formulas of a name plate, with \
         wide tolerances.",
        shown.collect::<Vec<_>>().join("; "),
        derived.assumed.join("; ")
    )
}

impl By {
    /// In the words of the diagnosis.
    pub fn setup(&self) -> Setup {
        match self {
            Self::Sheet | Self::Reference => Setup::Chain,
            Self::Recordings { .. } => Setup::AssumedSheet,
            Self::Nothing { .. } => Setup::StageFree,
        }
    }

    /// The text of the sheet that was made of the recordings.
    pub fn assumed(&self) -> Option<&str> {
        match self {
            Self::Recordings { text, .. } => Some(text),
            _ => None,
        }
    }

    /// What there is to say of the unit, where it was not named.
    pub fn note(&self) -> Option<&str> {
        match self {
            Self::Recordings { note, .. } => Some(note),
            Self::Nothing { note } => note.as_deref(),
            Self::Sheet | Self::Reference => None,
        }
    }

    /// Notes among what a report was made from which unit was taken.
    pub fn describe(&self, args: &UnitArgs, unit: &Unit, made: &mut Provenance) {
        let mut option = |name: &str, value: &str| made.options.insert(name.to_owned(), value.to_owned());
        match self {
            Self::Recordings { .. } => {
                option("no-sheet", "the whole chain, by a sheet made of the recordings");
                let sha256 = params::unit_digest(unit);
                made.sheet = SheetUsed { name: "made of the recordings".to_owned(), files: vec![], sha256 };
            }
            Self::Nothing { .. } if args.no_sheet => drop(option("no-sheet", "the servomotor stage alone")),
            Self::Nothing { .. } if args.stage_alone => drop(option("stage-alone", "given")),
            Self::Nothing { .. } => drop(option("stage-alone", "taken for granted: no command, no sheet")),
            Self::Sheet | Self::Reference => {}
        }
    }

    /// Which unit was taken where no sheet was named, in the words of the summary.
    pub fn unit_taken(&self) -> Option<String> {
        match self {
            Self::Sheet => None,
            Self::Reference => Some("the shipped reference unit, as --params names no data sheet".to_owned()),
            Self::Recordings { .. } => Some(format!("made of the recordings ({ASSUMED} beside the report)")),
            Self::Nothing { .. } => Some("none; the servomotor stage was fitted freely".to_owned()),
        }
    }
}
