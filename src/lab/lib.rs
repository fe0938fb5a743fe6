//! The laboratory: benchmark units with known faults, baselines, the scorer, the comparison of models.
//!
//! It measures the product and is no part of it; the program has it with the feature `lab`.

pub mod baselines;
pub mod battery;
pub mod benchmark;
pub mod comparison;
pub mod labels;
