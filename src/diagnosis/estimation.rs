//! Estimation: bounded, prior-weighted least squares over whatever can be turned and judged; it knows no unit.

pub(crate) mod annealing;
pub mod coordinate;
mod descent;
pub mod fit;
pub(crate) mod following;
pub mod linear;
