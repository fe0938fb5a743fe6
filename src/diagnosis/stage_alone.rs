//! The servomotor stage alone: laws without physics for it, and what makes it ready where no data sheet is known.

pub(crate) mod command;
pub(crate) mod competing_laws;
pub(crate) mod end_stops;
pub(crate) mod flexible;
pub(crate) mod pieces;
pub mod plain;
pub(crate) mod plain_models;
pub(crate) mod plain_numbers;
pub mod run;
pub(crate) mod set_point;
pub mod sheetless;
pub(crate) mod spread;
pub(crate) mod time_scale;
