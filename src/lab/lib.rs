//! The laboratory: benchmark units with known faults, baselines, the scorer, the comparison of models.
//!
//! It measures the product and is no part of it; the program has it with the feature `lab`.

#![expect(clippy::must_use_candidate, reason = "a getter whose result is dropped does no harm; builders say must_use")]

pub mod baselines;
pub mod battery;
pub mod benchmark;
pub mod comparison;
pub mod labels;
