//! The messages of a bag on their way to the bus: chosen, and read ahead by a thread of their own.

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, sync_channel};
use std::time::Duration;

use govtwin_bag::{BagError, RawMessage, TopicInfo, Warning};

/// Messages are handed over so many at a time at most,
const BATCH_MESSAGES: usize = 256;

/// or, where they are large, as many as have so many bytes.
const BATCH_BYTES: usize = 1 << 20;

/// Batches read ahead.
const BATCHES: usize = 8;

/// Messages handed over together.
type Handover = Result<Vec<RawMessage>, BagError>;

/// What of a bag is to be played.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Tape {
    /// The bag.
    bag: PathBuf,
    /// Only these topics, by their names in the bag; all where none is named.
    topics: Vec<String>,
    /// Log times of the first and the last message to be played, ns.
    span_ns: (i64, i64),
    /// The topics that are played.
    chosen: Vec<Arc<TopicInfo>>,
}

impl Tape {
    /// Opens a bag: these topics of it, or all; its first part of this length, or the whole. Gives what a user should read as well;
    /// `None` for the tape where nothing is left to be played.
    ///
    /// # Errors
    /// Where there is no bag, or the operating system refuses.
    pub fn open(
        bag: PathBuf,
        topics: Vec<String>,
        length: Option<Duration>,
    ) -> Result<(Option<Self>, Vec<Warning>), BagError> {
        let messages = govtwin_bag::messages(&bag)?;
        let warnings = messages.warnings().to_vec();
        let named = |topic: &&Arc<TopicInfo>| topics.is_empty() || topics.contains(&topic.name);
        let chosen: Vec<_> = messages.topics().iter().filter(named).cloned().collect();
        let Some((first_ns, last_ns)) = messages.span_ns().filter(|_| !chosen.is_empty()) else {
            return Ok((None, warnings));
        };
        let length_ns = length.map_or(i64::MAX, |length| i64::try_from(length.as_nanos()).unwrap_or(i64::MAX));
        let span_ns = (first_ns, last_ns.min(first_ns.saturating_add(length_ns)));
        Ok((Some(Self { bag, topics, span_ns, chosen }), warnings))
    }

    /// Log times of the first and the last message of the bag, the last within the length to be played, ns.
    pub fn span_ns(&self) -> (i64, i64) {
        self.span_ns
    }

    /// The topics that are played.
    pub(crate) fn topics(&self) -> &[Arc<TopicInfo>] {
        &self.chosen
    }

    /// Gives all messages in the order of their log times to `take` until it has enough. A thread reads ahead, some megabytes
    /// at most, so that the disk is not waited for.
    ///
    /// # Errors
    /// Where the operating system refuses.
    pub(super) fn run<T>(&self, take: impl FnOnce(&mut dyn Iterator<Item = RawMessage>) -> T) -> Result<T, BagError> {
        std::thread::scope(|scope| {
            let (sender, batches) = sync_channel(BATCHES);
            let reading = move || {
                // Whoever takes has enough: nobody is left to be told.
                let _ = self.read(&mut |batch| sender.send(batch).is_ok());
            };
            std::thread::Builder::new().spawn_scoped(scope, reading).map_err(|reason| BagError::Io {
                path: self.bag.clone(),
                action: "start a thread to read",
                reason,
            })?;
            let mut failed = None;
            let taken = take(&mut TakenMessages { batches, batch: Vec::new().into_iter(), failed: &mut failed });
            failed.map_or(Ok(taken), Err)
        })
    }

    /// Reads and hands over while `give` takes.
    fn read(&self, give: &mut dyn FnMut(Handover) -> bool) -> Option<()> {
        let messages = match govtwin_bag::messages(&self.bag) {
            Ok(messages) => messages,
            Err(error) => return give(Err(error)).then_some(()),
        };
        let (mut batch, mut bytes) = (Vec::new(), 0);
        for message in messages {
            match message {
                Ok(message) if message.log_time_ns > self.span_ns.1 => break,
                Ok(message) if !self.topics.is_empty() && !self.topics.contains(&message.topic.name) => {}
                Ok(message) => {
                    bytes += message.data.len();
                    batch.push(message);
                }
                Err(error) => return give(Err(error)).then_some(()),
            }
            if batch.len() >= BATCH_MESSAGES || bytes >= BATCH_BYTES {
                bytes = 0;
                give(Ok(std::mem::take(&mut batch))).then_some(())?;
            }
        }
        give(Ok(batch)).then_some(())
    }
}

/// The messages as they are handed over.
struct TakenMessages<'a> {
    batches: Receiver<Handover>,
    batch: std::vec::IntoIter<RawMessage>,
    failed: &'a mut Option<BagError>,
}

impl Iterator for TakenMessages<'_> {
    type Item = RawMessage;

    fn next(&mut self) -> Option<RawMessage> {
        loop {
            if let Some(message) = self.batch.next() {
                return Some(message);
            }
            match self.batches.recv() {
                Ok(Ok(batch)) => self.batch = batch.into_iter(),
                Ok(Err(error)) => {
                    *self.failed = Some(error);
                    return None;
                }
                Err(_) => return None,
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;
    use std::time::Duration;

    use super::Tape;

    fn tape(topics: &[&str], length: Option<Duration>) -> Option<Tape> {
        let bag = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../bags/reference/shutdown_01.mcap");
        Tape::open(bag, topics.iter().map(|&topic| topic.to_owned()).collect(), length).unwrap().0
    }

    #[test]
    fn a_tape_holds_what_was_chosen_of_a_bag_in_its_order() {
        let whole = tape(&[], None).unwrap();
        let all: Vec<_> = govtwin_bag::messages(&whole.bag).unwrap().map(Result::unwrap).collect();
        assert_eq!(whole.run(|messages| messages.collect::<Vec<_>>()).unwrap(), all);
        assert_eq!(whole.run(|messages| messages.take(3).count()).unwrap(), 3, "whoever has enough may leave");
        let part = tape(&["/governor/esv"], Some(Duration::from_secs(5))).unwrap();
        let end_ns = all[0].log_time_ns + 5_000_000_000;
        let chosen = all.iter().filter(|one| one.topic.name == "/governor/esv" && one.log_time_ns <= end_ns);
        assert_eq!(part.run(|messages| messages.count()).unwrap(), chosen.count());
        assert_eq!(part.topics().len(), 1);
        assert_eq!(tape(&["/other"], None), None);
    }
}
