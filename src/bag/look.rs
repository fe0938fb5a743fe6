//! What is in a bag, and its rows one by one: by one pass wherever the bag allows it.

use std::path::Path;

use super::batch::counted;
use super::grid::Irregular;
use super::live::Live;
use super::read::{check, read};
use super::source::{BagSource, Scanned};
use super::topic::{OnMessage, RawMessage, RawView};
use super::{BagError, Health, Loaded, ReadOptions, Survey, source, survey};
use govtwin_model::frame::Frame;
use govtwin_model::recording::{Process, ProcessWatch};
use govtwin_model::units::seconds_from_nanos;

/// Takes the rows of a recording one by one.
pub trait Rows {
    /// What was taken so far counts for nothing: the rows come again from the first. It happens where a bag turns out to need all of its
    /// samples at once, such as one whose clock jumps.
    fn restart(&mut self);

    /// Takes a row; rows rise strictly in time.
    fn row(&mut self, frame: &Frame);
}

/// Reads the rows of a bag one by one, in memory that does not grow with its length; the rows and the health are those of
/// [`read`](super::read()). Only a bag that needs all of its samples at once is read as a whole.
/// Of a recording that is longer than `read` takes all rows are handed on, as long as it has a row a second.
///
/// # Errors
/// As [`read`](super::read()).
pub fn read_rows(path: &Path, options: &ReadOptions, rows: &mut dyn Rows) -> Result<Health, BagError> {
    let source = source::open(path)?;
    pass(path, &source, options, &mut |_| {}, rows)?.1
}

/// What a recording is, without its rows.
#[derive(Clone, Debug, PartialEq)]
pub struct Overview {
    /// The process that the inputs show.
    pub process: Process,
    /// How many rows there are.
    pub rows: usize,
    /// From the first to the last row, s.
    pub duration_s: f64,
    /// How the bag is.
    pub health: Health,
}

/// Looks through a whole bag, and at the recording of the servo system in it, where it is one.
///
/// # Errors
/// Where there is no bag at the path; the inner one has the reason why it holds no recording.
pub fn look(path: &Path, options: &ReadOptions) -> Result<(Survey, Result<Overview, BagError>), BagError> {
    let source = source::open(path)?;
    let mut glance = Glance::default();
    let (passed, tallies) = counted(|on_message| pass(path, &source, options, on_message, &mut glance));
    let (scanned, health) = passed?;
    let overview = health.map(|health| Overview {
        process: glance.process.process(),
        rows: glance.rows,
        duration_s: glance.span_ns.map_or(0.0, |(first_ns, last_ns)| seconds_from_nanos(last_ns - first_ns)),
        health,
    });
    Ok((survey::of(&source, scanned, tallies), overview))
}

#[derive(Default)]
struct Glance {
    process: ProcessWatch,
    rows: usize,
    span_ns: Option<(i64, i64)>,
}

impl Rows for Glance {
    fn restart(&mut self) {
        *self = Self::default();
    }

    fn row(&mut self, frame: &Frame) {
        self.process.row(frame);
        self.rows += 1;
        self.span_ns = Some((self.span_ns.map_or(frame.time_ns, |span_ns| span_ns.0), frame.time_ns));
    }
}

/// One pass over the files, and a second one where the rows need it.
fn pass(
    path: &Path,
    source: &BagSource,
    options: &ReadOptions,
    on_message: &mut OnMessage<'_>,
    rows: &mut dyn Rows,
) -> Result<(Scanned, Result<Health, BagError>), BagError> {
    let topics = source.topics();
    let mut live = Some(Live::new(options, topics.as_ref()));
    let scanned = source.scan(&mut |message| {
        on_message(message);
        if live.as_mut().is_some_and(|live| live.take(message, &mut |frame| rows.row(frame)).is_err()) {
            live = None;
        }
    })?;
    let Some(mut live) = live else { return Ok((scanned, whole(path, options, rows))) };
    if let Err(error) = check(path, &live.collected, options, &scanned) {
        return Ok((scanned, Err(error)));
    }
    if live.finish(&mut |frame| rows.row(frame)).is_err() {
        return Ok((scanned, whole(path, options, rows)));
    }
    let health = live.conclude().judge(path, source, &scanned, options);
    Ok((scanned, health))
}

/// The rows of a bag that needs all of its samples at once.
fn whole(path: &Path, options: &ReadOptions, rows: &mut dyn Rows) -> Result<Health, BagError> {
    rows.restart();
    let Loaded { recording, health } = read(path, options)?;
    for frame in &recording.frames {
        rows.row(frame);
    }
    Ok(health)
}

/// The rows of a bag out of its messages, for who reads these as well.
pub struct RowsOfMessages {
    live: Live,
}

impl std::fmt::Debug for RowsOfMessages {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("RowsOfMessages").finish_non_exhaustive()
    }
}

/// The rows of a bag cannot be made message by message.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the rows of this bag need all of its samples at once")]
pub struct NeedsAll;

impl From<Irregular> for NeedsAll {
    fn from(_: Irregular) -> Self {
        Self
    }
}

impl RowsOfMessages {
    /// Begins with the bag at a path.
    ///
    /// # Errors
    /// Where there is no bag.
    pub fn new(path: &Path, options: &ReadOptions) -> Result<Self, BagError> {
        let topics = source::open(path)?.topics();
        Ok(Self { live: Live::new(options, topics.as_ref()) })
    }

    /// Takes a message, in log-time order; rows that are complete by it go to `on_row`.
    ///
    /// # Errors
    /// Where the bag needs all of its samples at once.
    pub fn take(&mut self, message: &RawMessage, on_row: &mut dyn FnMut(&Frame)) -> Result<(), NeedsAll> {
        let RawMessage { topic, log_time_ns, publish_time_ns, sequence, data } = message;
        let view =
            RawView { topic, log_time_ns: *log_time_ns, publish_time_ns: *publish_time_ns, sequence: *sequence, data };
        Ok(self.live.take(view, on_row)?)
    }

    /// Makes the last rows.
    ///
    /// # Errors
    /// Where the bag needs all of its samples at once.
    pub fn finish(mut self, on_row: &mut dyn FnMut(&Frame)) -> Result<(), NeedsAll> {
        Ok(self.live.finish(on_row)?)
    }
}
