//! The twin as a ROS 2 node over DDS: what it hears, how it keeps time, what it says.
//!
//! Threads and what passes between them:
//!
//! ```text
//! DDS ─▶ intake ──events──▶ integration ──outputs──▶ output ─▶ DDS
//!        checks    ring     Core → Twin     ring        └────▶ keeper: bag, words, /diagnostics
//! ```
//!
//! Only the integration thread runs in real time. It shares nothing with the others but two wait-free
//! rings; it never touches DDS, a lock or the allocator.

pub mod core;
pub mod integration;
pub mod realtime;
pub mod stats;

#[cfg(not(target_os = "linux"))]
compile_error!("the node needs Linux; build the rest with --no-default-features");
