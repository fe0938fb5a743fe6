//! The bag of a replay: everything that was recorded, and the simulated state beside it.

use std::collections::BTreeMap;
use std::path::Path;

use anyhow::Context;
use govtwin_bag::msg::{Header, ServoState};
use govtwin_bag::{BagError, Health, Qos, RawMessage, Sealed, Stream, Topic, Topics, Writer, WriterOptions};
use govtwin_files::make_folder;
use govtwin_model::frame::Estimate;
use govtwin_model::provenance::RecordingGiven;
use govtwin_model::replay::{Replayed, is_measured};

use crate::commands::provenance;

/// Topic of the simulated state.
pub const TOPIC: &str = "/sim/servo_state";

/// How the bags of a replay are written: one replaces another of the same place, and nothing else.
pub const OPTIONS: WriterOptions = WriterOptions { mark: Some("govtwin.replay"), keep_unfinished: false };

/// Whether the bag folder `dir` may be written: nothing is there but what a replay wrote before.
pub fn check(dir: &Path) -> anyhow::Result<()> {
    Writer::check(dir, OPTIONS).context("--out: only simulated bags of an earlier replay are replaced")
}

/// Writes the bag folder `dir` under a temporary name: a copy of the bag at `source`, and [`TOPIC`].
///
/// The simulated state is given wherever the real one was measured, or where nothing was, in every
/// row. Its stamps are those of the rows; its log times follow the recorded messages' own clock. A
/// simulated state that the bag already holds is left behind.
pub fn write(
    source: &Path,
    dir: &Path,
    replayed: &Replayed,
    topics: &Topics,
    about: &BTreeMap<String, String>,
) -> anyhow::Result<Sealed> {
    let lag_ns = lag_ns(source, topics)?;
    let (mut writer, topic) = begin(dir, about)?;
    let recorded = replayed.recording.frames.iter().zip(&replayed.estimates);
    let measured = replayed.scores.are_measured();
    let mut estimates =
        recorded.filter(|(frame, _)| !measured || is_measured(frame)).map(|(_, estimate)| estimate).peekable();
    for message in govtwin_bag::messages(source)? {
        let message = message?;
        if message.topic.name == TOPIC {
            continue;
        }
        while let Some(estimate) = estimates.next_if(|e| e.time_ns.saturating_add(lag_ns) < message.log_time_ns) {
            writer.write(topic, estimate.time_ns.saturating_add(lag_ns), &state(estimate))?;
        }
        writer.copy(&message)?;
    }
    for estimate in estimates {
        writer.write(topic, estimate.time_ns.saturating_add(lag_ns), &state(estimate))?;
    }
    Ok(writer.seal()?)
}

/// What a simulated bag says of itself: whose it is a replay of, and whether what was recorded there is synthetic, which must not get lost.
pub fn about(name: &str, health: &Health, marked: &RecordingGiven) -> BTreeMap<String, String> {
    let mut about = BTreeMap::from([
        ("generator".to_owned(), format!("{} replay", provenance::PROGRAM)),
        ("replay_of".to_owned(), name.to_owned()),
        ("note".to_owned(), format!("{TOPIC} is simulated; everything else as recorded")),
    ]);
    if marked.synthetic {
        about.insert(govtwin_bag::SYNTHETIC.to_owned(), "true".to_owned());
    }
    about.extend(marked.origin.clone().map(|origin| (govtwin_bag::ORIGIN.to_owned(), origin)));
    about.extend(
        health.about(govtwin_bag::SIMULATOR).map(|simulator| (govtwin_bag::SIMULATOR.to_owned(), simulator.to_owned())),
    );
    about
}

/// Begins a simulated bag.
pub fn begin(dir: &Path, about: &BTreeMap<String, String>) -> anyhow::Result<(Writer, Topic<ServoState>)> {
    let failed = || format!("cannot write the simulated bag {}", dir.display());
    if let Some(parent) = dir.parent() {
        make_folder(parent).with_context(failed)?;
    }
    let mut writer = Writer::create(dir, OPTIONS)?;
    writer.describe(govtwin_bag::GOVTWIN, about.clone())?;
    let topic = writer.topic::<ServoState>(TOPIC, Qos::SENSOR)?;
    Ok((writer, topic))
}

/// How much later than its stamp the first message of the known topics that has one was logged, ns.
fn lag_ns(source: &Path, topics: &Topics) -> Result<i64, BagError> {
    for message in govtwin_bag::messages(source)? {
        if let Some(lag_ns) = lag_of(&message?, topics) {
            return Ok(lag_ns);
        }
    }
    Ok(0)
}

/// How much later than its stamp a message of the known topics was logged, where it has one, ns.
pub fn lag_of(message: &RawMessage, topics: &Topics) -> Option<i64> {
    Stream::ALL.iter().find(|stream| topics.of(**stream) == message.topic.name)?;
    // All four types begin with their header, which is all that is read here.
    let header = govtwin_bag::cdr::decode::<Header>(&message.data).ok()?;
    // A stamp of 0 is no time.
    let stamp_ns = header.stamp.nanos().filter(|stamp_ns| *stamp_ns != 0)?;
    Some(message.log_time_ns.saturating_sub(stamp_ns))
}

pub fn state(estimate: &Estimate) -> ServoState {
    ServoState {
        header: Header { frame_id: "govtwin".into(), ..Header::at(estimate.time_ns) },
        spool_position: estimate.signals.spool_position_pu,
        servomotor_position: estimate.signals.servomotor_position_pu,
        pilot_valve_position: estimate.signals.pilot_valve_position_pu,
        control_pressure: estimate.signals.control_pressure_pa,
    }
}
