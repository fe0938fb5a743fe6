//! Any bytes as each message: decoding ends with a result, and what was decoded encodes and decodes to itself.
#![no_main]

use govtwin::bag::cdr;
use govtwin::msg::{EsvState, FluidPressure, GovernorCommand, Interface, JointState, ServoState};
use libfuzzer_sys::fuzz_target;

fn round<T: Interface>(bytes: &[u8]) {
    if let Ok(message) = cdr::decode::<T>(bytes) {
        let encoded = cdr::encode(&message).unwrap();
        let again: T = cdr::decode(&encoded).unwrap();
        assert_eq!(cdr::encode(&again).unwrap(), encoded);
    }
}

fuzz_target!(|bytes: &[u8]| {
    round::<GovernorCommand>(bytes);
    round::<EsvState>(bytes);
    round::<ServoState>(bytes);
    round::<FluidPressure>(bytes);
    round::<JointState>(bytes);
});
