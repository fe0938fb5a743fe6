//! The way from the threads that must not wait to the supervisor, who may: bounded, and it never makes a sender wait.
//!
//! The supervisor writes to a terminal and to a disk, and looks into the transport's books while discovery changes them.
//! Where it stands still, what happens meanwhile is left out and counted; hearing and publishing go on.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};
use std::sync::{Arc, Mutex};

use ros2_client::log::LogLevel;

use super::super::integration::TickOutput;
use super::super::settings::NodeSettings;

/// Room for news not yet taken: half a minute and more of the usual traffic.
const ROOM: usize = 16_384;

/// What the other threads tell the supervisor.
#[derive(Debug, Clone)]
pub(crate) enum NodeEvent {
    /// A result worth keeping or telling.
    Output(Box<TickOutput>),
    /// Words for people.
    Said(LogLevel, String),
    /// Settings that changed while the node runs.
    Settings(Box<NodeSettings>),
}

/// What both ends share besides the queue.
#[derive(Debug, Default)]
struct Aside {
    left_out: AtomicU64,
    /// The newest settings that found no room: they must not be lost, and only the newest count.
    settings: Mutex<Option<NodeSettings>>,
}

/// The end that tells.
#[derive(Debug, Clone)]
pub(crate) struct Teller {
    queue: SyncSender<NodeEvent>,
    aside: Arc<Aside>,
}

/// The end that takes.
#[derive(Debug)]
pub(crate) struct Taker {
    queue: Receiver<NodeEvent>,
    aside: Arc<Aside>,
}

/// Both ends of a new way.
pub(crate) fn way() -> (Teller, Taker) {
    way_with_room(ROOM)
}

fn way_with_room(room: usize) -> (Teller, Taker) {
    let (sender, receiver) = sync_channel(room);
    let aside = Arc::<Aside>::default();
    (Teller { queue: sender, aside: Arc::clone(&aside) }, Taker { queue: receiver, aside })
}

impl Teller {
    /// Tells, and never waits.
    pub(crate) fn tell(&self, item: NodeEvent) {
        match self.queue.try_send(item) {
            Err(TrySendError::Full(NodeEvent::Settings(settings))) => {
                if let Ok(mut waiting) = self.aside.settings.lock() {
                    *waiting = Some(*settings);
                }
            }
            Err(TrySendError::Full(_)) => {
                self.aside.left_out.fetch_add(1, Ordering::Relaxed);
            }
            // The supervisor outlives the threads that tell; were it gone there would be nobody to tell.
            Ok(()) | Err(TrySendError::Disconnected(_)) => {}
        }
    }
}

impl Taker {
    /// The next event, where there is one.
    pub(crate) fn next(&self) -> Option<NodeEvent> {
        self.queue.try_recv().ok()
    }

    /// Settings that found no room, once.
    pub(crate) fn settings(&self) -> Option<NodeSettings> {
        self.aside.settings.lock().ok()?.take()
    }

    /// How much was left out since this was asked last.
    pub(crate) fn left_out(&self) -> u64 {
        self.aside.left_out.swap(0, Ordering::Relaxed)
    }
}

#[cfg(test)]
mod tests {
    use ros2_client::log::LogLevel;

    use super::{NodeEvent, NodeSettings, way_with_room};

    #[test]
    fn a_full_way_takes_no_more_counts_and_keeps_the_newest_settings() {
        let (teller, taker) = way_with_room(2);
        for number in 0..5 {
            teller.tell(NodeEvent::Said(LogLevel::Info, number.to_string()));
        }
        for rate_hz in [10.0, 20.0] {
            teller.tell(NodeEvent::Settings(Box::new(NodeSettings { rate_hz, ..NodeSettings::default() })));
        }
        let words = std::iter::from_fn(|| taker.next()).map(|item| match item {
            NodeEvent::Said(_, words) => words,
            other => format!("{other:?}"),
        });
        assert_eq!(words.collect::<Vec<_>>(), ["0", "1"]);
        assert_eq!((taker.left_out(), taker.left_out()), (3, 0));
        assert_eq!(taker.settings().map(|settings| settings.rate_hz), Some(20.0));
        assert!(taker.settings().is_none());
        teller.tell(NodeEvent::Said(LogLevel::Info, "again".to_owned()));
        assert!(taker.next().is_some() && taker.next().is_none());
    }
}
