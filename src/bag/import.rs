//! Recordings as plants have them (tables, historian exports, bags with other types) read by a map into rows of this project's signals.
//!
//! A [`Map`] says which column or field of a message holds which signal, in which unit, and how time is written. [`Import`] opens the
//! files, merges their rows by time and hands on one [`ImportedRow`] after the other; memory does not grow with the files. [`findings`] watches
//! what passes: gaps, frozen and saturated channels, units that cannot be meant. [`suggest`] proposes a map of a file that nobody has
//! mapped yet. What comes out is written as a bag, which everything else reads as any other.

pub(crate) mod clock;
pub(crate) mod convert;
mod csv_file;
mod dialect;
mod error;
pub mod findings;
mod lines;
mod map;
mod messages;
mod number;
#[cfg(feature = "parquet")]
mod parquet_file;
mod recurring;
mod resample;
mod rewrite;
mod row;
mod run;
mod source;
mod stated;
mod streams;
pub mod suggest;
mod topics;
mod words;

pub use error::ImportError;
pub use lines::Between;
pub use map::{FileMap, Map, Repeated, SignalMap, SignalPlace, TimeMap, TripRule, map_text};
pub use messages::{FieldState, MappedField, MappedTopic, topics_of};
pub use recurring::Recurring;
pub use row::{ImportedRow, Target};
pub use run::{Import, ImportOutcome};
pub use source::{SourceKind, kind_of};
pub use streams::RowMessages;
