//! The servomotor stage alone: laws without physics for it, and what makes it ready where no data sheet is known.

pub mod command;
pub mod competing_laws;
pub mod flexible;
pub mod pieces;
pub mod plain;
pub mod run;
pub mod sheetless;
