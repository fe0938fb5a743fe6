//! The twin on the bus.

#[cfg(feature = "node")]
#[path = "../support/bus.rs"]
mod bus;
#[path = "../node_bus.rs"]
mod node_bus;
#[path = "../node_hil.rs"]
mod node_hil;
#[path = "../node_loop.rs"]
mod node_loop;
#[path = "../node_replay.rs"]
mod node_replay;
#[path = "../node_time.rs"]
mod node_time;
