//! The likelihood of recordings given a unit: recordings made ready, their noise, and residuals that are independent and of unit size.

pub mod event_time;
pub(crate) mod idle;
pub(crate) mod kick;
pub(crate) mod limit_cycle;
pub mod loop_noise;
pub mod noise;
pub mod prepared;
pub mod problem;
pub mod qualification;
pub(crate) mod whitener;
