//! The twin as a ROS 2 node over DDS: what it hears, how it keeps time, what it says.
//!
//! Threads and what passes between them:
//!
//! ```text
//!  DDS ─▶ hear ───events───▶ step ────outputs───▶ publish ─▶ DDS
//!         `listener` ring    `integration` ring   `publishers`
//!         checks, answers    `core` → Twin        └─node_events─▶ supervisor: words, /rosout, /diagnostics, bag
//! ```
//!
//! `step` runs above all others; it shares nothing with them but two wait-free rings, and never touches
//! DDS, a lock or the allocator. `hear`, `publish` and the transport's event loop run below it in real time, discovery below them. The model's time is the count of its steps, or `/clock` where
//! `use_sim_time` is set; what arrives takes effect at the next step.
//!
//! Several units of one process are nodes of their own on one participant; these threads serve all of them, and more than one may integrate. A
//! caller who sets `use_sim_time` ends the round of `live`, and the next one opens all of it again.
//!
//! What it does not do: a publisher's lease, deadline and lifespan are not judged, silence is, by arrival; DDS security cannot be followed. RustDDS is the repaired copy below `vendor/`, see `transport`.

pub mod arguments;
pub mod bus;
pub mod bus_map;
mod clock;
mod commanders;
pub mod control;
pub mod core;
mod corrected;
mod definitions;
pub mod diagnostics;
pub mod environment;
mod health;
pub mod intake;
pub mod integration;
pub mod journal;
mod listener;
pub mod live;
mod messages;
mod offer;
mod parameters;
pub mod player;
pub mod policy;
pub mod process_recorder;
mod publishers;
mod qos;
pub mod realtime;
pub mod recorder;
pub mod refit;
mod services;
pub mod settings;
mod spout;
mod startup;
pub mod stats;
mod tap;
pub mod translator;
pub mod transport;
mod type_hashes;
pub mod verdict;
mod words;

#[cfg(not(target_os = "linux"))]
compile_error!("the node needs Linux; build the rest with --no-default-features");
