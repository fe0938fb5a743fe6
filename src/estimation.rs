//! Estimation: bounded, prior-weighted least squares over whatever can be turned and judged; it knows no unit.

pub mod annealing;
pub mod coordinate;
mod descent;
pub mod fit;
pub mod linear;
