//! What the participant found on the bus: endpoints of others, by topic, and which of them do not go together with the node's.

use std::collections::BTreeMap;

use ros2_client::Gid;
use rustdds::RTPSEntity;
use rustdds::policy::Reliability;

use super::super::offer::{Describer, Offer, ros_type};
use super::super::transport::participant_of;
use super::{Bus, Endpoint};

impl Bus {
    /// What others write: for each writer's id, its topic and type as ROS 2 names them.
    pub fn writers(&self) -> BTreeMap<Gid, (String, String)> {
        let writers = self.context.domain_participant().discovered_writers();
        let named = writers.into_iter().filter_map(|writer| {
            let data = writer.publication_topic_data;
            let topic = data.topic_name.strip_prefix("rt")?.to_owned();
            Some((Gid::from(data.key), (topic, ros_type(&data.type_name))))
        });
        named.collect()
    }

    /// Whether a publisher sends lost samples again, as one does that does not say; `None` while it is not listed.
    pub(in super::super) fn is_reliable(&self, writer: Gid) -> Option<bool> {
        let writers = self.context.domain_participant().discovered_writers();
        let mut data = writers.iter().map(|writer| &writer.publication_topic_data);
        let reliability = data.find(|data| Gid::from(data.key) == writer)?.qos().reliability();
        Some(!matches!(reliability, Some(Reliability::BestEffort)))
    }

    /// The publishers of other nodes.
    pub(in super::super) fn offers(&self) -> Vec<Offer> {
        let own = self.context.domain_participant();
        let offers = own.discovered_writers().iter().filter_map(Offer::of).collect::<Vec<_>>();
        offers.into_iter().filter(|offer| offer.process != participant_of(own.guid())).collect()
    }

    /// Services of other nodes that describe types.
    pub(in super::super) fn describers(&self) -> Vec<Describer> {
        let own = self.context.domain_participant();
        let describers = own.discovered_readers().iter().filter_map(Describer::of).collect::<Vec<_>>();
        describers.into_iter().filter(|describer| describer.process != participant_of(own.guid())).collect()
    }

    /// How many writers other participants have on this topic, given by its full name.
    pub(crate) fn writers_of(&self, full_name: &str) -> usize {
        let own = self.context.domain_participant();
        let own_id = participant_of(own.guid());
        let dds_name = format!("rt{full_name}");
        let writers = own.discovered_writers();
        let others = writers.iter().map(|writer| &writer.publication_topic_data);
        others.filter(|data| data.topic_name == dds_name && participant_of(data.key) != own_id).count()
    }

    /// How many readers other participants have on this topic, given by its full name.
    pub fn readers_of(&self, full_name: &str) -> usize {
        self.others_that_read(&format!("rt{full_name}"))
    }

    /// How many servers other participants have of this service, given by its full name.
    pub(crate) fn servers_of(&self, full_name: &str) -> usize {
        self.others_that_read(&format!("rq{full_name}Request"))
    }

    fn others_that_read(&self, dds_name: &str) -> usize {
        let own = self.context.domain_participant();
        let own_id = participant_of(own.guid());
        let readers = own.discovered_readers();
        let others = readers.iter().map(|reader| &reader.subscription_topic_data);
        others.filter(|data| *data.topic_name() == dds_name && participant_of(data.key()) != own_id).count()
    }

    /// Endpoints of others on the node's topics with which no sample is exchanged, since their qualities of service do not go
    /// together: each one's id, and why in words.
    pub(crate) fn incompatible(&self) -> Vec<(Gid, String)> {
        let own = self.context.domain_participant();
        let (writers, readers) = (own.discovered_writers(), own.discovered_readers());
        let mut found = Vec::new();
        for Endpoint { topic, writes, qos } in &self.endpoints {
            let dds_name = format!("rt{topic}");
            if *writes {
                let data = readers.iter().map(|reader| &reader.subscription_topic_data);
                for data in data.filter(|data| *data.topic_name() == dds_name) {
                    if let Some(policy) = qos.compliance_failure_wrt(&data.qos()) {
                        let words = format!("{topic}: a subscription asks for more {policy:?} than is offered");
                        found.push((Gid::from(data.key()), words));
                    }
                }
            } else {
                let data = writers.iter().map(|writer| &writer.publication_topic_data);
                // Another reader of the node may be there for it.
                let own = self.endpoints.iter().filter(|other| !other.writes && other.topic == *topic);
                for data in data.filter(|data| data.topic_name == dds_name) {
                    let is_read = own.clone().any(|other| data.qos().compliance_failure_wrt(&other.qos).is_none());
                    if let Some(policy) = data.qos().compliance_failure_wrt(qos).filter(|_| !is_read) {
                        let words = format!("{topic}: a publisher offers less {policy:?} than is asked for");
                        found.push((Gid::from(data.key), words));
                    }
                }
            }
        }
        found
    }
}
