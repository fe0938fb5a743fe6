//! Replaying a bag row by row, and writing its simulated bag so: in memory that does not grow with its length.

use std::collections::{BTreeMap, VecDeque};
use std::path::Path;

use govtwin_bag::{Health, NeedsAll, RawMessage, ReadOptions, Rows, RowsOfMessages, Sealed, Topics, Writer};
use govtwin_model::frame::{Estimate, Frame};
use govtwin_model::replay::rows::{Replaying, Simulator};
use govtwin_model::replay::{Replayed, is_measured};
use govtwin_model::twin::Twin;

use super::simulated::{TOPIC, begin, lag_of, state};

/// Messages that wait for the rows at their time hold at most so many bytes; beyond, they are written as they come.
const MOST_WAITING_BYTES: usize = 1 << 24;

struct Running<'a>(Replaying<'a>);

impl Rows for Running<'_> {
    fn restart(&mut self) {
        self.0.restart();
    }

    fn row(&mut self, frame: &Frame) {
        self.0.row(frame);
    }
}

/// Replays a bag.
pub fn replay(path: &Path, name: &str, options: &ReadOptions, twin: &mut Twin) -> anyhow::Result<(Replayed, Health)> {
    let mut running = Running(Replaying::new(twin));
    let health = govtwin_bag::read_rows(path, options, &mut running)?;
    Ok((running.0.finish(name), health))
}

/// Estimates and messages on their way into a bag, each where its log time belongs.
struct ResultBag {
    writer: Writer,
    topic: govtwin_bag::Topic<govtwin_bag::msg::ServoState>,
    /// How much later than its stamp a message is logged, once one told it, ns.
    lag_ns: Option<i64>,
    estimates: VecDeque<Estimate>,
    messages: VecDeque<RawMessage>,
    waiting_bytes: usize,
    /// All estimates up to here have come.
    done_ns: i64,
}

impl ResultBag {
    /// Writes what has its place by now; all of it at the end.
    fn write(&mut self, all: bool) -> anyhow::Result<()> {
        let lag_ns = self.lag_ns.unwrap_or_default();
        let done_ns = self.done_ns.saturating_add(lag_ns);
        let is_due = |message: &RawMessage, bytes| all || message.log_time_ns <= done_ns || bytes > MOST_WAITING_BYTES;
        while self.messages.front().is_some_and(|message| is_due(message, self.waiting_bytes)) {
            let Some(message) = self.messages.pop_front() else { break };
            self.waiting_bytes -= message.data.len();
            self.before(message.log_time_ns, lag_ns)?;
            self.writer.copy(&message)?;
        }
        if all { self.before(i64::MAX, lag_ns) } else { Ok(()) }
    }

    /// Writes the estimates before a log time.
    fn before(&mut self, log_time_ns: i64, lag_ns: i64) -> anyhow::Result<()> {
        let is_before = |estimate: &Estimate| {
            let logged_ns = estimate.time_ns.saturating_add(lag_ns);
            logged_ns < log_time_ns || log_time_ns == i64::MAX
        };
        while self.estimates.front().is_some_and(is_before) {
            let Some(estimate) = self.estimates.pop_front() else { break };
            self.writer.write(self.topic, estimate.time_ns.saturating_add(lag_ns), &state(&estimate))?;
        }
        Ok(())
    }
}

/// Writes the simulated bag as `simulated::write` does, estimating anew; `None` where the bag needs all of its samples at once.
pub fn write(
    (source, about): (&Path, &BTreeMap<String, String>),
    dir: &Path,
    options: &ReadOptions,
    twin: &mut Twin,
    measured: bool,
    topics: &Topics,
) -> anyhow::Result<Option<Sealed>> {
    let (writer, topic) = begin(dir, about)?;
    let mut rows = RowsOfMessages::new(source, options)?;
    let mut simulator = Simulator::new(twin);
    let mut merge = ResultBag {
        writer,
        topic,
        lag_ns: None,
        estimates: VecDeque::new(),
        messages: VecDeque::new(),
        waiting_bytes: 0,
        done_ns: i64::MIN,
    };
    for message in govtwin_bag::messages(source)? {
        let message = message?;
        merge.lag_ns = merge.lag_ns.or_else(|| lag_of(&message, topics));
        let ResultBag { estimates, done_ns, .. } = &mut merge;
        let mut on_estimate = |frame: &Frame, estimate: Estimate| {
            *done_ns = estimate.time_ns;
            if !measured || is_measured(frame) {
                estimates.push_back(estimate);
            }
        };
        if let Err(NeedsAll) = rows.take(&message, &mut |frame| simulator.row(frame, &mut on_estimate)) {
            return Ok(None);
        }
        if message.topic.name != TOPIC {
            merge.waiting_bytes += message.data.len();
            merge.messages.push_back(message);
        }
        merge.write(false)?;
    }
    let ResultBag { estimates, .. } = &mut merge;
    let mut on_estimate = |frame: &Frame, estimate: Estimate| {
        if !measured || is_measured(frame) {
            estimates.push_back(estimate);
        }
    };
    if let Err(NeedsAll) = rows.finish(&mut |frame| simulator.row(frame, &mut on_estimate)) {
        return Ok(None);
    }
    simulator.finish(&mut on_estimate);
    merge.write(true)?;
    Ok(Some(merge.writer.seal()?))
}
