//! Tuning: parameters and effects fitted to recordings by bounded, prior-weighted least squares.

pub mod fit;
pub mod knob;
pub mod noise;
pub mod trial;
