//! A topic that is played. With a clock, its publisher tells whether what was published has arrived.

use std::cell::Cell;
use std::time::Duration;

use ros2_client::Publisher;
use rustdds::bytes::Bytes;

use super::super::bus::{Bus, BusError, ListedWriter};
use super::super::qos;
use super::super::spout::Encoded;

/// A tick of the clock waits so long for the subscribers of what was published before it.
pub const PATIENCE: Duration = Duration::from_secs(1);

/// A topic as it is played.
pub(super) struct Outlet {
    way: Way,
    /// Its messages begin with a `std_msgs/Header`.
    pub(super) has_header: bool,
}

/// How samples go out.
enum Way {
    /// Without a look back.
    Free(Box<Publisher<Encoded>>),
    /// So that it is known when they have arrived.
    Awaited(Box<AwaitedWriter>),
}

/// A writer whose samples are acknowledged.
struct AwaitedWriter {
    writer: ListedWriter,
    is_pending: Cell<bool>,
    is_behind: Cell<bool>,
}

impl AwaitedWriter {
    fn publish(&self, sample: Encoded) -> bool {
        self.is_pending.set(true);
        self.writer.write(Bytes::from(sample.into_bytes()), Some(rustdds::Timestamp::now())).is_ok()
    }

    /// Waits until every reliable subscriber has what was published. One that was waited for in vain is waited for again once it has caught up.
    fn has_arrived(&self) -> bool {
        if self.is_pending.get() {
            let patience = if self.is_behind.get() { Duration::ZERO } else { PATIENCE };
            let has_arrived = self.writer.wait_for_acknowledgments(patience).unwrap_or(false);
            self.is_behind.set(!has_arrived);
            self.is_pending.set(!has_arrived);
        }
        !self.is_pending.get()
    }
}

impl Outlet {
    /// Opens a topic for a type with its hash, with what was offered when it was recorded; `awaits` says whether it matters what arrives.
    pub(super) fn open(
        bus: &mut Bus,
        topic: &str,
        kind: (&str, Option<&str>),
        (profiles, has_header, awaits): (&str, bool, bool),
    ) -> Result<Self, BusError> {
        let qos = qos::played(profiles);
        let way = if awaits {
            let writer = bus.publish_awaited(topic, kind, qos)?;
            Way::Awaited(Box::new(AwaitedWriter { writer, is_pending: Cell::new(false), is_behind: Cell::new(false) }))
        } else {
            Way::Free(Box::new(bus.publish_as(topic, kind, qos)?))
        };
        Ok(Self { way, has_header })
    }

    /// Publishes a sample; `false` where it is lost.
    pub(super) fn publish(&self, sample: Encoded) -> bool {
        match &self.way {
            Way::Free(publisher) => publisher.publish(sample).is_ok(),
            Way::Awaited(writer) => writer.publish(sample),
        }
    }

    /// Whether all subscribers that are sent lost samples again have everything, after a while of waiting for them.
    pub(super) fn has_arrived(&self) -> bool {
        match &self.way {
            Way::Free(_) => true,
            Way::Awaited(writer) => writer.has_arrived(),
        }
    }
}
