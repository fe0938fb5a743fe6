//! From a bag to a recording: find the streams, decode, order, align.

use std::path::Path;
use std::sync::Arc;

use super::align::{self, Streams};
use super::order;
use super::source::{self, Source};
use super::streams::{Command, Pressure, Sample, Value, decode};
use super::topic::{RawView, TopicInfo};
use super::{BagError, Health, Loaded, ReadOptions, Stream, StreamHealth, Warning};
use crate::frame::{EsvState, Signals};
use crate::msg::Interface;
use crate::recording::Recording;

/// Reads a bag into a recording.
///
/// # Errors
/// Where there is no bag, a required stream is missing or has another type, or nothing is usable.
/// Damage, late, doubled and impossible values are no errors: they are counted in the health.
pub fn read(path: &Path, options: &ReadOptions) -> Result<Loaded, BagError> {
    let source = source::open(path)?;
    let mut collected = Collected::new(options);
    let (files, topics) = source.scan(&mut |message| collected.take(message))?;
    let mut health = Health { files, streams: vec![], warnings: source.warnings.clone() };
    collected.check(&source, options, &topics, &health)?;
    let mut streams = Streams {
        command: collected.command.finish(),
        esv: collected.esv.finish(),
        tank_pressure: collected.tank_pressure.finish(),
        servo_state: collected.servo_state.finish(),
    };
    health.streams = vec![
        collected.command.health,
        collected.esv.health,
        collected.tank_pressure.health,
        collected.servo_state.health,
    ];
    warn(&mut health);
    if streams.command.is_empty() {
        streams.command = align::constant(Command(f64::NAN));
        fill(&mut health, options, Stream::Command, "NaN");
    }
    if streams.esv.is_empty() {
        streams.esv = align::constant(EsvState::Normal);
        fill(&mut health, options, Stream::Esv, "state normal");
    }
    if streams.tank_pressure.is_empty() {
        streams.tank_pressure = align::constant(Pressure(f64::NAN));
        fill(&mut health, options, Stream::TankPressure, "NaN");
    }
    let frames = align::align(&streams, options.interpolation, path)?;
    Ok(Loaded { recording: Recording::new(source.name, frames), health })
}

fn fill(health: &mut Health, options: &ReadOptions, stream: Stream, with: &'static str) {
    health.warnings.push(Warning::Filled { topic: options.topics.of(stream).to_owned(), with });
}

/// Turns counts into warnings.
fn warn(health: &mut Health) {
    for file in &health.files {
        for damage in &file.damage {
            health.warnings.push(Warning::Damaged { path: file.path.clone(), damage: damage.clone() });
        }
    }
    for stream in &health.streams {
        let count = stream.undecodable + stream.bad_stamps + stream.bad_values + stream.conflicts;
        if count > 0 {
            let first = stream.first_fault.clone().unwrap_or_else(|| "one stamp with different values".into());
            health.warnings.push(Warning::Dropped { topic: stream.topic.clone(), count, of: stream.messages, first });
        }
    }
}

/// One stream while its messages come in.
struct Collector<V> {
    stream: Stream,
    topic: String,
    samples: Vec<Sample<V>>,
    health: StreamHealth,
}

impl<V: Value> Collector<V> {
    fn new(stream: Stream, options: &ReadOptions) -> Self {
        let topic = options.topics.of(stream).to_owned();
        let health = StreamHealth { topic: topic.clone(), ..StreamHealth::default() };
        Self { stream, topic, samples: vec![], health }
    }

    fn take(&mut self, message: RawView<'_>) -> bool {
        let mine = message.topic.name == self.topic;
        if mine && let Some(sample) = decode(message.data, message.log_time_ns, &mut self.health) {
            self.samples.push(sample);
        }
        mine
    }

    fn finish(&mut self) -> Vec<Sample<V>> {
        let mut samples = std::mem::take(&mut self.samples);
        samples.sort_by_key(|sample| sample.log_time_ns);
        let samples = order::by_stamp(samples, &mut self.health);
        align::pace(&samples, &mut self.health);
        samples
    }

    /// The stream is there with its own type and at least one usable sample; `Ok(false)` where it is absent.
    fn check(&self, source: &Source, topics: &[Arc<TopicInfo>]) -> Result<bool, BagError> {
        let Some(topic) = topics.iter().find(|topic| topic.name == self.topic) else { return Ok(false) };
        let expected = V::Message::TYPE_NAME;
        if topic.type_name != expected || topic.encoding != "cdr" {
            return Err(BagError::Type {
                path: source.path.clone(),
                topic: self.topic.clone(),
                stream: self.stream,
                expected: expected.to_owned(),
                found: format!("`{}` encoded as `{}`", topic.type_name, topic.encoding),
            });
        }
        Ok(!self.samples.is_empty())
    }
}

struct Collected {
    command: Collector<Command>,
    esv: Collector<EsvState>,
    tank_pressure: Collector<Pressure>,
    servo_state: Collector<Signals>,
}

impl Collected {
    fn new(options: &ReadOptions) -> Self {
        Self {
            command: Collector::new(Stream::Command, options),
            esv: Collector::new(Stream::Esv, options),
            tank_pressure: Collector::new(Stream::TankPressure, options),
            servo_state: Collector::new(Stream::ServoState, options),
        }
    }

    fn take(&mut self, message: RawView<'_>) {
        let _ = self.command.take(message)
            || self.esv.take(message)
            || self.tank_pressure.take(message)
            || self.servo_state.take(message);
    }

    /// Every required stream is there.
    fn check(
        &self,
        source: &Source,
        options: &ReadOptions,
        topics: &[Arc<TopicInfo>],
        health: &Health,
    ) -> Result<(), BagError> {
        if health.files.iter().all(|file| file.messages == 0) {
            let damage = health.files.iter().flat_map(|file| &file.damage).map(|damage| damage.problem.clone());
            let lost = damage.collect::<Vec<_>>().join("; ");
            let lost = if lost.is_empty() { lost } else { format!(" ({lost})") };
            return Err(BagError::Empty { path: source.path.clone(), lost });
        }
        let found = [
            (Stream::Command, self.command.check(source, topics)?, msg_name::<Command>()),
            (Stream::Esv, self.esv.check(source, topics)?, msg_name::<EsvState>()),
            (Stream::TankPressure, self.tank_pressure.check(source, topics)?, msg_name::<Pressure>()),
            (Stream::ServoState, self.servo_state.check(source, topics)?, msg_name::<Signals>()),
        ];
        let missing: Vec<String> = found
            .iter()
            .filter(|(stream, there, _)| !there && options.required.contains(stream))
            .map(|(stream, _, type_name)| describe_missing(options.topics.of(*stream), type_name, topics))
            .collect();
        if missing.is_empty() {
            return Ok(());
        }
        let present = topics.iter().map(|topic| format!("{} ({})", topic.name, topic.type_name)).collect::<Vec<_>>();
        Err(BagError::Missing { path: source.path.clone(), missing, present: present.join(", ") })
    }
}

fn msg_name<V: Value>() -> &'static str {
    V::Message::TYPE_NAME
}

/// Says which topic is missing, and which one may have been meant: one of the type, or else one of a like name.
fn describe_missing(wanted: &str, type_name: &str, topics: &[Arc<TopicInfo>]) -> String {
    let likeness = |topic: &Arc<TopicInfo>| {
        let name = strsim::jaro_winkler(&topic.name, wanted);
        if topic.type_name == type_name { 1.0 + name } else { name }
    };
    let nearest =
        topics.iter().max_by(|a, b| likeness(a).total_cmp(&likeness(b))).filter(|topic| likeness(topic) > 0.8);
    match nearest {
        Some(topic) if topic.name == wanted => format!("topic `{wanted}` ({type_name}) has no usable message"),
        Some(topic) => format!("topic `{wanted}` ({type_name}) is missing; did you mean `{}`?", topic.name),
        None => format!("topic `{wanted}` ({type_name}) is missing"),
    }
}
