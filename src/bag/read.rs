//! From a bag to a recording: find the streams, decode, order, align.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use super::align;
use super::collect::{AnyCollector, Collected};
use super::edges::{self, Edges};
use super::evidence::{RowEvidence, StreamEvidence};
use super::grid::Grid;
use super::live::Live;
use super::source::{self, BagSource, Scanned};
use super::topic::{TopicInfo, shown};
use super::{
    BagError, FileHealth, Finding, Health, Kind, Loaded, ReadOptions, Severity, Stream, StreamHealth, Warning,
};
use super::{findings, qualification};
use crate::msg::{Interface, ServoState};
use govtwin_model::recording::Recording;

/// Gaps shorter than this are no news on any machine, s.
const GAP_WORTH_A_WORD_S: f64 = 0.1;

/// Place of the servo state in [`Stream::ALL`].
const SERVO_STATE: usize = Stream::ServoState as usize;

/// An error names at most so many topics.
const MOST_TOPICS: usize = 50;

/// Reads a bag into a recording.
///
/// # Errors
/// Where there is no bag, a required stream is missing or has another type, or nothing is usable.
/// Damage, late, doubled and impossible values are no errors: they are counted in the health.
pub fn read(path: &Path, options: &ReadOptions) -> Result<Loaded, BagError> {
    let source = source::open(path)?;
    let mut collected = Collected::new(options);
    let scanned = source.scan(&mut |message| {
        collected.take(message);
    })?;
    check(path, &collected, options, &scanned)?;
    let jump = collected.settle(options.topics.by_log);
    let (mut frames, grid, read) = Live::whole(collected, options);
    let mut read = Read { jump, ..read };
    qualification::check_clocks(path, &read.healths, &read.evidence)?;
    align::check(&frames, grid.as_ref().and_then(Grid::period_ns), options.positions.tick_ns(), path)?;
    if let Some(grid) = grid {
        read.rows = RowEvidence::new(options.positions);
        grid.below(std::mem::take(&mut frames), &mut |frame| {
            read.rows.row(frame);
            frames.push(*frame);
        });
    }
    let health = read.judge(path, &source, &scanned, options)?;
    let command_deviation_pu = health.command_deviation_pu();
    Ok(Loaded { recording: Recording { command_deviation_pu, ..Recording::new(source.name, frames) }, health })
}

/// What was read besides the rows themselves.
pub(super) struct Read {
    pub(super) healths: Vec<StreamHealth>,
    pub(super) evidence: [StreamEvidence; 4],
    pub(super) rows: RowEvidence,
    pub(super) edges: Edges,
    pub(super) jump: Option<Warning>,
    /// Rows.
    pub(super) count: usize,
    /// Messages that were read by another definition of their type, by topic: in what it differs, and how many.
    pub(super) translated: BTreeMap<String, (String, u64)>,
}

impl Read {
    /// Says how the bag is, or why it cannot be used.
    pub(super) fn judge(
        mut self,
        path: &Path,
        source: &BagSource,
        scanned: &Scanned,
        options: &ReadOptions,
    ) -> Result<Health, BagError> {
        qualification::check_clocks(path, &self.healths, &self.evidence)?;
        if self.count == 0 {
            return Err(BagError::NoRows { path: path.to_owned(), present: present(&scanned.topics) });
        }
        let (warnings, notes) = (source.all_warnings(&scanned.files), source.notes(&scanned.files));
        let mut health = Health { files: scanned.files.clone(), streams: self.healths, warnings, notes };
        health.warnings.extend(self.jump);
        warn(&mut health);
        health.warnings.extend(edges::warnings(self.edges, &health.streams));
        let simulated = simulated(&scanned.topics);
        let by_right = |stream: Stream| stream == Stream::ServoState && simulated.is_some();
        let filled = Stream::ALL.into_iter().zip(&health.streams).filter(|(_, stream)| stream.kept == 0);
        let filled = filled.filter(|(stream, _)| !by_right(*stream));
        let filled = filled.map(|(stream, health)| {
            let with = match stream {
                Stream::Command | Stream::TankPressure => "NaN",
                Stream::Esv => "state normal",
                Stream::ServoState => "NaN in every measured signal",
                Stream::Load => "0 N",
            };
            Warning::Filled { topic: health.topic.clone(), with }
        });
        let filled: Vec<Warning> = filled.collect();
        health.warnings.extend(filled);
        let measured = health.streams.get(SERVO_STATE).filter(|stream| stream.kept == 0);
        let only_simulated =
            simulated.zip(measured).map(|(simulated, measured)| findings::only_simulated(&measured.topic, simulated));
        health.notes.extend(only_simulated);
        qualify(&mut health, &mut self.evidence, &mut self.rows);
        health.notes.extend(
            self.translated.iter().map(|(topic, (difference, count))| findings::translated(topic, difference, *count)),
        );
        let nothing = health.warnings.iter().find(|warning| is_nothing_measured(warning));
        if let Some(nothing) = nothing.filter(|_| options.required.contains(&Stream::ServoState)) {
            let topic = options.topics.of(Stream::ServoState).to_owned();
            let messages = health.streams.get(SERVO_STATE).map_or(0, |stream| stream.messages);
            return Err(BagError::Unusable { path: path.to_owned(), topic, messages, first: nothing.to_string() });
        }
        Ok(health)
    }
}

/// The topic of a simulated state, where the bag holds one.
fn simulated(topics: &[Arc<TopicInfo>]) -> Option<&str> {
    let is_simulated = |topic: &&Arc<TopicInfo>| {
        topic.type_name == ServoState::TYPE_NAME
            && (topic.name == "sim/servo_state" || topic.name.ends_with("/sim/servo_state"))
    };
    topics.iter().find(is_simulated).map(|topic| topic.name.as_str())
}

/// Whether there is something to read.
pub(super) fn check(
    path: &Path,
    collected: &Collected,
    options: &ReadOptions,
    scanned: &Scanned,
) -> Result<(), BagError> {
    check_not_empty(path, &scanned.files)?;
    check_streams(path, collected, options, &scanned.topics)
}

fn is_nothing_measured(warning: &Warning) -> bool {
    matches!(warning, Warning::Doubtful(Finding { what: Kind::NothingMeasured, .. }))
}

/// Adds what the data shows of its senders, clocks and transducers.
fn qualify(health: &mut Health, evidence: &mut [StreamEvidence; 4], rows: &mut RowEvidence) {
    let heard = health.streams.iter().zip(evidence.iter_mut());
    let mut heard: Vec<_> = heard.map(|(stream, evidence)| (&*stream.topic, evidence, stream.conflicts)).collect();
    let mut found = qualification::of_streams(&mut heard, rows.is_in_pu());
    if let Some((topic, servo_state, _)) = heard.pop() {
        found.extend(qualification::of_rows(topic, servo_state, rows));
    }
    let command = health.streams.first().map_or("", |command| &*command.topic);
    found.extend(qualification::of_command(command, health.command_deviation_pu()));
    let (notes, warnings): (Vec<_>, Vec<_>) = found.into_iter().partition(|found| found.severity == Severity::Note);
    health.warnings.extend(warnings.into_iter().map(Warning::Doubtful));
    health.notes.extend(notes);
}

/// Turns counts into warnings.
fn warn(health: &mut Health) {
    for (place, stream) in health.streams.iter().enumerate() {
        let whole = stream.undecodable + stream.bad_stamps + stream.duplicates + stream.conflicts;
        // A message that lost a value may have been dropped for another reason, too.
        let count = (whole + stream.bad_messages).min(stream.messages);
        let topic = || stream.topic.clone();
        if count > 0 {
            let first = stream.first_fault.clone().unwrap_or_else(|| "the same sample twice".into());
            health.warnings.push(Warning::Dropped { topic: topic(), count, of: stream.messages, first });
        }
        if stream.unstamped > 0 {
            health.warnings.push(Warning::Unstamped { topic: topic(), count: stream.unstamped, of: stream.messages });
        }
        if stream.late > 0 {
            health.warnings.push(Warning::Late { topic: topic(), count: stream.late, of: stream.messages });
        }
        // A force, behind these, may be sent only when it changes.
        if place < Stream::ALL.len() && stream.pace.gaps > 0 && stream.pace.longest_gap_s > GAP_WORTH_A_WORD_S {
            let (count, longest_s) = (stream.pace.gaps, stream.pace.longest_gap_s);
            health.warnings.push(Warning::Gap { topic: topic(), longest_s, count });
        }
    }
}

fn check_not_empty(path: &Path, files: &[FileHealth]) -> Result<(), BagError> {
    if files.iter().any(|file| file.messages > 0) {
        return Ok(());
    }
    let damage: Vec<String> = files.iter().flat_map(FileHealth::warnings).map(|warning| warning.to_string()).collect();
    let lost = if damage.is_empty() { String::new() } else { format!("; {}", damage.join("; ")) };
    Err(BagError::Empty { path: path.to_owned(), lost })
}

/// Every stream has its type, every required one is there and usable.
fn check_streams(
    path: &Path,
    collected: &Collected,
    options: &ReadOptions,
    topics: &[Arc<TopicInfo>],
) -> Result<(), BagError> {
    let mut missing = vec![];
    for stream in collected.all() {
        let name = options.topics.of(stream.stream());
        // A bag may hold one name with two types; none of them may be foreign.
        let mut mine = topics.iter().filter(|topic| topic.name == name);
        if let Some(found) = mine.find_map(|topic| stream.foreign_type(topic)) {
            return Err(BagError::Type {
                path: path.to_owned(),
                topic: name.to_owned(),
                stream: stream.stream(),
                expected: stream.type_name(),
                found,
            });
        }
        if stream.is_empty() && options.required.contains(&stream.stream()) {
            if let Some(first) = &stream.health().first_fault {
                return Err(BagError::Unusable {
                    path: path.to_owned(),
                    topic: name.to_owned(),
                    messages: stream.health().messages,
                    first: first.clone(),
                });
            }
            missing.push(describe_missing(stream, name, topics));
        }
    }
    if missing.is_empty() {
        return Ok(());
    }
    Err(BagError::Missing { path: path.to_owned(), missing, present: present(topics) })
}

/// The topics of a bag in words.
fn present(topics: &[Arc<TopicInfo>]) -> String {
    let name = |topic: &Arc<TopicInfo>| format!("{} ({})", shown(&topic.name), shown(&topic.type_name));
    let mut present: Vec<String> = topics.iter().take(MOST_TOPICS).map(name).collect();
    if topics.len() > MOST_TOPICS {
        present.push(format!("and {} more", topics.len() - MOST_TOPICS));
    }
    present.join(", ")
}

/// Says which topic is missing, and which one may have been meant: one of the type, or else one of a like name.
fn describe_missing(stream: &dyn AnyCollector, wanted: &str, topics: &[Arc<TopicInfo>]) -> String {
    let type_name = stream.type_name();
    let option = format!("--topic {}=", stream.stream());
    if topics.iter().any(|topic| topic.name == wanted) {
        return format!("topic `{wanted}` ({type_name}) has no message");
    }
    let likeness = |topic: &TopicInfo| {
        let name = strsim::jaro_winkler(&topic.name, wanted);
        if topic.type_name == type_name { 1.0 + name } else { name }
    };
    let nearest = topics.iter().max_by(|a, b| likeness(a).total_cmp(&likeness(b)));
    match nearest.filter(|topic| likeness(topic) > 0.85) {
        Some(topic) => {
            let name = shown(&topic.name);
            format!("topic `{wanted}` ({type_name}) is missing; did you mean `{name}`? then give `{option}{name}`")
        }
        None => format!("topic `{wanted}` ({type_name}) is missing; name another with `{option}NAME`"),
    }
}
