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

pub mod arguments;
pub mod bus;
pub mod core;
pub mod diagnostics;
pub mod environment;
pub mod intake;
pub mod integration;
pub mod journal;
pub mod listener;
pub mod live;
pub mod messages;
pub mod parameters;
pub mod player;
pub mod qos;
pub mod realtime;
pub mod recorder;
pub mod services;
pub mod settings;
pub mod stats;
pub mod words;

#[cfg(not(target_os = "linux"))]
compile_error!("the node needs Linux; build the rest with --no-default-features");
