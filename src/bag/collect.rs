//! The streams while a bag is read: each takes its own messages, then they become samples on one clock.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::evidence::StreamEvidence;
use super::order::{self, Jump, Silence};
use super::streams::{OpeningCommand, PistonForce, Pressure, Sample, Value, decode};
use super::topic::{RawView, TopicInfo, shown};
use super::translation::Translation;
use super::{Positions, ReadOptions, Stream, StreamHealth, Warning};
use crate::msg::Interface;
use crate::msg::definition;
use govtwin_model::frame::{EsvState, Signals};

/// One stream.
pub(super) struct Collector<V> {
    stream: Stream,
    positions: Positions,
    pub(super) samples: Vec<Sample<V>>,
    /// There was a sample.
    heard: bool,
    pub(super) health: StreamHealth,
    pub(super) evidence: StreamEvidence,
}

/// What the rest of the reader needs of a stream, whatever its value.
pub(super) trait AnyCollector {
    fn stream(&self) -> Stream;
    fn type_name(&self) -> &'static str;
    fn health(&self) -> &StreamHealth;
    fn is_empty(&self) -> bool;
    /// Takes a message of this stream's topic.
    fn take(&mut self, message: RawView<'_>);
    /// What the topic carries instead of the stream's type.
    fn foreign_type(&self, topic: &TopicInfo) -> Option<String>;
    /// Whether the clock of the stamps shows a time near 0 that is a time, as a simulation's does.
    fn is_near_zero(&self) -> bool;
    /// Takes the log time for the time of samples whose stamp is 0.
    fn date_by_log(&mut self);
    /// Moves all stamps onto the recorder's clock, by the least delay of a message.
    fn align_by_log(&mut self);
    /// Puts samples into the order of arrival, drops stray stamps, gives the log times.
    fn arrive(&mut self) -> Vec<i64>;
    /// Lets a state of before the recording hold into it.
    fn hold_first(&mut self, silences: &[Silence]);
    /// The jumps of the clock.
    fn jumps(&self, silences: &[Silence]) -> Vec<Jump>;
    /// The run of each sample between the common jumps.
    fn runs(&self, own: &[Jump], common: &[Jump]) -> Vec<usize>;
    fn keep_run(&mut self, runs: &[usize], run: usize);
    /// Puts samples into the order of their stamps.
    fn sort(&mut self);
}

/// Where the definition of a topic's messages differs from the one that this crate knows. A schema in another language, or none, leaves the name
/// as the only witness.
fn difference(topic: &TopicInfo) -> Option<String> {
    let schema = std::str::from_utf8(&topic.schema).ok().filter(|_| topic.schema_encoding == "ros2msg")?;
    let found = definition::parse_schema(&topic.type_name, schema).ok()?;
    let expected = definition::closure_of(&topic.type_name).ok()?;
    definition::difference(&expected, &found)
}

impl<V: Value> Collector<V> {
    fn new(stream: Stream, options: &ReadOptions) -> Self {
        let health = StreamHealth { topic: options.topics.of(stream).to_owned(), ..StreamHealth::default() };
        let evidence = StreamEvidence::new(stream);
        Self { stream, positions: options.positions, samples: vec![], heard: false, health, evidence }
    }
}

impl<V: Value> AnyCollector for Collector<V> {
    fn stream(&self) -> Stream {
        self.stream
    }

    fn type_name(&self) -> &'static str {
        V::Message::TYPE_NAME
    }

    fn health(&self) -> &StreamHealth {
        &self.health
    }

    fn is_empty(&self) -> bool {
        !self.heard
    }

    fn take(&mut self, message: RawView<'_>) {
        if let Some(sample) = decode(message, self.positions, &mut self.health, &mut self.evidence) {
            self.heard = true;
            self.samples.push(sample);
        }
    }

    fn foreign_type(&self, topic: &TopicInfo) -> Option<String> {
        if topic.type_name != V::Message::TYPE_NAME {
            return Some(format!("`{}`", shown(&topic.type_name)));
        }
        if topic.encoding != "cdr" {
            return Some(format!("that type, but encoded as `{}` instead of `cdr`", shown(&topic.encoding)));
        }
        let difference = difference(topic)?;
        // Another layout of the same fields is read by their names.
        let problem = Translation::new(topic).err()?;
        Some(format!("another version of it: {difference} ({problem})"))
    }

    fn is_near_zero(&self) -> bool {
        order::is_near_zero(&self.samples)
    }

    fn date_by_log(&mut self) {
        order::date_by_log(&mut self.samples, &mut self.health);
    }

    fn align_by_log(&mut self) {
        order::align_by_log(&mut self.samples);
    }

    fn arrive(&mut self) -> Vec<i64> {
        self.samples.sort_by_key(|sample| sample.log_time_ns);
        self.hold_first(&[]);
        order::drop_strays(&mut self.samples, &mut self.health);
        self.samples.iter().map(|sample| sample.log_time_ns).collect()
    }

    fn hold_first(&mut self, silences: &[Silence]) {
        if self.stream == Stream::Esv {
            order::hold_first(&mut self.samples, silences);
        }
    }

    fn jumps(&self, silences: &[Silence]) -> Vec<Jump> {
        order::jumps_of(&self.samples, silences, &self.health.topic)
    }

    fn runs(&self, own: &[Jump], common: &[Jump]) -> Vec<usize> {
        order::runs(&self.samples, own, common)
    }

    fn keep_run(&mut self, runs: &[usize], run: usize) {
        order::keep_run(&mut self.samples, runs, run, &mut self.health);
    }

    fn sort(&mut self) {
        order::by_stamp(&mut self.samples, &mut self.health);
    }
}

/// All of them.
pub(super) struct Collected {
    pub(super) command: Collector<OpeningCommand>,
    pub(super) esv: Collector<EsvState>,
    pub(super) tank_pressure: Collector<Pressure>,
    pub(super) servo_state: Collector<Signals>,
    pub(super) load: Collector<PistonForce>,
    /// By the address of what messages of one announcement share, which is kept so that nothing else gets that address.
    known: BTreeMap<usize, Announced>,
    /// Messages that were read by another definition of their type than the known one, by topic.
    pub(super) translated: BTreeMap<String, (String, u64)>,
}

/// A topic as one channel announces it.
struct Announced {
    #[expect(dead_code, reason = "kept so that nothing else gets its address")]
    topic: Arc<TopicInfo>,
    stream: Option<Stream>,
    /// How its messages become those of the known definition, where they are of another one.
    translation: Option<Translation>,
}

impl Collected {
    pub(super) fn new(options: &ReadOptions) -> Self {
        Self {
            command: Collector::new(Stream::Command, options),
            esv: Collector::new(Stream::Esv, options),
            tank_pressure: Collector::new(Stream::TankPressure, options),
            servo_state: Collector::new(Stream::ServoState, options),
            load: Collector::new(Stream::Load, options),
            known: BTreeMap::new(),
            translated: BTreeMap::new(),
        }
    }

    pub(super) fn all(&self) -> [&dyn AnyCollector; 5] {
        [&self.command, &self.esv, &self.tank_pressure, &self.servo_state, &self.load]
    }

    fn all_mut(&mut self) -> [&mut dyn AnyCollector; 5] {
        [&mut self.command, &mut self.esv, &mut self.tank_pressure, &mut self.servo_state, &mut self.load]
    }

    /// Takes a message; false where it is on none of the topics.
    pub(super) fn take(&mut self, message: RawView<'_>) -> bool {
        let address = Arc::as_ptr(message.topic).addr();
        if !self.known.contains_key(&address) {
            let announced = self.announced(message.topic);
            self.known.insert(address, announced);
        }
        let Some(Announced { stream: Some(stream), translation, .. }) = self.known.get(&address) else { return false };
        let stream = *stream;
        let translated = translation.as_ref().map(|translation| translation.of(message.data).unwrap_or_default());
        let message = match &translated {
            Some(data) => RawView { data, ..message },
            None => message,
        };
        if let Some(known) = self.translated.get_mut(&message.topic.name).filter(|_| translated.is_some()) {
            known.1 += 1;
        }
        match stream {
            Stream::Command => self.command.take(message),
            Stream::Esv => self.esv.take(message),
            Stream::TankPressure => self.tank_pressure.take(message),
            Stream::ServoState => self.servo_state.take(message),
            Stream::Load => self.load.take(message),
        }
        true
    }

    /// What is known of a topic, by name and definition once for each announcement of it.
    fn announced(&mut self, topic: &Arc<TopicInfo>) -> Announced {
        let stream = self.all().iter().find(|one| one.health().topic == topic.name).map(|one| one.stream());
        let other = stream.and_then(|_| difference(topic));
        let translation = other.as_ref().and_then(|_| Translation::new(topic).ok());
        if let Some(other) = other.filter(|_| translation.is_some()) {
            self.translated.entry(topic.name.clone()).or_insert((other, 0));
        }
        Announced { topic: Arc::clone(topic), stream, translation }
    }

    /// Leaves the samples of one clock, each stream in the order of its stamps.
    ///
    /// Where the clock of the stamps jumps, the run between two jumps that has most samples stays.
    pub(super) fn settle(&mut self, by_log: bool) -> Option<Warning> {
        if by_log {
            for stream in self.all_mut() {
                stream.align_by_log();
            }
        }
        if !self.all().iter().any(|stream| stream.is_near_zero()) {
            for stream in self.all_mut() {
                stream.date_by_log();
            }
        }
        let silences = order::silences(self.all_mut().map(AnyCollector::arrive).concat());
        self.all_mut().into_iter().for_each(|stream| stream.hold_first(&silences));
        let own = self.all().map(|stream| stream.jumps(&silences));
        let common = order::together(own.concat());
        let warning = common.first().map(|first| {
            let mut of = 0;
            let runs: Vec<Vec<usize>> =
                self.all().iter().zip(&own).map(|(stream, own)| stream.runs(own, &common)).collect();
            let mut sizes = vec![0_u64; common.len() + 1];
            for run in runs.iter().flatten() {
                sizes[*run] += 1;
                of += 1;
            }
            let most = sizes.iter().copied().max().unwrap_or_default();
            let longest = sizes.iter().position(|size| *size == most).unwrap_or_default();
            for (stream, runs) in self.all_mut().into_iter().zip(&runs) {
                stream.keep_run(runs, longest);
            }
            let (topic, from_ns, to_ns) = (first.topic.clone(), first.from_ns, first.to_ns);
            let (jumps, left_out) = (common.len() as u64, of - most);
            if common.iter().all(|jump| jump.pause) {
                Warning::Pause { topic, from_ns, to_ns, pauses: jumps, left_out }
            } else {
                Warning::ClockJump { topic, from_ns, to_ns, jumps, left_out }
            }
        });
        for stream in self.all_mut() {
            stream.sort();
        }
        warning
    }

    /// Health and evidence of each of [`Stream::ALL`]; behind these the health of the load, where it has messages.
    pub(super) fn finish(self) -> (Vec<StreamHealth>, [StreamEvidence; 4]) {
        let Self { command, esv, tank_pressure, servo_state, load, .. } = self;
        let mut health = vec![command.health, esv.health, tank_pressure.health, servo_state.health];
        health.extend(Some(load.health).filter(|health| health.messages > 0));
        let evidence = [command.evidence, esv.evidence, tank_pressure.evidence, servo_state.evidence];
        (health, evidence)
    }
}
