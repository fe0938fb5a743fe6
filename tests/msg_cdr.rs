//! The bytes on the wire: equal to two independent encoders, and never a panic on any bytes.

use govtwin_bag::cdr::{self, CdrError};
use govtwin_bag::msg::{EsvState, FluidPressure, GovernorCommand, Header, Interface, JointState, ServoState, Time};
use proptest::prelude::{any, prop, prop_assert, prop_assert_eq, proptest};

/// Made by `tests/fixtures/cdr/make.py`.
const GOLDEN: &str = include_str!("fixtures/cdr/golden.txt");

fn header() -> Header {
    Header { stamp: Time { sec: -3, nanosec: 987_654_321 }, frame_id: "actuator_7".into() }
}

fn bytes_of(hex: &str) -> Vec<u8> {
    (0..hex.len()).step_by(2).map(|at| u8::from_str_radix(&hex[at..at + 2], 16).unwrap()).collect()
}

/// Every golden line of the type decodes to the message, and encodes to the little-endian lines.
fn check<T: Interface + PartialEq + std::fmt::Debug>(message: &T) {
    let mut lines = 0;
    for line in GOLDEN.lines().filter(|line| line.starts_with(&format!("{} ", T::TYPE_NAME))) {
        let [_, order, encoder, hex] = line.split(' ').collect::<Vec<_>>()[..] else { panic!("{line}") };
        let golden = bytes_of(hex);
        let decoded: T = cdr::decode(&golden).unwrap();
        // NaN is unequal to itself, its bytes are not.
        assert_eq!(cdr::encode(&decoded).unwrap(), cdr::encode(message).unwrap(), "{order} {encoder}");
        if order == "little" {
            assert_eq!(cdr::encode(message).unwrap(), golden, "{encoder}");
        }
        lines += 1;
    }
    assert_eq!(lines, 3, "{}", T::TYPE_NAME);
}

#[test]
fn bytes_equal_two_independent_encoders_in_both_orders() {
    check(&GovernorCommand { header: header(), opening: 0.618_033_988_749_894_9 });
    check(&EsvState { header: header(), state: EsvState::NORMAL });
    check(&ServoState {
        header: header(),
        spool_position: -0.035,
        servomotor_position: 1.0,
        pilot_valve_position: f64::NAN,
        control_pressure: 2.5e6,
    });
    check(&FluidPressure { header: header(), fluid_pressure: 6.3e6, variance: 400.0 });
    check(&JointState {
        header: header(),
        name: vec!["spool".into(), "servomotor".into()],
        position: vec![-0.0005, 0.42],
        velocity: vec![0.0, -1e-300],
        effort: vec![],
    });
}

#[test]
fn an_error_says_what_was_expected() {
    assert_eq!(cdr::decode::<EsvState>(&[0, 1]), Err(CdrError::Short { found: 2 }));
    let parameter_list = cdr::decode::<EsvState>(&[0, 3, 0, 0, 1, 2, 3, 4]).unwrap_err();
    assert_eq!(parameter_list, CdrError::Encapsulation { found: 3 });
    assert!(parameter_list.to_string().contains("0x0003"), "{parameter_list}");
    let cut = cdr::encode(&EsvState { header: header(), state: 1 }).unwrap();
    assert!(matches!(cdr::decode::<EsvState>(&cut[..cut.len() - 1]), Err(CdrError::Body(_))));
}

#[test]
fn padding_after_the_message_is_allowed() {
    let message = EsvState { header: header(), state: 1 };
    let mut bytes = cdr::encode(&message).unwrap();
    bytes.extend([0, 0, 0]);
    assert_eq!(cdr::decode::<EsvState>(&bytes), Ok(message));
}

proptest! {
    #[test]
    fn any_message_comes_back(sec: i32, nanosec: u32, frame_id in ".{0,40}", values in prop::array::uniform4(any::<f64>())) {
        let message = ServoState {
            header: Header { stamp: Time { sec, nanosec }, frame_id },
            spool_position: values[0],
            servomotor_position: values[1],
            pilot_valve_position: values[2],
            control_pressure: values[3],
        };
        let bytes = cdr::encode(&message).unwrap();
        prop_assert_eq!(bytes.len() % 8, 4, "the last f64 ends at a multiple of eight after the header");
        let back: ServoState = cdr::decode(&bytes).unwrap();
        prop_assert_eq!(cdr::encode(&back).unwrap(), bytes);
    }

    #[test]
    fn no_bytes_panic(bytes in prop::collection::vec(any::<u8>(), 0..200), order in 0..2u8) {
        let _ = cdr::decode::<JointState>(&bytes);
        let mut bytes = bytes;
        if bytes.len() >= 4 {
            bytes[..2].copy_from_slice(&[0, order]);
            let _ = cdr::decode::<JointState>(&bytes);
            let _ = cdr::decode::<ServoState>(&bytes);
        }
    }

    #[test]
    fn times_keep_every_nanosecond(time_ns in i64::from(i32::MIN) * 1_000_000_000..=i64::from(i32::MAX) * 1_000_000_000) {
        let time = Time::from_nanos(time_ns);
        prop_assert!(time.nanosec < 1_000_000_000);
        prop_assert_eq!(time.nanos(), Some(time_ns));
    }
}
