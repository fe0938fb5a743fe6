//! Writing bags: what is written comes back, and nothing half-written stays behind.

use govtwin::bag::{self, Qos, ReadOptions, Writer, WriterOptions};
use govtwin::msg::{EsvState, FluidPressure, GovernorCommand, Header, ServoState};

const BEGIN_NS: i64 = 1_700_000_000_000_000_000;

#[test]
fn a_written_bag_reads_back_to_the_bit() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run");
    let mut writer = Writer::create(&path, WriterOptions::default()).unwrap();
    let command = writer.topic::<GovernorCommand>("/governor/command", Qos::SENSOR).unwrap();
    let esv = writer.topic::<EsvState>("/governor/esv", Qos::DEFAULT).unwrap();
    let pressure = writer.topic::<FluidPressure>("/governor/tank_pressure", Qos::SENSOR).unwrap();
    let servo = writer.topic::<ServoState>("/plant/servo_state", Qos::SENSOR).unwrap();
    for step in 0..100 {
        let time_ns = BEGIN_NS + step * 10_000_000;
        let header = Header::at(time_ns);
        let opening = 0.1 + step as f64 / 1000.0;
        writer.write(command, time_ns, &GovernorCommand { header: header.clone(), opening }).unwrap();
        writer.write(esv, time_ns, &EsvState { header: header.clone(), state: EsvState::NORMAL }).unwrap();
        let message = FluidPressure { header: header.clone(), fluid_pressure: 4.0e6, variance: 0.0 };
        writer.write(pressure, time_ns, &message).unwrap();
        let message = ServoState {
            header,
            spool_position: 0.01,
            servomotor_position: opening / 2.0,
            pilot_valve_position: f64::NAN,
            control_pressure: f64::NAN,
        };
        writer.write(servo, time_ns, &message).unwrap();
    }
    assert!(!path.exists());
    let done = writer.finish().unwrap();
    assert_eq!(done, path);
    let loaded = bag::read(&path, &ReadOptions::default()).unwrap();
    assert!(loaded.health.is_clean(), "{:?}", loaded.health.warnings);
    assert_eq!(loaded.recording.frames.len(), 100);
    for (step, frame) in loaded.recording.frames.iter().enumerate() {
        let opening = 0.1 + step as f64 / 1000.0;
        assert_eq!(frame.time_ns, BEGIN_NS + step as i64 * 10_000_000);
        assert_eq!(frame.inputs.opening_command_pu.to_bits(), opening.to_bits());
        assert_eq!(frame.measured.servomotor_position_pu.to_bits(), (opening / 2.0).to_bits());
        assert!(frame.measured.control_pressure_pa.is_nan());
    }
    let left: Vec<_> = std::fs::read_dir(folder.path()).unwrap().map(|entry| entry.unwrap().file_name()).collect();
    assert_eq!(left, ["run"], "only the bag stays");
}
