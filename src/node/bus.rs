//! The node on DDS: participant, names, topics and their QoS; the only file that opens and closes them.

mod graph;
mod listed_writer;

use std::collections::BTreeSet;

use ros2_client::builtin_topics::ros_discovery;
use ros2_client::parameters::raw;
use ros2_client::{
    Client, Context, CreateError, Message, Name, Node, NodeName, NodeOptions, Publisher, QosProfile, ServiceMapping,
    ServiceTypeName, Subscription,
};
use ros2args::Ros2ArgsError;
use rustdds::{DomainParticipant, DomainParticipantBuilder, QosPolicies, TopicKind};
use serde::Serialize;

use super::arguments::Arguments;
use super::environment::Environment;
use super::offer::dds_type;
use super::qos::{self, best_effort, kept, reliable};
use super::services::call::Calls;
use super::tap::Tap;
use super::{transport, type_hashes};
use govtwin_bag::msg::Interface;
use govtwin_bag::msg::service::Service;

pub(super) use listed_writer::ListedWriter;

/// The node cannot come on the bus.
#[derive(Debug, thiserror::Error)]
pub enum BusError {
    /// No participant.
    #[error("cannot join DDS domain {domain}: {reason}")]
    Join {
        /// The domain.
        domain: u16,
        /// What RustDDS says.
        reason: String,
    },
    /// A name that is none.
    #[error("`{name}` is no ROS 2 name: {reason}")]
    Name {
        /// The name.
        name: String,
        /// What is wrong with it.
        reason: String,
    },
    /// An endpoint could not be made.
    #[error("cannot open `{topic}`")]
    Open {
        /// The topic or service.
        topic: String,
        /// What the client library says.
        source: CreateError,
    },
    /// A `qos_overrides` parameter.
    #[error("{0}")]
    Qos(String),
    /// The arguments.
    #[error(transparent)]
    Arguments(#[from] Ros2ArgsError),
}

impl BusError {
    fn open(topic: &str, source: rustdds::dds::CreateError) -> Self {
        Self::Open { topic: topic.to_owned(), source: source.into() }
    }
}

/// A node on the bus.
pub struct Bus {
    // Dropped in this order: peers hear that the node goes, then that its participant goes.
    node: Node,
    context: Context,
    arguments: Arguments,
    endpoints: Vec<Endpoint>,
    /// Full names of topics and services before remapping.
    opened: BTreeSet<String>,
}

/// A topic that the node reads or writes, and its quality of service.
struct Endpoint {
    /// Full name.
    topic: String,
    writes: bool,
    qos: QosPolicies,
}

impl Bus {
    /// Joins the domain and announces the node.
    ///
    /// # Errors
    /// When there is no network to join, or the node's name is none.
    pub fn open(environment: &Environment, arguments: Arguments) -> Result<Self, BusError> {
        let join = |reason: String| BusError::Join { domain: environment.domain, reason };
        let mut builder = transport::with_lease(DomainParticipantBuilder::new(environment.domain), environment.lease);
        builder = transport::with_peers(builder, environment.peers.clone());
        if let Some(networks) = &environment.only_networks {
            builder = builder.with_only_networks(networks.iter().copied());
        }
        let participant = builder.build().map_err(|error| join(error.to_string()))?;
        announce_hash(&participant, "rt/rosout", "rcl_interfaces/msg/Log", None);
        let context = Context::from_domain_participant(participant).map_err(|error| join(error.to_string()))?;
        Self::of(context, arguments, environment.domain)
    }

    /// Announces another node of the same process: both share the participant.
    ///
    /// # Errors
    /// When the node's name is none.
    pub(crate) fn beside(&self, arguments: Arguments) -> Result<Self, BusError> {
        Self::of(self.context.clone(), arguments, self.context.domain_id())
    }

    fn of(context: Context, arguments: Arguments, domain: u16) -> Result<Self, BusError> {
        let name = NodeName::new(&arguments.namespace, &arguments.name)
            .map_err(|error| BusError::Name { name: arguments.full_name(), reason: error.to_string() })?;
        let options = NodeOptions::new().enable_rosout(arguments.rosout);
        let node =
            context.new_node(name, options).map_err(|error| BusError::Join { domain, reason: error.to_string() })?;
        Ok(Self { node, context, arguments, endpoints: Vec::new(), opened: BTreeSet::new() })
    }

    /// The node's arguments.
    pub fn arguments(&self) -> &Arguments {
        &self.arguments
    }

    /// The client library's node.
    pub(crate) fn node(&self) -> &Node {
        &self.node
    }

    /// Listens to a topic, best effort.
    ///
    /// # Errors
    /// On a name that is none, or when DDS refuses.
    pub fn subscribe<M: Interface + 'static>(&mut self, topic: &str) -> Result<Subscription<M>, BusError> {
        self.subscribe_with(topic, best_effort())
    }

    /// The same with a quality of service of its own.
    ///
    /// # Errors
    /// As [`Bus::subscribe`].
    pub(super) fn subscribe_with<M: Interface + 'static>(
        &mut self,
        topic: &str,
        qos: QosProfile,
    ) -> Result<Subscription<M>, BusError> {
        let (full_name, topic) = self.topic(topic, (M::TYPE_NAME, None), "subscription", qos)?;
        self.node.create_subscription(&topic, None).map_err(|source| BusError::Open { topic: full_name, source })
    }

    /// Whether a `qos_overrides` parameter names the reliability with which the node reads a topic.
    ///
    /// # Errors
    /// On a name that is none.
    pub(super) fn has_reliability(&self, topic: &str) -> Result<bool, BusError> {
        let name = format!("{}{}.subscription.reliability", qos::PREFIX, self.arguments.resolve(topic)?);
        Ok(self.arguments.parameters.iter().any(|(given, _)| *given == name))
    }

    /// The full name of a topic that is opened later, when it has a publisher.
    ///
    /// # Errors
    /// On a name that is none.
    pub(super) fn await_topic(&mut self, topic: &str) -> Result<String, BusError> {
        let full_name = self.arguments.resolve(topic)?;
        self.opened.insert(self.arguments.expand(topic)?);
        parse_name(&full_name)?;
        Ok(full_name)
    }

    /// Listens to a topic of any type for its bytes.
    ///
    /// # Errors
    /// As [`Bus::subscribe`].
    pub(super) fn tap(&mut self, topic: &str, type_name: &str, qos: &QosProfile) -> Result<Tap, BusError> {
        let (full_name, topic) = self.topic(topic, (type_name, None), "subscription", qos.clone())?;
        let refused = |source: rustdds::dds::CreateError| BusError::open(&full_name, source);
        let subscriber =
            self.context.domain_participant().create_subscriber(&QosPolicies::from(qos)).map_err(refused)?;
        let reader = subscriber.create_simple_datareader_no_key(&topic, None).map_err(refused)?;
        Ok(Tap::new(subscriber, reader))
    }

    /// Listens to what nodes say on the graph of ROS of themselves.
    ///
    /// # Errors
    /// When DDS refuses.
    pub(super) fn tap_graph(&self) -> Result<Tap, BusError> {
        let refused = |source: rustdds::dds::CreateError| BusError::open(ros_discovery::TOPIC_NAME, source);
        let (participant, qos) = (self.context.domain_participant(), QosPolicies::from(&qos::latched()));
        let (topic, kind) = (ros_discovery::TOPIC_NAME.to_owned(), ros_discovery::TYPE_NAME.to_owned());
        let topic = participant.create_topic(topic, kind, &qos, TopicKind::NoKey).map_err(refused)?;
        let subscriber = participant.create_subscriber(&qos).map_err(refused)?;
        let reader = subscriber.create_simple_datareader_no_key(&topic, None).map_err(refused)?;
        Ok(Tap::new(subscriber, reader))
    }

    /// Opens a topic for writing, reliable but never waiting; `type_name` is the full ROS 2 name of `M`.
    ///
    /// # Errors
    /// On a name that is none, or when DDS refuses.
    pub fn publish<M: Serialize>(&mut self, topic: &str, type_name: &str) -> Result<Publisher<M>, BusError> {
        self.publish_as(topic, (type_name, None), reliable())
    }

    /// Opens a topic for writing with a quality of service of its own, and the hash of a type that this crate does not carry.
    ///
    /// # Errors
    /// As [`Bus::publish`].
    pub(super) fn publish_as<M: Serialize>(
        &mut self,
        topic: &str,
        kind: (&str, Option<&str>),
        qos: QosProfile,
    ) -> Result<Publisher<M>, BusError> {
        let (full_name, topic) = self.topic(topic, kind, "publisher", qos)?;
        self.node.create_publisher(&topic, None).map_err(|source| BusError::Open { topic: full_name, source })
    }

    /// The same for samples that are encoded already, by a writer that tells when they have arrived.
    ///
    /// # Errors
    /// As [`Bus::publish`].
    pub(super) fn publish_awaited(
        &mut self,
        topic: &str,
        kind: (&str, Option<&str>),
        qos: QosProfile,
    ) -> Result<ListedWriter, BusError> {
        let (full_name, topic) = self.topic(topic, kind, "publisher", qos)?;
        let (participant, policies) = (self.context.domain_participant(), QosPolicies::from(&reliable()));
        ListedWriter::open(&participant, &mut self.node, &topic, &policies)
            .map_err(|source| BusError::Open { topic: full_name, source })
    }

    /// Opens a topic for writing whose newest message is kept for those who subscribe later.
    ///
    /// # Errors
    /// As [`Bus::publish`].
    pub(crate) fn publish_kept<M: Serialize>(
        &mut self,
        topic: &str,
        type_name: &str,
    ) -> Result<Publisher<M>, BusError> {
        self.publish_as(topic, (type_name, None), kept())
    }

    /// Opens a service of a type that this crate defines.
    ///
    /// # Errors
    /// As [`Bus::calls`].
    pub(crate) fn offer<S: Service>(&mut self, service: &str) -> Result<Calls, BusError> {
        self.calls(service, S::TYPE_NAME)
    }

    /// Opens a service of any type, `package/KIND/Type`, for callers of both layouts.
    ///
    /// # Errors
    /// On a name that is none, or when DDS refuses.
    pub(crate) fn calls(&mut self, service: &str, type_name: &str) -> Result<Calls, BusError> {
        let full_name = self.arguments.resolve(service)?;
        self.opened.insert(self.arguments.expand(service)?);
        parse_name(&full_name)?;
        let (participant, qos) = (self.context.domain_participant(), QosPolicies::from(&reliable()));
        let topic = |name: String, half: &str| {
            participant.create_topic(name, dds_type(&format!("{type_name}_{half}")), &qos, TopicKind::NoKey)
        };
        let of_service = type_hashes::hash(type_name);
        for (name, half) in [(format!("rq{full_name}Request"), "Request"), (format!("rr{full_name}Reply"), "Response")]
        {
            if let Some(hash) = type_hashes::hash(&format!("{type_name}_{half}")) {
                transport::announce_hash(&participant, &name, &hash, of_service.as_deref());
            }
        }
        let refused = |source: rustdds::dds::CreateError| BusError::open(&full_name, source);
        let requests = topic(format!("rq{full_name}Request"), "Request").map_err(refused)?;
        let responses = topic(format!("rr{full_name}Reply"), "Response").map_err(refused)?;
        let refused = |source| BusError::Open { topic: full_name.clone(), source };
        let reader = self.node.create_subscription(&requests, None).map_err(refused)?;
        let writer = ListedWriter::open(&participant, &mut self.node, &responses, &qos).map_err(refused)?;
        Ok(Calls::new(participant, (&requests, reader), writer))
    }

    /// Opens a service of another node, by its full name, to call it.
    ///
    /// # Errors
    /// As [`Bus::calls`].
    pub fn call<S: Service>(
        &mut self,
        mapping: ServiceMapping,
        full_name: &str,
    ) -> Result<Client<S::Request, S::Response>, BusError>
    where
        S::Request: Message + Clone + 'static,
        S::Response: Message + Clone + 'static,
    {
        let name = parse_name(full_name)?;
        let (package, base) = split_type(S::TYPE_NAME);
        self.node
            .create_client(mapping, &name, &ServiceTypeName::new(package, base), reliable(), reliable())
            .map_err(|source| BusError::Open { topic: full_name.to_owned(), source })
    }

    /// Remappings and `qos_overrides` that nothing of this node is behind, in words; asked once all endpoints are open.
    pub fn idle_arguments(&self) -> BTreeSet<String> {
        Self::idle_arguments_of(&[self])
    }

    /// The same of several nodes that were given the same arguments.
    pub(crate) fn idle_arguments_of(buses: &[&Self]) -> BTreeSet<String> {
        let role = |writes: bool| if writes { "publisher" } else { "subscription" };
        let place = |endpoint: &Endpoint| format!("{}.{}", endpoint.topic, role(endpoint.writes));
        let opened = buses.iter().flat_map(|bus| bus.opened.iter().cloned()).collect();
        let places: Vec<String> = buses.iter().flat_map(|bus| bus.endpoints.iter().map(place)).collect();
        let idle = |bus: &&Self| {
            let mut idle = bus.arguments.idle_remappings(&opened);
            idle.extend(qos::idle(&bus.arguments.parameters, &places));
            idle
        };
        buses.iter().flat_map(idle).collect()
    }

    /// Opens `/parameter_events`.
    ///
    /// # Errors
    /// When DDS refuses.
    pub(crate) fn parameter_events(&mut self) -> Result<Publisher<raw::ParameterEvent>, BusError> {
        let topic = self.context.get_parameter_events_topic();
        let open = |source| BusError::Open { topic: "/parameter_events".to_owned(), source };
        self.node.create_publisher(&topic, None).map_err(open)
    }

    /// A topic to be read or written; what is opened on it announces the hash of its type.
    fn topic(
        &mut self,
        topic: &str,
        (type_name, hash): (&str, Option<&str>),
        role: &str,
        qos: QosProfile,
    ) -> Result<(String, rustdds::Topic), BusError> {
        let full_name = self.arguments.resolve(topic)?;
        self.opened.insert(self.arguments.expand(topic)?);
        let qos = qos::overridden(&self.arguments.parameters, &full_name, role, qos).map_err(BusError::Qos)?;
        parse_name(&full_name)?;
        let qos = QosPolicies::from(&qos);
        let (dds_name, participant) = (format!("rt{full_name}"), self.context.domain_participant());
        announce_hash(&participant, &dds_name, type_name, hash);
        let topic = participant
            .create_topic(dds_name, dds_type(type_name), &qos, TopicKind::NoKey)
            .map_err(|source| BusError::open(&full_name, source))?;
        self.endpoints.push(Endpoint { topic: full_name.clone(), writes: role == "publisher", qos });
        Ok((full_name, topic))
    }
}

/// Lets a topic's endpoints announce this hash, or that of a type which the crate carries.
fn announce_hash(participant: &DomainParticipant, dds_name: &str, type_name: &str, hash: Option<&str>) {
    let own = || type_hashes::hash(type_name);
    if let Some(hash) = hash.map(str::to_owned).or_else(own) {
        transport::announce_hash(participant, dds_name, &hash, None);
    }
}

fn parse_name(full_name: &str) -> Result<Name, BusError> {
    Name::parse(full_name).map_err(|error| BusError::Name { name: full_name.to_owned(), reason: error.to_string() })
}

/// `package/srv/Type` or `package/Type` as package and type.
fn split_type(type_name: &str) -> (&str, &str) {
    let (package, _) = type_name.split_once('/').unwrap_or(("", type_name));
    let (_, base) = type_name.rsplit_once('/').unwrap_or(("", type_name));
    (package, base)
}

#[cfg(test)]
mod tests {
    use super::split_type;

    #[test]
    fn a_type_is_a_package_and_a_name() {
        assert_eq!(split_type("std_srvs/srv/Trigger"), ("std_srvs", "Trigger"));
        assert_eq!(split_type("rcl_interfaces/GetParameters"), ("rcl_interfaces", "GetParameters"));
    }
}
