//! Tuning: parameters and effects fitted to recordings by bounded, prior-weighted least squares.

pub mod admission;
pub mod calibration;
pub mod fit;
pub mod knob;
pub mod noise;
pub mod trial;
