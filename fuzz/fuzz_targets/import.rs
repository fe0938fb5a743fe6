//! The target `import` of `targets.rs` under libFuzzer.
#![no_main]

#[allow(dead_code, reason = "the other targets")]
#[path = "../targets.rs"]
mod targets;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| targets::import(bytes));
