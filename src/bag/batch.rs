//! Messages on their way to another thread, many at a time.

use std::sync::Arc;
use std::sync::mpsc::{SyncSender, sync_channel};

use super::tally::Tallies;
use super::topic::{RawView, TopicInfo};

/// So many messages, or so many bytes, go together.
const MOST_MESSAGES: usize = 4096;
const MOST_BYTES: usize = 1 << 18;

/// Messages with their bytes, one behind the other.
#[derive(Default)]
struct Batch {
    topics: Vec<Arc<TopicInfo>>,
    messages: Vec<Message>,
    bytes: Vec<u8>,
}

struct Message {
    /// Number among the topics of its batch.
    topic: usize,
    log_time_ns: i64,
    publish_time_ns: i64,
    sequence: u32,
    /// Where its bytes end.
    end: usize,
}

impl Batch {
    /// Takes a message; true where the batch is to be handed on.
    fn take(&mut self, message: RawView<'_>) -> bool {
        let known = self.topics.iter().rposition(|topic| Arc::ptr_eq(topic, message.topic));
        let topic = known.unwrap_or_else(|| {
            self.topics.push(Arc::clone(message.topic));
            self.topics.len() - 1
        });
        self.bytes.extend_from_slice(message.data);
        let RawView { log_time_ns, publish_time_ns, sequence, .. } = message;
        self.messages.push(Message { topic, log_time_ns, publish_time_ns, sequence, end: self.bytes.len() });
        // Many topics would be looked for too long.
        self.messages.len() >= MOST_MESSAGES || self.bytes.len() >= MOST_BYTES || self.topics.len() >= 64
    }

    fn count(&self, tallies: &mut Tallies) {
        let mut begin = 0;
        let numbers: Vec<usize> = self.topics.iter().map(|topic| tallies.number(topic)).collect();
        for message in &self.messages {
            let Message { topic, log_time_ns, publish_time_ns, sequence, end } = *message;
            let of = self.topics.get(topic).zip(numbers.get(topic));
            if let (Some((topic, number)), Some(data)) = (of, self.bytes.get(begin..end)) {
                tallies.take_as(*number, RawView { topic, log_time_ns, publish_time_ns, sequence, data });
            }
            begin = end;
        }
    }
}

/// Where messages are handed to.
struct MessageTaker {
    batch: Batch,
    to: SyncSender<Batch>,
}

impl MessageTaker {
    fn take(&mut self, message: RawView<'_>) {
        if self.batch.take(message) {
            self.send();
        }
    }

    fn send(&mut self) {
        // Who counts is there until the end; should it not be, its panic is met there.
        let _ = self.to.send(std::mem::take(&mut self.batch));
    }
}

fn counted_here<R>(read: impl FnOnce(&mut dyn FnMut(RawView<'_>)) -> R) -> (R, Tallies) {
    let mut tallies = Tallies::default();
    (read(&mut |message| tallies.take(message)), tallies)
}

/// Lets `read` hand its messages on, counts them in a thread of its own meanwhile, and gives what both found. At most four batches are
/// in memory; in a processor of one core nothing would be won, and where no thread can be started there is none.
pub(super) fn counted<R>(read: impl FnOnce(&mut dyn FnMut(RawView<'_>)) -> R) -> (R, Tallies) {
    if std::thread::available_parallelism().is_ok_and(|cores| cores.get() == 1) {
        return counted_here(read);
    }
    std::thread::scope(|scope| {
        let (to, from) = sync_channel::<Batch>(2);
        let counting = std::thread::Builder::new().spawn_scoped(scope, move || {
            let mut tallies = Tallies::default();
            for batch in &from {
                batch.count(&mut tallies);
            }
            tallies
        });
        let Ok(counting) = counting else { return counted_here(read) };
        let mut hand = MessageTaker { batch: Batch::default(), to };
        let result = read(&mut |message| hand.take(message));
        hand.send();
        drop(hand);
        (result, counting.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)))
    })
}
