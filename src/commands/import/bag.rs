//! The bag of an import: the four streams in this project's types, and a record of files and map.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use anyhow::Context;
use govtwin_bag::import::{Import, ImportError, ImportOutcome, ImportedRow, Map, RowMessages, map_text};
use govtwin_bag::msg;
use govtwin_bag::{Qos, Sealed, Topic, Topics, Writer, WriterOptions};

use super::progress;

/// How the bags of an import are written: one replaces another of the same place, and nothing else.
const OPTIONS: WriterOptions = WriterOptions { mark: Some("govtwin.import"), keep_unfinished: false };

/// The topics of a bag in the making.
struct BagTopics {
    bag: Writer,
    command: Topic<msg::GovernorCommand>,
    esv: Topic<msg::EsvState>,
    tank_pressure: Topic<msg::FluidPressure>,
    servo_state: Topic<msg::ServoState>,
}

/// Reads files by a map and writes them as a bag under a temporary name.
pub fn write(files: &[PathBuf], map: &Map, out: &Path, bar: bool) -> anyhow::Result<(Sealed, ImportOutcome)> {
    let failed = || format!("cannot write {}", out.display());
    let import = Import::open(files, map)?;
    if let Some(parent) = out.parent() {
        govtwin_files::make_folder(parent).with_context(failed)?;
    }
    let mut bag = Writer::create(out, OPTIONS).with_context(failed)?;
    let topics = Topics::default();
    let mut streams = BagTopics {
        command: bag.topic(&topics.command, Qos::DEFAULT)?,
        esv: bag.topic(&topics.esv, Qos::DEFAULT)?,
        tank_pressure: bag.topic(&topics.tank_pressure, Qos::SENSOR)?,
        servo_state: bag.topic(&topics.servo_state, Qos::SENSOR)?,
        bag,
    };
    let progress = bar.then(progress);
    let mut on_progress = |share: f64| progress.iter().for_each(|progress| progress.at(share, "read"));
    let outcome = import.run(&mut |row| streams.put(row), &mut on_progress)?;
    streams.bag.describe(govtwin_bag::GOVTWIN, about(files, map, outcome.command_deviation_pu))?;
    Ok((streams.bag.seal().with_context(failed)?, outcome))
}

/// Reads files by a map and writes nothing.
pub fn check(files: &[PathBuf], map: &Map) -> anyhow::Result<ImportOutcome> {
    let progress = progress();
    let import = Import::open(files, map)?;
    Ok(import.run(&mut |_| Ok::<(), ImportError>(()), &mut |share| progress.at(share, "read"))?)
}

impl BagTopics {
    fn put(&mut self, row: &ImportedRow) -> anyhow::Result<()> {
        let time_ns = row.time_ns;
        let RowMessages { command, esv, tank_pressure, servo_state } = RowMessages::of(row);
        command.map(|message| self.bag.write(self.command, time_ns, &message)).transpose()?;
        esv.map(|message| self.bag.write(self.esv, time_ns, &message)).transpose()?;
        tank_pressure.map(|message| self.bag.write(self.tank_pressure, time_ns, &message)).transpose()?;
        servo_state.map(|message| self.bag.write(self.servo_state, time_ns, &message)).transpose()?;
        Ok(())
    }
}

/// What the bag says of where it comes from: names of files, not the places where they lay.
fn about(files: &[PathBuf], map: &Map, command_deviation_pu: f64) -> BTreeMap<String, String> {
    let name = |file: &PathBuf| file.file_name().unwrap_or(file.as_os_str()).to_string_lossy().into_owned();
    let files: Vec<String> = files.iter().map(name).collect();
    let mut about = BTreeMap::from([
        ("generator".to_owned(), format!("govtwin {} import", env!("CARGO_PKG_VERSION"))),
        ("imported_from".to_owned(), files.join(", ")),
        ("map".to_owned(), map_text(map, &[], |_| String::new())),
    ]);
    if !map.source.is_empty() {
        about.insert("source".to_owned(), map.source.clone());
    }
    if command_deviation_pu > 0.0 {
        about.insert(govtwin_bag::COMMAND_DEVIATION.to_owned(), command_deviation_pu.to_string());
    }
    about
}
