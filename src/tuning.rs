//! Tuning: parameters and effects fitted to recordings by bounded, prior-weighted least squares.

pub mod annealing;
pub mod calibration;
pub mod command;
mod descent;
pub mod event_time;
pub mod fit;
pub mod flexible;
pub mod free_parameter;
pub mod idle;
pub mod limit_cycle;
pub mod linear;
pub mod loop_noise;
pub mod noise;
pub mod pieces;
pub mod plain;
pub mod problem;
pub mod qualification;
pub mod rivals;
pub mod run;
pub mod sheetless;
pub mod trial;
