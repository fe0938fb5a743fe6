//! Tuning: parameters and effects fitted to recordings by bounded, prior-weighted least squares.

pub mod admission;
pub mod bench;
mod between;
pub mod calibration;
pub mod cooling;
mod descent;
pub mod fit;
pub mod flexible;
pub mod knob;
pub mod linear;
pub mod loop_noise;
pub mod noise;
pub mod rest;
pub mod sheetless;
pub mod swing;
pub mod trial;
pub mod trips;
