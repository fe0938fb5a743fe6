//! Identification: a unit's parameters and effects as what a fit turns, and the calibration of `govtwin fit`.

pub mod calibration;
pub mod free_parameter;
mod profile;
