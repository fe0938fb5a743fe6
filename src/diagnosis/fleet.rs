//! A fleet: many units over many periods, as a list of entries, one result an entry, and one table of all results.
//!
//! [`plan`] turns recordings that were found into entries, [`entry`] knows an entry and the key of its result, [`result`] what is kept
//! of a diagnosis, [`gathered`] the fleet as a whole, and `ageing` which sizes changed over time. All of it is pure: what reads
//! recordings, stores and clocks is in the command.

pub mod ageing;
pub mod changes;
pub mod entry;
pub mod gathered;
#[cfg(feature = "parquet")]
pub mod parquet_table;
pub mod plan;
pub mod result;
pub mod table;
pub mod units;
pub mod urgency;
