//! Tuning: parameters and effects fitted to recordings by bounded, prior-weighted least squares.

pub mod admission;
pub mod bench;
pub mod calibration;
pub mod command;
pub mod cooling;
mod descent;
pub mod fit;
pub mod flexible;
pub mod knob;
pub mod linear;
pub mod loop_noise;
pub mod noise;
pub mod pieces;
pub mod plain;
pub mod rest;
pub mod rivals;
pub mod run;
pub mod sheetless;
pub mod swing;
pub mod trial;
pub mod trips;
