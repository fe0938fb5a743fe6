//! Any text as a message definition: parsed, hashed, compared.
#![no_main]

use govtwin::msg::definition::{difference, parse_schema};
use govtwin::msg::type_hash::hash_of;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|text: &str| {
    if let Ok(types) = parse_schema("a_msgs/msg/A", text) {
        assert_eq!(hash_of(&types).len(), "RIHS01_".len() + 64);
        assert_eq!(difference(&types, &types), None);
    }
});
