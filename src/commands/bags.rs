//! Which bags a command line names: files, bag folders, and folders that hold many bags; and all of them read for a fit.

mod doubt;
mod excerpts;
mod find;
mod position_scale;
mod pressure;
mod spool_scale;
mod time_scale;

use std::path::{Path, PathBuf};

use anyhow::Context;
use clap::ArgAction;
use govtwin_bag::import::Map;
use govtwin_bag::{FARTHEST_NS, Health, Interpolation, Positions, ReadOptions, Stream, Topics, Warning};
use govtwin_model::parameters::Unit;
use govtwin_model::recording::Recording;
use govtwin_model::units::TICK_NS;
use rayon::prelude::{IntoParallelRefIterator, ParallelIterator};
use tempfile::TempDir;

use super::choice::{Choice, choice};
use super::import;
use super::output::say;
use excerpts::Taken;
use pressure::other_unit;

use doubt::Doubt;
pub use doubt::doubts;
#[cfg(feature = "lab")]
pub use find::holds_bags;
pub use find::{find, is_bag_folder};
use position_scale::PositionScale;
pub use pressure::doubt_of_pressure;
use spool_scale::doubt_of_spool;
use time_scale::TimeScale;

/// One bag to read.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Bag {
    /// Where it is.
    pub path: PathBuf,
    /// What to call it: the file or folder name, with as many parents as tell it from the others.
    pub name: String,
}

/// Where the streams are, for the commands that read recordings.
#[derive(Clone, Debug, Default, clap::Args)]
pub struct TopicArgs {
    /// Topic of STREAM (command, esv, tank_pressure, servo_state or load), if the bags have another name for it; may be repeated.
    #[arg(long = "topic", value_name = "STREAM=NAME", value_parser = stream_and_name)]
    pub(super) named: Vec<(Stream, String)>,
    /// What dates the samples: the stamp in their header, or the time of recording, where the senders' clocks differ.
    ///
    /// With `log`, the stamps of each topic are moved by one amount, the least time from stamp to recording, so that all topics are on the
    /// recorder's clock.
    #[arg(long, value_name = "CLOCK", default_value = "header", hide_default_value = true, value_parser = choice(CLOCKS), action = ArgAction::Set)]
    pub(super) stamp: bool,
}

/// What dates the samples of a bag: whether it is the recorder's clock.
const CLOCKS: [Choice<bool>; 2] =
    [("header", "The stamp in the header of each message", false), ("log", "The recorder's clock", true)];

impl TopicArgs {
    /// The topics named, and the usual ones where none is.
    pub fn topics(&self) -> Topics {
        let mut topics = Topics::default();
        for (stream, name) in &self.named {
            topics.set(*stream, name);
        }
        topics.by_log = self.stamp;
        topics
    }

    #[cfg(feature = "lab")]
    /// The arguments again, for a process of our own.
    pub fn arguments(&self) -> Vec<String> {
        let named = self.named.iter().flat_map(|(stream, name)| ["--topic".to_owned(), format!("{stream}={name}")]);
        let stamp = self.stamp.then(|| ["--stamp".to_owned(), "log".to_owned()]);
        named.chain(stamp.into_iter().flatten()).collect()
    }
}

fn stream_and_name(text: &str) -> Result<(Stream, String), String> {
    let (stream, name) = text.split_once('=').unwrap_or((text, ""));
    let known = Stream::READ.into_iter().find(|known| known.to_string() == stream);
    match known.filter(|_| !name.is_empty()) {
        Some(known) => Ok((known, name.to_owned())),
        None => {
            Err(format!("expected STREAM=NAME with one of {}", Stream::READ.map(|known| known.to_string()).join(", ")))
        }
    }
}

/// Files that are no bags of this project, for the commands that read recordings.
#[derive(Clone, Debug, Default, clap::Args)]
pub struct MapArgs {
    /// Import map (`govtwin import`), to read tables and bags with other topics and types; each file is a separate recording.
    #[arg(long = "map", value_name = "MAP", conflicts_with = "named")]
    pub(super) map: Option<PathBuf>,
}

/// Recordings by their files, imported into bags where a map says how; those go with this.
pub struct Mapped {
    /// The bags.
    pub paths: Vec<PathBuf>,
    /// The files that were named, one for each of the bags where there is a map.
    given: Vec<PathBuf>,
    /// What the import has to say, each with the name of its file.
    pub warnings: Vec<String>,
    _folder: Option<TempDir>,
}

impl MapArgs {
    /// The files as they are, or by the map as bags that stand in for them.
    pub fn open(&self, paths: &[PathBuf]) -> anyhow::Result<Mapped> {
        self.imported(paths, |map| map)
    }

    /// The same with positions in the units of the files.
    pub fn open_as_recorded(&self, paths: &[PathBuf]) -> anyhow::Result<Mapped> {
        self.imported(paths, Map::as_recorded)
    }

    fn imported(&self, paths: &[PathBuf], read: fn(Map) -> Map) -> anyhow::Result<Mapped> {
        let none = Mapped { paths: paths.to_vec(), given: paths.to_vec(), warnings: vec![], _folder: None };
        let Some(map) = &self.map else { return Ok(none) };
        let map = read(Map::load(map)?);
        let folder = tempfile::tempdir().context("cannot make a folder for what is imported")?;
        let mut mapped = Mapped { paths: vec![], given: vec![], ..none };
        let mut files = vec![];
        for path in paths {
            // A folder of bags means each of them; tables are named one by one.
            let bags = if path.is_dir() { find(std::slice::from_ref(path))? } else { vec![] };
            files.extend(bags.into_iter().map(|bag| bag.path));
            files.extend(Some(path.clone()).filter(|path| !path.is_dir()));
        }
        for (number, path) in files.iter().enumerate() {
            let name = path.file_stem().unwrap_or(path.as_os_str());
            let bag = folder.path().join(number.to_string()).join(name);
            let (sealed, outcome) = import::bag::write(std::slice::from_ref(path), &map, &bag, true)?;
            mapped.paths.push(sealed.place()?);
            mapped.given.push(path.clone());
            mapped.warnings.extend(outcome.warnings);
        }
        Ok(Mapped { _folder: Some(folder), ..mapped })
    }
}

impl Mapped {
    /// The file that was named, of a bag that stands in for it.
    pub fn given<'a>(&'a self, bag: &'a Path) -> &'a Path {
        let known = self.paths.iter().position(|path| path == bag);
        known.and_then(|known| self.given.get(known)).map_or(bag, PathBuf::as_path)
    }
}

/// Recordings read for a fit or a diagnosis, and what there is to say of them.
#[expect(clippy::struct_field_names, reason = "recordings that were read, beside all that were named")]
pub struct Recordings {
    /// Those that could be read, in the order of the command line.
    pub recordings: Vec<Recording>,
    /// Warnings, each with the name of its recording.
    pub warnings: Vec<String>,
    /// Notes, which do not speak against the recordings.
    pub notes: Vec<String>,
    /// All that were named, in the order of the command line.
    pub read: Vec<GivenBag>,
}

/// A bag that was to be read.
#[derive(Clone, Debug, Default)]
pub struct GivenBag {
    /// Where it is.
    pub path: PathBuf,
    /// What its recording is called.
    pub name: String,
    /// What its reader had to say; none where it could not be read.
    pub health: Option<Health>,
    /// Why it was left out, where it was.
    pub left_out: Option<String>,
    /// What was taken of it, where it was too long to be taken whole.
    pub excerpt: Option<String>,
}

/// Why the program's own simulations are no evidence beside measurements.
const OWN: &str = "simulated by govtwin's own twin, which says nothing of the unit that the other recordings are of";

/// Reads all bags that the paths name; what cannot be read is left out with a warning, as long as something is left.
///
/// Of a long recording each process is taken as a recording of its own (`govtwin_diagnosis::watch::excerpt`).
///
/// Command and pressure run from sample to sample, on a grid of the twin's own tick. A recording without a command is
/// one of the servomotor stage, driven by its spool; that other inputs are missing is then no news. What is read is held against
/// the sheet of the unit where it may have another unit of measure.
pub fn read(paths: &[PathBuf], topics: &Topics, unit: &Unit) -> anyhow::Result<Recordings> {
    let reading = Reading { positions: Positions::of(unit.recorded), uncut: false, timed: true };
    read_as(paths, topics, unit, reading).inspect(tell)
}

/// The same of a unit whose sheet is looked for: nothing says yet how fast it is.
pub fn read_for_sheet(paths: &[PathBuf], topics: &Topics, reference: &Unit) -> anyhow::Result<Recordings> {
    let reading = Reading { positions: Positions::of(reference.recorded), uncut: false, timed: false };
    read_as(paths, topics, reference, reading).inspect(tell)
}

/// Reads all bags where no sheet is given, and says whether there is nothing but servomotor stages in them, whose positions are then in any unit.
///
/// `stage` takes the servomotor stage of recordings with a command as well, where it is wanted; `timed` holds their time against the reference.
pub fn read_without_sheet(
    paths: &[PathBuf],
    topics: &Topics,
    reference: &Unit,
    stage: StageWanted,
    timed: bool,
) -> anyhow::Result<(Recordings, bool)> {
    let has_command = |found: &Recordings| found.recordings.iter().any(Recording::has_command);
    // Whole chains are what is nearly always given: they are read once.
    let whole = Reading { positions: Positions::of(reference.recorded), uncut: false, timed };
    let chains = (stage == StageWanted::IfNoCommand).then(|| read_as(paths, topics, reference, whole));
    let chains = match chains {
        Some(Ok(found)) if has_command(&found) => {
            tell(&found);
            return Ok((found, false));
        }
        others => others,
    };
    let any = Reading { positions: Positions::AnyUnit, uncut: stage == StageWanted::Uncut, timed: false };
    let mut found = read_as(paths, topics, reference, any)?;
    if let Some(chains) = chains.filter(|_| has_command(&found)) {
        // No chain with its command can be used; where nothing but the command is in another unit, the stage can.
        chains?;
        found.warnings.push(OTHER_COMMAND.to_owned());
    }
    tell(&found);
    Ok((found, true))
}

/// When the servomotor stage of recordings is wanted alone.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StageWanted {
    /// Where no recording holds a command.
    IfNoCommand,
    /// In any case.
    Always,
    /// In any case, and of long recordings not the processes but the whole.
    Uncut,
}

/// Why a command was not followed.
const OTHER_COMMAND: &str = "the opening command is in another unit than pu, so that the servomotor stage alone was read; \
                             import the command by its range (govtwin import) to judge the whole chain";

/// Says what was taken of long recordings, and notes.
fn tell(found: &Recordings) {
    found.notes.iter().for_each(|note| say(&format!("note: {note}")));
    for GivenBag { name, excerpt, .. } in &found.read {
        if let Some(excerpt) = excerpt {
            say(&format!("{name}: {excerpt}"));
        }
    }
}

/// How bags are read.
#[derive(Clone, Copy, Debug)]
struct Reading {
    positions: Positions,
    /// Long recordings whole.
    uncut: bool,
    /// The twin of the unit tells whether their time is that of the plant.
    timed: bool,
}

/// How recordings are read for a diagnosis: command and pressure run from sample to sample, on a grid of the twin's own tick.
pub fn options(topics: Topics, positions: Positions) -> ReadOptions {
    // Of a stage in any unit only the rows that were recorded count.
    let period_ns = if positions == Positions::AnyUnit { FARTHEST_NS } else { TICK_NS };
    let interpolation = Interpolation::Sharp { period_ns };
    ReadOptions { positions, topics, interpolation, required: vec![Stream::ServoState] }
}

fn read_as(paths: &[PathBuf], topics: &Topics, unit: &Unit, reading: Reading) -> anyhow::Result<Recordings> {
    let Reading { positions, uncut, timed } = reading;
    let bags = find(paths)?;
    let loaded = excerpts::read(&bags, &options(topics.clone(), positions), uncut)?;
    let (mut recordings, mut warnings, mut notes, mut refused, mut read) = (vec![], vec![], vec![], vec![], vec![]);
    let is_own = |taken: &Taken| taken.health.files.iter().any(|file| file.from_the_twin);
    let some_measured = loaded.iter().flatten().any(|taken| !is_own(taken));
    let can_tell = |taken: &&Taken| timed && !is_own(taken) && taken.health.disqualified().is_none();
    let scale = |taken: &Taken| TimeScale::most(&taken.recordings, unit);
    let spool = |taken: &Taken| taken.recordings.iter().find_map(|recording| doubt_of_spool(recording, unit));
    let position = |taken: &Taken| taken.recordings.iter().find_map(|recording| PositionScale::of(recording, unit));
    let scales: Vec<(Option<TimeScale>, Option<Doubt>, Option<PositionScale>)> = loaded
        .par_iter()
        .map(|taken| {
            let taken = taken.as_ref().ok().filter(can_tell);
            (taken.and_then(scale), taken.and_then(spool), taken.and_then(position))
        })
        .collect();
    // A channel that is scaled in one recording is so in those of the same set that can tell less.
    let position = scales.iter().find_map(|(_, _, position)| *position);
    let also = |taken: &Taken| {
        let position = position?;
        taken.recordings.iter().find_map(|recording| position.also_in(recording, unit))
    };
    // Recordings of one set are of one clock.
    let clear = scales.iter().find_map(|(scale, ..)| scale.filter(TimeScale::is_clear));
    let agree = TimeScale::agree(scales.iter().filter_map(|(scale, ..)| scale.as_ref()));
    for ((bag, taken), (scale, spool, position)) in bags.into_iter().zip(loaded).zip(scales) {
        let Bag { path, name } = bag;
        let is_other_time = scale.is_some_and(|scale| clear.is_some_and(|clear| scale.is_alike(&clear)));
        let scaled =
            scale.filter(|scale| is_other_time || scale.is_other()).map(|scale| scale.words(!(agree || is_other_time)));
        let position = position.or_else(|| taken.as_ref().ok().filter(can_tell).and_then(also));
        let near = scale.filter(|_| !is_other_time).and_then(|scale| scale.doubt());
        let noted = near.iter().chain(&spool).filter(|doubt| doubt.is_note());
        notes.extend(noted.map(|doubt| format!("{name}: {}", doubt.words)));
        let spool = spool.filter(Doubt::refuses).map(|doubt| doubt.words);
        let other =
            scaled.clone().filter(|_| agree || is_other_time).or(spool).or_else(|| position.map(|scale| scale.words()));
        let taken = taken.and_then(|taken| match untrusted(&taken, topics, unit, other) {
            Some(reason) => Err(format!("{name}: {reason}")),
            None => Ok(taken),
        });
        let (health, left_out, excerpt) = match taken {
            Ok(taken) if some_measured && is_own(&taken) => {
                warnings.push(format!("{name}: {OWN} (left out)"));
                (Some(taken.health), Some(OWN.to_owned()), None)
            }
            Ok(Taken { recordings: mut taken, health, excerpt }) => {
                let command_deviation_pu = health.command_deviation_pu();
                for recording in &mut taken {
                    recording.command_deviation_pu = command_deviation_pu;
                }
                let has_command = taken.iter().any(Recording::has_command);
                let news = |warning: &&Warning| has_command || !matches!(warning, Warning::Filled { .. });
                warnings.extend(health.warnings.iter().filter(news).map(|warning| format!("{name}: {warning}")));
                let doubt = taken.iter().find_map(|recording| doubt_of_pressure(recording, topics, unit));
                warnings.extend(doubt.into_iter().chain(scaled).map(|doubt| format!("{name}: {doubt}")));
                recordings.extend(taken);
                (Some(health), None, excerpt)
            }
            Err(error) => {
                let reason = error.strip_prefix(&format!("{name}: ")).unwrap_or(&error).to_owned();
                refused.push(error);
                (None, Some(reason), None)
            }
        };
        read.push(GivenBag { path, name, health, left_out, excerpt });
    }
    if recordings.is_empty() {
        anyhow::bail!("no recording can be read:\n  {}", refused.join("\n  "));
    }
    warnings.extend(refused.into_iter().map(|reason| format!("{reason} (left out)")));
    Ok(Recordings { recordings, warnings, notes, read })
}

/// Why nothing can be concluded from what was taken of a bag.
fn untrusted(taken: &Taken, topics: &Topics, unit: &Unit, scaled: Option<String>) -> Option<String> {
    let of_other = || taken.recordings.iter().find_map(|recording| other_unit(recording, topics, unit));
    taken.health.disqualified().or_else(of_other).or(scaled)
}

#[cfg(test)]
mod tests;
