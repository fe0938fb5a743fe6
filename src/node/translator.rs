//! Messages of other types as messages of our own, by a map: what a watch hears, cuts into processes and keeps.

use std::path::Path;
use std::sync::Arc;

use serde::Serialize;

use super::intake::mapped::refusal_of;
use govtwin_bag::import::{ImportError, Map, MappedField, MappedTopic, Recurring, RowMessages, Target, topics_of};
use govtwin_bag::msg::definition::DefinitionError;
use govtwin_bag::msg::{EsvState, FluidPressure, GovernorCommand, ServoState};
use govtwin_bag::{Qos, RawMessage, TopicInfo, Topics, cdr};

/// A topic of the map.
struct TranslatedTopic {
    given: String,
    /// Full name.
    name: String,
    info: Option<Arc<TopicInfo>>,
    mapped: Option<MappedTopic>,
    taken: u64,
}

/// Translates message by message.
pub struct Translator {
    map: Map,
    fields: Vec<MappedField>,
    sources: Vec<TranslatedTopic>,
    recurring: Recurring,
    /// Command, ESV, tank pressure, measured state.
    native: [Arc<TopicInfo>; 4],
    /// Signals of which it was told that a message did not hold them.
    told: Vec<Target>,
    words: Vec<String>,
}

impl Translator {
    /// By the map that stands at `path`, into messages on the topics of `topics`.
    ///
    /// # Errors
    /// Where a signal is no field of a topic, or nothing of it is measured.
    pub fn new(map: Map, path: &Path, topics: &Topics) -> Result<Self, ImportError> {
        let fields = map.heard(path)?;
        let wrong = |problem: String| ImportError::File { path: path.to_owned(), problem };
        if fields.iter().all(|field| field.target() != Target::ServomotorPosition) {
            let problem = "the map names no `servomotor_position`, in which processes are seen; add `servomotor_position: /topic.field`";
            return Err(wrong(problem.to_owned()));
        }
        let carried = |error: DefinitionError| wrong(error.to_string());
        let native = [
            Arc::new(TopicInfo::of::<GovernorCommand>(&topics.command, Qos::DEFAULT).map_err(carried)?),
            Arc::new(TopicInfo::of::<EsvState>(&topics.esv, Qos::DEFAULT).map_err(carried)?),
            Arc::new(TopicInfo::of::<FluidPressure>(&topics.tank_pressure, Qos::SENSOR).map_err(carried)?),
            Arc::new(TopicInfo::of::<ServoState>(&topics.servo_state, Qos::SENSOR).map_err(carried)?),
        ];
        let source = |given: String| TranslatedTopic { name: given.clone(), given, info: None, mapped: None, taken: 0 };
        let sources = topics_of(&fields).into_iter().map(source).collect();
        Ok(Self { recurring: Recurring::new(&map), map, fields, sources, native, told: vec![], words: vec![] })
    }

    /// The topics of the map, as it names them.
    pub fn topics(&self) -> impl Iterator<Item = &str> {
        self.sources.iter().map(|source| source.given.as_str())
    }

    /// Says what the topics are called on the bus, where remappings change that.
    ///
    /// # Errors
    /// Those of `resolve`.
    pub fn resolve<E>(&mut self, resolve: impl Fn(&str) -> Result<String, E>) -> Result<(), E> {
        for source in &mut self.sources {
            source.name = resolve(&source.given)?;
        }
        Ok(())
    }

    /// What a user should read, once.
    pub fn words(&mut self) -> Vec<String> {
        std::mem::take(&mut self.words)
    }

    /// The messages that a message of the map's topics stands for, heard when it was, and stamped with the time that it has.
    pub fn take(&mut self, message: &RawMessage) -> Vec<RawMessage> {
        let Some(source) = self.sources.iter_mut().find(|source| source.name == message.topic.name) else {
            return vec![];
        };
        if source.info.as_ref().is_none_or(|known| !Arc::ptr_eq(known, &message.topic)) {
            source.info = Some(Arc::clone(&message.topic));
            source.mapped = match MappedTopic::new(&source.given, &message.topic, &self.fields, &self.map) {
                Ok(mapped) => Some(mapped),
                Err(problem) => {
                    self.words
                        .push(format!("{}: it is not heard: {problem}; mend the map, and start anew", source.name));
                    None
                }
            };
        }
        let Some(mapped) = &mut source.mapped else { return vec![] };
        source.taken += 1;
        let mut row = mapped.take(&message.data, message.log_time_ns, source.taken);
        for (field, state) in mapped.signals() {
            if let Some(refusal) = refusal_of(state).filter(|_| !self.told.contains(&field.target())) {
                self.told.push(field.target());
                let (id, place, why) = (field.target().id(), field.place(), refusal.words());
                self.words.push(format!("{id} (`{place}`): a message is not used: {why}; more are not told"));
            }
        }
        if row.is_empty() {
            return vec![];
        }
        self.recurring.complete(&mut row);
        let RowMessages { command, esv, tank_pressure, servo_state } = RowMessages::of(&row);
        let [command_topic, esv_topic, pressure_topic, state_topic] = &self.native;
        // The state last: a row of the unit takes what came before it.
        [
            translated(message, command_topic, command.as_ref()),
            translated(message, esv_topic, esv.as_ref()),
            translated(message, pressure_topic, tank_pressure.as_ref()),
            translated(message, state_topic, servo_state.as_ref()),
        ]
        .into_iter()
        .flatten()
        .collect()
    }
}

fn translated<M: Serialize>(heard: &RawMessage, topic: &Arc<TopicInfo>, message: Option<&M>) -> Option<RawMessage> {
    // Nothing of our own types fails to be encoded.
    let data = cdr::encode(message?).ok()?;
    Some(RawMessage { topic: Arc::clone(topic), data, ..heard.clone() })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn message(name: &str, value: f64, time_ns: i64) -> RawMessage {
        let topic = Arc::new(TopicInfo {
            name: name.into(),
            type_name: "std_msgs/msg/Float64".into(),
            encoding: "cdr".into(),
            ..TopicInfo::default()
        });
        let data = cdr::encode(&value).unwrap();
        RawMessage { topic, log_time_ns: time_ns, publish_time_ns: time_ns, sequence: 0, data }
    }

    fn translator(text: &str) -> Result<Translator, String> {
        let path = Path::new("map.yaml");
        Translator::new(Map::parse(text, path).unwrap(), path, &Topics::default()).map_err(|error| error.to_string())
    }

    #[test]
    fn a_mapped_message_stands_for_messages_of_our_own_with_constants_once_a_second() {
        let mut translator = translator(
            "signals:\n  servomotor_position: {field: /y.data, unit: \"%\"}\n  opening_command: /u.data\n  esv: normal\n",
        )
        .unwrap();
        translator.resolve(|given| Ok::<_, ()>(format!("/unit3{given}"))).unwrap();
        let names = |messages: Vec<RawMessage>| -> Vec<String> {
            messages.into_iter().map(|message| message.topic.name.clone()).collect()
        };
        let first = translator.take(&message("/unit3/y", 40.0, 5));
        let state: ServoState = cdr::decode(&first[1].data).unwrap();
        assert_eq!((state.servomotor_position, state.header.stamp.nanos()), (0.4, Some(5)));
        assert!(state.spool_position.is_nan());
        assert_eq!(names(first), ["/governor/esv", "/plant/servo_state"]);
        assert_eq!(names(translator.take(&message("/unit3/u", 0.3, 6))), ["/governor/command"]);
        assert_eq!(
            names(translator.take(&message("/unit3/y", 41.0, 1_000_000_005))),
            ["/governor/esv", "/plant/servo_state"]
        );
        assert!(translator.take(&message("/y", 40.0, 7)).is_empty() && translator.words().is_empty());
        for _ in 0..2 {
            assert!(translator.take(&message("/unit3/y", f64::NAN, 8)).is_empty());
        }
        let said = translator.words();
        assert!(said.len() == 1 && said[0].contains("servomotor_position (`/y.data`)"), "{said:?}");
    }

    #[test]
    fn a_map_without_a_servomotor_or_with_a_field_that_is_not_there_is_told() {
        let said = translator("signals:\n  opening_command: /u.data\n").err().unwrap();
        assert!(said.contains("names no `servomotor_position`"), "{said}");
        let mut translator = translator("signals:\n  servomotor_position: /y.value\n").unwrap();
        assert!(translator.take(&message("/y", 1.0, 1)).is_empty());
        let said = translator.words();
        assert!(said.len() == 1 && said[0].contains("has no field `value`; it has data"), "{said:?}");
    }
}
