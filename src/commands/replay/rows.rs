//! Replaying a bag row by row, and writing its simulated bag so: in memory that does not grow with its length.

use std::collections::BTreeMap;
use std::path::Path;

use govtwin_bag::{Health, NeedsAll, ReadOptions, Rows, RowsOfMessages, Sealed, Topics};
use govtwin_model::frame::Frame;
use govtwin_model::replay::Replayed;
use govtwin_model::replay::rows::{Replaying, Simulator};
use govtwin_model::twin::Twin;

use super::simulated::{ResultBag, lag_of};

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

/// Writes the simulated bag as `simulated::write` does, estimating anew; `None` where the bag needs all of its samples at once.
pub fn write(
    (source, about): (&Path, &BTreeMap<String, String>),
    dir: &Path,
    options: &ReadOptions,
    twin: &mut Twin,
    measured: bool,
    topics: &Topics,
) -> anyhow::Result<Option<Sealed>> {
    let mut rows = RowsOfMessages::new(source, options)?;
    let mut simulator = Simulator::new(twin);
    let mut bag = ResultBag::begin(dir, about)?;
    for message in govtwin_bag::messages(source)? {
        let message = message?;
        bag.lag_ns = bag.lag_ns.or_else(|| lag_of(&message, topics));
        let mut on_estimate = bag.taking(measured);
        if let Err(NeedsAll) = rows.take(&message, &mut |frame| simulator.row(frame, &mut on_estimate)) {
            return Ok(None);
        }
        drop(on_estimate);
        bag.take(message)?;
    }
    let mut on_estimate = bag.taking(measured);
    if let Err(NeedsAll) = rows.finish(&mut |frame| simulator.row(frame, &mut on_estimate)) {
        return Ok(None);
    }
    simulator.finish(&mut on_estimate);
    drop(on_estimate);
    bag.seal().map(Some)
}
