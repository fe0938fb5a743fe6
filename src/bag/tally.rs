//! What is counted of each topic while a bag is read, in time that grows with its messages and not with its topics.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::distribution::Distribution;
use super::layout::Layout;
use super::pace::Pace;
use super::topic::{MessageDefinition, RawView, TopicInfo};
use super::topic_survey::{FieldSurvey, Spread, TopicSurvey};
use govtwin_model::units::seconds_from_nanos;

/// Fields of all topics together that are looked into; messages of further topics are counted only.
const MOST_FIELDS: usize = 100_000;

/// The topics of a bag. Two files, or two announcements in one, may name one topic.
#[derive(Default)]
pub(super) struct Tallies {
    all: Vec<Tally>,
    /// By name, type and definition.
    by_name: BTreeMap<MessageDefinition, usize>,
    /// By the address of what messages of one announcement share, which is kept so that nothing else gets that address.
    by_address: BTreeMap<usize, (Arc<TopicInfo>, usize)>,
    /// By the address of the schema, which the first topic with it keeps, and the type.
    layouts: BTreeMap<(usize, String), Option<Arc<Layout>>>,
    fields: usize,
}

impl Tallies {
    pub(super) fn take(&mut self, message: RawView<'_>) {
        let number = self.number(message.topic);
        self.take_as(number, message);
    }

    /// Takes a message of the topic with this number.
    pub(super) fn take_as(&mut self, number: usize, message: RawView<'_>) {
        if let Some(tally) = self.all.get_mut(number) {
            tally.take(message);
        }
    }

    /// The number of a topic, looked up by what its messages share.
    pub(super) fn number(&mut self, topic: &Arc<TopicInfo>) -> usize {
        match self.by_address.get(&address(topic)) {
            Some((_, number)) => *number,
            None => self.of(topic),
        }
    }

    /// The number of a topic, which is new where it has not been met.
    pub(super) fn of(&mut self, topic: &Arc<TopicInfo>) -> usize {
        let name = topic.definition();
        let index = if let Some(index) = self.by_name.get(&name) {
            *index
        } else {
            let layout = self.layout(topic);
            self.all.push(Tally::new(topic, layout));
            self.by_name.insert(name, self.all.len() - 1);
            self.all.len() - 1
        };
        self.by_address.insert(address(topic), (Arc::clone(topic), index));
        index
    }

    /// The layout of a topic's messages, read off each schema once.
    fn layout(&mut self, topic: &Arc<TopicInfo>) -> Option<Arc<Layout>> {
        let key =
            (topic.schema.as_ptr().addr(), format!("{} {} {}", topic.encoding, topic.schema_encoding, topic.type_name));
        let known = self.layouts.entry(key).or_insert_with(|| Layout::of(topic).map(Arc::new));
        let layout = known.as_ref().filter(|layout| self.fields + layout.names().len() <= MOST_FIELDS)?;
        self.fields += layout.names().len();
        Some(Arc::clone(layout))
    }

    /// The findings on all topics, by name.
    pub(super) fn finish(self) -> Vec<TopicSurvey> {
        let mut all: Vec<Option<Tally>> = self.all.into_iter().map(Some).collect();
        let in_order = self.by_name.into_values();
        in_order.filter_map(|index| all.get_mut(index)?.take()).map(Tally::finish).collect()
    }
}

fn address(topic: &Arc<TopicInfo>) -> usize {
    Arc::as_ptr(topic).addr()
}

/// A topic while its messages come in.
struct Tally {
    topic: Arc<TopicInfo>,
    layout: Option<Arc<Layout>>,
    messages: u64,
    bytes: u64,
    log: Pace,
    stamps: Pace,
    delays: Distribution,
    /// The least and the most of them, ns.
    delay_range_ns: Option<(i64, i64)>,
    undecodable: u64,
    fields: Vec<FieldSurvey>,
}

impl Tally {
    fn new(topic: &Arc<TopicInfo>, layout: Option<Arc<Layout>>) -> Self {
        let field =
            |name: &String| FieldSurvey { name: name.clone(), finite: 0, nan: 0, infinite: 0, least: None, most: None };
        Self {
            topic: Arc::clone(topic),
            fields: layout.iter().flat_map(|layout| layout.names().iter().map(field)).collect(),
            layout,
            messages: 0,
            bytes: 0,
            log: Pace::default(),
            stamps: Pace::default(),
            delays: Distribution::default(),
            delay_range_ns: None,
            undecodable: 0,
        }
    }

    fn take(&mut self, message: RawView<'_>) {
        self.messages += 1;
        self.bytes += message.data.len() as u64;
        self.log.push(message.log_time_ns);
        let Some(layout) = &self.layout else { return };
        let fields = &mut self.fields;
        let walked = layout.walk(message.data, &mut |name, value| {
            if let Some(field) = fields.get_mut(name) {
                field.take(value);
            }
        });
        let Some(stamp) = walked else {
            self.undecodable += 1;
            return;
        };
        if let Some(stamp_ns) = stamp.and_then(crate::msg::Time::nanos) {
            self.stamps.push(stamp_ns);
            let delay_ns = message.log_time_ns.saturating_sub(stamp_ns);
            self.delays.push(delay_ns);
            let (least_ns, most_ns) = self.delay_range_ns.unwrap_or((delay_ns, delay_ns));
            self.delay_range_ns = Some((least_ns.min(delay_ns), most_ns.max(delay_ns)));
        }
    }

    fn finish(mut self) -> TopicSurvey {
        // The lower median, as of a list.
        let middle = self.delays.count().saturating_sub(1) / 2;
        let delay_s = self.delay_range_ns.map(|(least_ns, most_ns)| Spread {
            least: seconds_from_nanos(least_ns),
            median: seconds_from_nanos(self.delays.at_rank(middle)),
            most: seconds_from_nanos(most_ns),
        });
        let delay_s = delay_s.filter(|_| self.layout.as_ref().is_some_and(|layout| layout.is_stamped()));
        let schema_hash = self.layout.as_ref().map(|layout| layout.type_hash.as_str());
        let stated_hash = Some(self.topic.type_hash.as_str()).filter(|hash| !hash.is_empty());
        TopicSurvey {
            name: self.topic.name.clone(),
            type_name: self.topic.type_name.clone(),
            encoding: self.topic.encoding.clone(),
            type_hash: self.topic.type_hash.clone(),
            type_hash_fits: stated_hash.zip(schema_hash).map(|(stated, schema)| stated == schema),
            messages: self.messages,
            bytes: self.bytes,
            log: self.log.finish(),
            stamps: delay_s.is_some().then(|| self.stamps.finish()),
            delay_s,
            undecodable: self.undecodable,
            readable: self.layout.is_some(),
            nan: self.fields.iter().map(|field| field.nan).sum(),
            infinite: self.fields.iter().map(|field| field.infinite).sum(),
            fields: self.fields,
        }
    }
}

impl FieldSurvey {
    fn take(&mut self, value: f64) {
        if value.is_finite() {
            self.finite += 1;
            self.least = Some(self.least.map_or(value, |least| least.min(value)));
            self.most = Some(self.most.map_or(value, |most| most.max(value)));
        } else if value.is_nan() {
            self.nan += 1;
        } else {
            self.infinite += 1;
        }
    }
}
