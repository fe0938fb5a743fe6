//! Bags for the tests of the command line: a sound one, and ways to spoil it.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use govtwin_bag::msg::{EsvState, FluidPressure, GovernorCommand, Header, ServoState};
use govtwin_bag::{Qos, TopicInfo, Writer, WriterOptions};

/// Stamp of the first row, ns.
pub const BEGIN_NS: i64 = 1_700_000_000_000_000_000;

/// Rows of a bag, 0.1 s apart.
pub const ROWS: i64 = 100;

/// What stands in one row; each part can be spoilt or left out.
pub struct Row {
    pub log_ns: i64,
    pub stamp_ns: i64,
    pub opening: Option<f64>,
    pub esv: Option<u8>,
    pub pressure_pa: Option<f64>,
    pub servo: Option<ServoState>,
}

/// A small step of the opening, held by a servomotor that follows at once.
fn row(i: i64) -> Row {
    let time_ns = BEGIN_NS + i * 100_000_000;
    let opening = if i < ROWS / 2 { 0.30 } else { 0.32 };
    let servo = ServoState {
        header: Header::default(),
        spool_position: 0.001 * (i % 3) as f64,
        servomotor_position: opening,
        pilot_valve_position: 0.0,
        control_pressure: 3.5e6,
    };
    Row {
        log_ns: time_ns,
        stamp_ns: time_ns,
        opening: Some(opening),
        esv: Some(EsvState::NORMAL),
        pressure_pa: Some(6.3e6),
        servo: Some(servo),
    }
}

/// Writes the bag folder `dir/name`, each row changed by `spoil`, and gives its path.
pub fn bag(dir: &Path, name: &str, spoil: impl Fn(i64, &mut Row)) -> PathBuf {
    let path = dir.join(name);
    let mut writer = Writer::create(&path, WriterOptions::default()).unwrap();
    let topics = (
        writer.topic::<GovernorCommand>("/governor/command", Qos::SENSOR).unwrap(),
        writer.topic::<EsvState>("/governor/esv", Qos::SENSOR).unwrap(),
        writer.topic::<FluidPressure>("/governor/tank_pressure", Qos::SENSOR).unwrap(),
        writer.topic::<ServoState>("/plant/servo_state", Qos::SENSOR).unwrap(),
    );
    for i in 0..ROWS {
        let mut row = row(i);
        spoil(i, &mut row);
        let header = Header::at(row.stamp_ns);
        if let Some(opening) = row.opening {
            writer.write(topics.0, row.log_ns, &GovernorCommand { header: header.clone(), opening }).unwrap();
        }
        if let Some(state) = row.esv {
            writer.write(topics.1, row.log_ns, &EsvState { header: header.clone(), state }).unwrap();
        }
        if let Some(fluid_pressure) = row.pressure_pa {
            let message = FluidPressure { header: header.clone(), fluid_pressure, variance: 0.0 };
            writer.write(topics.2, row.log_ns, &message).unwrap();
        }
        if let Some(servo) = row.servo {
            writer.write(topics.3, row.log_ns, &ServoState { header, ..servo }).unwrap();
        }
    }
    writer.finish().unwrap()
}

/// A bag whose command topic carries another type.
pub fn with_wrong_type(dir: &Path) -> PathBuf {
    let path = dir.join("wrong_type");
    let mut writer = Writer::create(&path, WriterOptions::default()).unwrap();
    let command = writer.topic::<FluidPressure>("/governor/command", Qos::SENSOR).unwrap();
    let esv = writer.topic::<EsvState>("/governor/esv", Qos::SENSOR).unwrap();
    let pressure = writer.topic::<FluidPressure>("/governor/tank_pressure", Qos::SENSOR).unwrap();
    let header = Header::at(BEGIN_NS);
    let message = FluidPressure { header: header.clone(), fluid_pressure: 6.3e6, variance: 0.0 };
    writer.write(command, BEGIN_NS, &message).unwrap();
    writer.write(esv, BEGIN_NS, &EsvState { header, state: EsvState::NORMAL }).unwrap();
    writer.write(pressure, BEGIN_NS, &message).unwrap();
    writer.finish().unwrap()
}

/// The bag `source` with every topic in a namespace, as the bag folder `dir/name`.
pub fn in_namespace(dir: &Path, name: &str, namespace: &str, source: &Path) -> PathBuf {
    let path = dir.join(name);
    let mut writer = Writer::create(&path, WriterOptions::default()).unwrap();
    for message in govtwin_bag::messages(source).unwrap() {
        let mut message = message.unwrap();
        let topic = TopicInfo { name: format!("{namespace}{}", message.topic.name), ..(*message.topic).clone() };
        message.topic = Arc::new(topic);
        writer.copy(&message).unwrap();
    }
    writer.finish().unwrap()
}

/// The single MCAP file of a bag folder.
pub fn file_of(bag: &Path) -> PathBuf {
    let name = bag.file_name().unwrap().to_string_lossy();
    bag.join(format!("{name}_0.mcap"))
}
