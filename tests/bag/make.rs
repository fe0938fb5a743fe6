//! Bags for tests, written with the MCAP library itself so that the project's writer is not its own witness.

use std::collections::BTreeMap;
use std::io::Cursor;
use std::path::{Path, PathBuf};

use govtwin_bag::msg::{EsvState, FluidPressure, GovernorCommand, Header, Interface, ServoState, definition};
use govtwin_bag::{BagError, Interpolation, Loaded, ReadOptions, Rows, cdr};
use govtwin_model::frame::Frame;
use govtwin_model::signal::Signal;
use mcap::WriteOptions;
use mcap::records::MessageHeader;

/// When test recordings begin, ns.
pub const BEGIN_NS: i64 = 1_700_000_000_000_000_000;
/// One millisecond, ns.
pub const MS: i64 = 1_000_000;

/// A message to be written.
#[derive(Clone, Debug)]
pub struct Entry {
    pub topic: String,
    pub type_name: String,
    pub log_ns: i64,
    pub sequence: u32,
    pub data: Vec<u8>,
}

/// A bag in the making: messages in file order.
#[derive(Clone, Debug, Default)]
pub struct Bag {
    pub entries: Vec<Entry>,
}

impl Bag {
    /// Adds a message logged at a time.
    pub fn put<T: Interface>(&mut self, topic: &str, log_ns: i64, message: &T) {
        let (topic, type_name) = (topic.to_owned(), T::TYPE_NAME.to_owned());
        self.entries.push(Entry { topic, type_name, log_ns, sequence: 0, data: cdr::encode(message).unwrap() });
    }

    pub fn command(&mut self, stamp_ns: i64, opening: f64) {
        self.put("/governor/command", stamp_ns + MS, &GovernorCommand { header: Header::at(stamp_ns), opening });
    }

    pub fn esv(&mut self, stamp_ns: i64, state: u8) {
        self.put("/governor/esv", stamp_ns + MS, &EsvState { header: Header::at(stamp_ns), state });
    }

    pub fn pressure(&mut self, stamp_ns: i64, fluid_pressure: f64) {
        let message = FluidPressure { header: Header::at(stamp_ns), fluid_pressure, variance: 0.0 };
        self.put("/governor/tank_pressure", stamp_ns + MS, &message);
    }

    pub fn servo(&mut self, stamp_ns: i64, spool_position: f64, servomotor_position: f64) {
        let message = ServoState {
            header: Header::at(stamp_ns),
            spool_position,
            servomotor_position,
            pilot_valve_position: f64::NAN,
            control_pressure: f64::NAN,
        };
        self.put("/plant/servo_state", stamp_ns + MS, &message);
    }

    /// A recording of some seconds: command and servo at 100 Hz, pressure at 20 Hz, ESV at 1 Hz.
    pub fn standard(seconds: i64) -> Self {
        let mut bag = Self::default();
        for step in 0..seconds * 100 {
            let time_ns = BEGIN_NS + step * 10 * MS;
            let share = step as f64 / 100.0;
            if step % 100 == 0 {
                bag.esv(time_ns, EsvState::NORMAL);
            }
            if step % 5 == 0 {
                bag.pressure(time_ns, 4.0e6 + 100.0 * share);
            }
            bag.command(time_ns, 0.3 + 0.01 * share.sin());
            bag.servo(time_ns, 0.001 * share.cos(), 0.3 + 0.01 * share.sin());
        }
        bag
    }

    /// The file's bytes.
    pub fn bytes(&self, options: WriteOptions) -> Vec<u8> {
        let mut file = Cursor::new(vec![]);
        let mut writer = options.profile("ros2").create(&mut file).unwrap();
        let mut channels: BTreeMap<(String, String), u16> = BTreeMap::new();
        for entry in &self.entries {
            let id = *channels.entry((entry.topic.clone(), entry.type_name.clone())).or_insert_with(|| {
                let text = definition::schema_of(&entry.type_name).unwrap_or_default();
                let schema = writer.add_schema(&entry.type_name, "ros2msg", text.as_bytes()).unwrap();
                writer.add_channel(schema, &entry.topic, "cdr", &BTreeMap::new()).unwrap()
            });
            let log_time = entry.log_ns as u64;
            let header = MessageHeader { channel_id: id, sequence: entry.sequence, log_time, publish_time: log_time };
            writer.write_to_known_channel(&header, &entry.data).unwrap();
        }
        writer.finish().unwrap();
        drop(writer);
        file.into_inner()
    }

    /// Writes the file into a folder of its own, which goes when dropped.
    pub fn file(&self, options: WriteOptions) -> (tempfile::TempDir, PathBuf) {
        in_file(&self.bytes(options))
    }
}

/// Rows one by one, as they come.
#[derive(Default)]
pub struct All {
    pub frames: Vec<Frame>,
    /// Whether the bag needed all of its samples at once.
    pub restarted: bool,
}

impl Rows for All {
    fn restart(&mut self) {
        *self = Self { frames: vec![], restarted: true };
    }

    fn row(&mut self, frame: &Frame) {
        self.frames.push(*frame);
    }
}

/// A row to the last bit.
fn bits(frame: &Frame) -> impl PartialEq {
    let measured = Signal::ALL.map(|signal| signal.of(&frame.measured).to_bits());
    let inputs = &frame.inputs;
    let numbers = [inputs.opening_command_pu, inputs.tank_pressure_pa, inputs.piston_force_n].map(f64::to_bits);
    (frame.time_ns, inputs.esv, numbers, measured)
}

/// Reads a bag as a whole and row by row, on a grid of a millisecond as well, and fails where the two differ in a row, a warning or a refusal.
#[track_caller]
pub fn read_both_ways(path: &Path, options: &ReadOptions) -> Result<Loaded, BagError> {
    for interpolation in [Interpolation::Sharp { period_ns: MS }, Interpolation::Linear { period_ns: MS }] {
        same_on_a_grid(path, &ReadOptions { interpolation, ..options.clone() });
    }
    let words = |error: BagError| error.to_string();
    let mut all = All::default();
    let rows = govtwin_bag::read_rows(path, options, &mut all);
    let whole = govtwin_bag::read(path, options);
    match (&whole, rows.map_err(words)) {
        // As text, in which NaN is NaN.
        (Ok(whole), Ok(health)) => {
            assert_eq!(format!("{:?}", whole.health), format!("{health:?}"));
            assert!(format!("{:?}", whole.recording.frames) == format!("{:?}", all.frames), "rows differ");
        }
        (Err(whole), Err(rows)) => assert_eq!(whole.to_string(), rows),
        (Ok(_), Err(rows)) => panic!("refused row by row: {rows}"),
        (Err(whole), Ok(_)) => panic!("refused as a whole: {whole}"),
    }
    whole
}

#[track_caller]
fn same_on_a_grid(path: &Path, options: &ReadOptions) {
    let mut all = All::default();
    match (govtwin_bag::read(path, options), govtwin_bag::read_rows(path, options, &mut all)) {
        (Ok(whole), Ok(health)) => {
            assert_eq!(format!("{:?}", whole.health), format!("{health:?}"));
            let frames = &whole.recording.frames;
            let other = (0..frames.len().min(all.frames.len())).find(|&k| bits(&frames[k]) != bits(&all.frames[k]));
            let pair = other.map(|k| (k, frames[k], all.frames[k]));
            assert!(
                pair.is_none() && frames.len() == all.frames.len(),
                "{pair:?}: {} {}",
                frames.len(),
                all.frames.len()
            );
        }
        (Err(whole), Err(rows)) => assert_eq!(whole.to_string(), rows.to_string()),
        // What is too long to be held passes by row by row.
        (Err(BagError::TooManyRows { .. }), Ok(_)) => {}
        (whole, rows) => panic!("{:?} {rows:?}", whole.map(|whole| whole.health)),
    }
}

/// Bytes in a file `bag.mcap` of a folder of its own.
pub fn in_file(bytes: &[u8]) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("bag.mcap");
    std::fs::write(&path, bytes).unwrap();
    (folder, path)
}

/// Small chunks, so that a short bag has many.
pub fn small_chunks() -> WriteOptions {
    WriteOptions::new().chunk_size(Some(4096))
}

/// A path below the project's `bags/`.
pub fn shipped(relative: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("bags").join(relative)
}
