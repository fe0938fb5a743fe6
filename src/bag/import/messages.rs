//! Messages of any type as rows by a map: one implementation for the bags that are read and for the bus that is heard.

use std::path::Path;

use super::ImportError;
use super::map::{Map, SignalPlace};
use super::row::{ImportedRow, Target};
use super::source::channel::{ChannelValue, SourceChannel};
use crate::{FieldPath, FieldReader, FieldValue, TopicInfo};
use govtwin_model::params::FileProblem;

/// A signal of a map that is a field of messages.
#[derive(Clone, Debug)]
pub struct MappedField {
    channel: SourceChannel,
    path: FieldPath,
    place: String,
}

impl MappedField {
    /// The signal.
    pub fn target(&self) -> Target {
        self.channel.map.target
    }

    /// The topic, as the map names it.
    pub fn topic(&self) -> &str {
        &self.path.topic
    }

    /// The field as the map writes it, `/topic.field[index]`.
    pub fn place(&self) -> &str {
        &self.place
    }
}

impl Map {
    /// The signals that are fields of messages, in the order of the map.
    ///
    /// # Errors
    /// In words, where a field is no path.
    pub(super) fn fields(&self) -> Result<Vec<MappedField>, String> {
        let field = |(number, one): (usize, &super::SignalMap)| {
            let SignalPlace::Field(place) = &one.from else { return None };
            let path = FieldPath::parse(place).map_err(|problem| format!("{}: {problem}", one.target.id()));
            let channel = SourceChannel::new(number, one);
            Some(path.map(|path| MappedField { channel, path, place: place.clone() }))
        };
        self.signals.iter().enumerate().filter_map(field).collect()
    }

    /// The signals of a map that is to be heard on a bus, where there are topics and no columns; `path` is the map's, for words.
    ///
    /// # Errors
    /// Where a signal is a column, or a field is no path; all problems come at once.
    pub fn heard(&self, path: &Path) -> Result<Vec<MappedField>, ImportError> {
        let mut problems = vec![];
        for signal in &self.signals {
            let message = match &signal.from {
                SignalPlace::Column(name) => {
                    format!("`{name}` is a column, and a bus has topics; expected `field: /topic.field`")
                }
                SignalPlace::Field(place) => match FieldPath::parse(place) {
                    Ok(_) => continue,
                    Err(problem) => problem,
                },
                SignalPlace::Constant(_) => continue,
            };
            problems.push(FileProblem { line: signal.line, key: format!("signals.{}", signal.target.id()), message });
        }
        if !problems.is_empty() {
            return Err(ImportError::Map { path: path.to_owned(), problems });
        }
        self.fields().map_err(|problem| ImportError::file(path, problem))
    }

    /// The value of a signal that is a constant, in its unit after the import; of the ESV 1 is normal and 0 is shutdown.
    pub fn constant(&self, target: Target) -> Option<f64> {
        self.signals.iter().filter(|signal| signal.target == target).find_map(|signal| match signal.from {
            SignalPlace::Constant(value) => Some(value),
            _ => None,
        })
    }
}

/// What a message held of a signal.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum FieldState {
    /// A value.
    #[default]
    Value,
    /// Not the field: an array was shorter, a name was not in its list, or the message was cut short.
    Absent,
    /// Two elements of the name that the map gives.
    Twice,
    /// A number that is not finite.
    NotFinite,
    /// Text, where a number is expected.
    Text,
}

/// A signal of a topic.
#[derive(Clone, Debug)]
struct TopicSignal {
    field: MappedField,
    state: FieldState,
    /// Messages that did not hold the field.
    absent: u64,
    /// Messages in which the element that the map names stands twice.
    twice: u64,
    /// Of an element that the map names by its number: what the first message and the newest call it, and how often that was another name than before.
    element: Option<[String; 2]>,
    renamed: u64,
}

/// The messages of one topic, which hold one or more signals.
#[derive(Clone, Debug)]
pub struct MappedTopic {
    reader: FieldReader,
    /// The definition that the reader is of, of several of the topic.
    definition: Option<TopicInfo>,
    signals: Vec<TopicSignal>,
    by_log: bool,
    stamp_ns: Option<i64>,
    undated: u64,
}

impl MappedTopic {
    /// The fields among `fields` that are of the topic which the map calls `name`, in messages that `topic` describes.
    ///
    /// # Errors
    /// In words with the signal's name, where the type's definition is not known, or it has no such field.
    pub fn new(name: &str, topic: &TopicInfo, fields: &[MappedField], map: &Map) -> Result<Self, String> {
        let reader = FieldReader::new(topic).map_err(|problem| format!("topic `{}`: {problem}", topic.name))?;
        let mut signals = vec![];
        for field in fields.iter().filter(|field| field.topic() == name) {
            reader.check(&field.path).map_err(|problem| format!("{}: {problem}", field.target().id()))?;
            signals.push(TopicSignal {
                field: field.clone(),
                state: FieldState::Absent,
                absent: 0,
                twice: 0,
                element: None,
                renamed: 0,
            });
        }
        Ok(Self { reader, definition: None, signals, by_log: map.time.by_log, stamp_ns: None, undated: 0 })
    }

    /// Reads the messages that follow by the definition of another channel of the topic.
    ///
    /// # Errors
    /// In words with the signal's name, where that definition is not known, or has no such field.
    pub(super) fn by_definition(&mut self, topic: &TopicInfo) -> Result<(), String> {
        let same = |known: &TopicInfo| {
            (&known.type_name, &known.schema_encoding, &known.schema)
                == (&topic.type_name, &topic.schema_encoding, &topic.schema)
        };
        if self.definition.as_ref().is_some_and(same) {
            return Ok(());
        }
        let reader = FieldReader::new(topic).map_err(|problem| format!("topic `{}`: {problem}", topic.name))?;
        for TopicSignal { field, .. } in &self.signals {
            reader.check(&field.path).map_err(|problem| {
                format!(
                    "{}: topic `{}` has two definitions, and in one of them {problem}",
                    field.target().id(),
                    topic.name
                )
            })?;
        }
        (self.reader, self.definition) = (reader, Some(topic.clone()));
        Ok(())
    }

    /// Reads a message: a row with the values of those signals that it holds. Its time is that of the message's header, or `log_time_ns` where it
    /// has none; `place` is the message's number, for words.
    pub fn take(&mut self, data: &[u8], log_time_ns: i64, place: u64) -> ImportedRow {
        self.stamp_ns = self.reader.stamp_ns(data).filter(|_| !self.by_log);
        self.undated += u64::from(self.stamp_ns.is_none() && !self.by_log);
        let mut row = ImportedRow::at(self.stamp_ns.unwrap_or(log_time_ns));
        for TopicSignal { field, state, absent, twice, element, renamed } in &mut self.signals {
            let (value, name) = self.reader.element(&field.path, data);
            if value.is_none() && name.is_some() {
                *twice += 1;
                *state = FieldState::Twice;
                continue;
            }
            if let Some(name) = name {
                let [first, newest] = element.take().unwrap_or_else(|| [name.clone(), name.clone()]);
                *renamed += u64::from(newest != name);
                *element = Some([first, name]);
            }
            let (value, otherwise) = match &value {
                Some(FieldValue::Number(number)) => (ChannelValue::Number(*number), FieldState::NotFinite),
                Some(FieldValue::Text(text)) => (ChannelValue::Text(text), FieldState::Text),
                None => {
                    *absent += 1;
                    *state = FieldState::Absent;
                    continue;
                }
            };
            field.channel.take(value, place, &mut row);
            *state = if row.value(field.target()).is_some() { FieldState::Value } else { otherwise };
        }
        row
    }

    /// The time of the newest message by its own header, ns; none where it has none, or the map takes the time of recording.
    pub fn stamp_ns(&self) -> Option<i64> {
        self.stamp_ns
    }

    /// The signals, and what the newest message held of each.
    pub fn signals(&self) -> impl Iterator<Item = (&MappedField, FieldState)> {
        self.signals.iter().map(|signal| (&signal.field, signal.state))
    }

    /// Whether a trip was seen that is to stay.
    pub fn is_latched(&self) -> bool {
        self.signals.iter().any(|signal| signal.field.channel.is_latched())
    }

    /// Goes on with a trip that was seen before.
    pub fn latch(&mut self) {
        self.signals.iter_mut().for_each(|signal| signal.field.channel.latch());
    }

    /// Messages without a time of their own.
    pub(super) fn undated(&self) -> u64 {
        self.undated
    }

    /// The channels, each with how many messages did not hold its field.
    pub(super) fn channels(&self) -> impl Iterator<Item = (&SourceChannel, u64)> {
        self.signals.iter().map(|signal| (&signal.field.channel, signal.absent))
    }

    /// Elements that are not always the same, and such that stand twice in a message.
    pub(super) fn doubtful(&self) -> impl Iterator<Item = String> {
        self.signals.iter().flat_map(|TopicSignal { field, twice, element, renamed, .. }| {
            let (id, place) = (field.target().id(), &field.place);
            let twice = (*twice > 0).then(|| {
                format!(
                    "{id} (`{place}`): {twice} messages have two elements of this name and are not read; in the map, put the number of the element in \
                     the place of its name"
                )
            });
            let renamed = element.as_ref().filter(|_| *renamed > 0).map(|[first, newest]| {
                format!(
                    "{id} (`{place}`): the messages call this element by another name than before {renamed} times, `{first}` in the first and \
                     `{newest}` in the last; in the map, put the name that you mean in the place of its number: `[{first}]`"
                )
            });
            twice.into_iter().chain(renamed)
        })
    }
}

/// The topics of fields, each once, in the order of the map.
pub fn topics_of(fields: &[MappedField]) -> Vec<String> {
    let mut topics: Vec<String> = vec![];
    for field in fields {
        if topics.iter().all(|topic| topic != field.topic()) {
            topics.push(field.topic().to_owned());
        }
    }
    topics
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cdr;
    use crate::msg::{Interface, JointState};

    fn map(text: &str) -> Map {
        Map::parse(text, Path::new("map.yaml")).unwrap()
    }

    fn float64() -> TopicInfo {
        TopicInfo {
            name: "/y".into(),
            type_name: "std_msgs/msg/Float64".into(),
            encoding: "cdr".into(),
            ..TopicInfo::default()
        }
    }

    #[test]
    fn a_topic_gives_the_signals_that_the_map_finds_in_it() {
        let map = map(
            "signals:\n  opening_command: {field: /y.data, unit: \"%\"}\n  esv: {field: /y.data, shutdown: \"< -50\", latch: true}\n",
        );
        let fields = map.heard(Path::new("map.yaml")).unwrap();
        assert_eq!(topics_of(&fields), ["/y"]);
        let mut topic = MappedTopic::new("/y", &float64(), &fields, &map).unwrap();
        let mut take = |value: f64| {
            let row = topic.take(&cdr::encode(&value).unwrap(), 7, 1);
            (row.time_ns, row.value(Target::OpeningCommand), row.value(Target::Esv), topic.signals().next().unwrap().1)
        };
        assert_eq!(take(30.0), (7, Some(0.3), Some(1.0), FieldState::Value));
        assert_eq!(
            take(f64::NAN),
            (7, None, None, FieldState::NotFinite),
            "what is no number says nothing of the ESV either"
        );
        assert_eq!(take(f64::INFINITY).3, FieldState::NotFinite);
        assert_eq!(take(-60.0), (7, Some(-0.6), Some(0.0), FieldState::Value));
        assert_eq!(take(30.0), (7, Some(0.3), Some(0.0), FieldState::Value), "a latched trip stays");
        assert!(topic.is_latched() && topic.stamp_ns().is_none());
        let row = topic.take(&[0, 1, 0, 0, 1, 2], 9, 2);
        assert!(row.is_empty() && topic.signals().all(|(_, state)| state == FieldState::Absent), "cut short");
    }

    #[test]
    fn an_element_that_stands_twice_is_not_read() {
        let map = map("signals: {servomotor_position: '/j.position[gate]', spool_position: '/j.position[spool]'}");
        let fields = map.heard(Path::new("map.yaml")).unwrap();
        let joints = TopicInfo { name: "/j".into(), type_name: JointState::TYPE_NAME.into(), ..float64() };
        let mut topic = MappedTopic::new("/j", &joints, &fields, &map).unwrap();
        let name = ["gate", "spool", "gate"].map(str::to_owned).to_vec();
        let message = JointState { name, position: vec![0.1, 0.2, 0.3], ..JointState::default() };
        let row = topic.take(&cdr::encode(&message).unwrap(), 7, 1);
        assert_eq!([Target::ServomotorPosition, Target::SpoolPosition].map(|one| row.value(one)), [None, Some(0.2)]);
        assert!(topic.signals().map(|(_, state)| state).eq([FieldState::Twice, FieldState::Value]));
        let said: Vec<String> = topic.doubtful().collect();
        assert!(said.len() == 1 && said[0].contains("(`/j.position[gate]`): 1 messages have two elements"), "{said:?}");
    }

    #[test]
    fn what_a_bus_does_not_have_is_told_with_its_line() {
        let map = map(
            "signals:\n  opening_command: {column: y}\n  servomotor_position: {field: y.data}\n  tank_pressure: {constant: 6.0, unit: MPa}\n",
        );
        let said = map.heard(Path::new("map.yaml")).unwrap_err().to_string();
        for words in ["2: signals.opening_command: `y` is a column", "expected `field: /topic.field`", "found `y.data`"]
        {
            assert!(said.contains(words), "{said}");
        }
        assert_eq!(map.constant(Target::TankPressure), Some(6.0e6));
        assert_eq!(map.constant(Target::OpeningCommand), None);
    }

    #[test]
    fn a_field_or_type_that_does_not_exist_is_told_by_its_signal() {
        let map = map("signals:\n  opening_command: /y.value\n");
        let fields = map.heard(Path::new("map.yaml")).unwrap();
        let said = MappedTopic::new("/y", &float64(), &fields, &map).unwrap_err();
        assert!(said.contains("opening_command: `std_msgs/msg/Float64` has no field `value`; it has data"), "{said}");
        let unknown = TopicInfo { type_name: "plant_msgs/msg/Own".into(), ..float64() };
        let said = MappedTopic::new("/y", &unknown, &fields, &map).unwrap_err();
        assert!(said.contains("no `ros2msg` definition of `plant_msgs/msg/Own`"), "{said}");
    }
}
