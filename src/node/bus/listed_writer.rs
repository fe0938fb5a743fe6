//! A writer of encoded samples that the graph of ROS lists.

use std::convert::Infallible;
use std::ops::Deref;

use ros2_client::{CreateError, Node};
use rustdds::bytes::Bytes;
use rustdds::no_key::{DataWriter, SerializerAdapter};
use rustdds::{DomainParticipant, QosPolicies, RepresentationIdentifier as Layout, Topic};

/// Writes what is encoded already.
pub(in super::super) struct Body;

impl SerializerAdapter<Bytes> for Body {
    type Error = Infallible;

    fn output_encoding() -> Layout {
        Layout::CDR_LE
    }

    fn to_bytes(body: &Bytes) -> Result<Bytes, Infallible> {
        Ok(body.clone())
    }
}

/// A writer of RustDDS, which tells what was acknowledged and writes to a single reader, as publishers of ros2-client do not.
pub(in super::super) struct ListedWriter {
    // Dropped in this order.
    writer: DataWriter<Bytes, Body>,
    _publisher: rustdds::Publisher,
    /// A second writer, which writes nothing: ros2-client lists in the graph of ROS what it opened itself, and `ros2 node info` and bridges go by that
    /// list. It is announced after the real one, so that nobody takes it for ready.
    _listed: ros2_client::Publisher<()>,
}

impl ListedWriter {
    pub(super) fn open(
        participant: &DomainParticipant,
        node: &mut Node,
        topic: &Topic,
        qos: &QosPolicies,
    ) -> Result<Self, CreateError> {
        let publisher = participant.create_publisher(qos)?;
        let writer = publisher.create_datawriter_no_key(topic, None)?;
        Ok(Self { writer, _publisher: publisher, _listed: node.create_publisher(topic, None)? })
    }
}

impl Deref for ListedWriter {
    type Target = DataWriter<Bytes, Body>;

    fn deref(&self) -> &Self::Target {
        &self.writer
    }
}
