//! Estimation: parameters and effects fitted to recordings by bounded, prior-weighted least squares.

pub mod annealing;
pub mod calibration;
mod descent;
pub mod fit;
pub mod free_parameter;
pub mod linear;
