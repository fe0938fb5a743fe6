//! Bags, from outside: what is read, what is written, and what happens to everything that is wrong with them.

#[path = "bag/align.rs"]
mod align;
#[path = "bag/any_bytes.rs"]
mod any_bytes;
#[path = "bag/bounds.rs"]
mod bounds;
#[path = "bag/compressed.rs"]
mod compressed;
#[path = "bag/damage.rs"]
mod damage;
#[path = "bag/defects.rs"]
mod defects;
#[path = "bag/definitions.rs"]
mod definitions;
#[path = "bag/errors.rs"]
mod errors;
#[path = "bag/growing.rs"]
mod growing;
#[path = "bag/impossible.rs"]
mod impossible;
#[cfg(feature = "cli")]
#[path = "bag/info.rs"]
mod info;
#[path = "bag/load.rs"]
mod load;
#[path = "bag/make.rs"]
mod make;
#[path = "bag/order.rs"]
mod order;
#[path = "bag/outcomes.rs"]
mod outcomes;
#[cfg(feature = "cli")]
#[path = "bag/qualification.rs"]
mod qualification;
#[path = "bag/read.rs"]
mod read;
#[path = "bag/recover.rs"]
mod recover;
#[path = "bag/shipped.rs"]
mod shipped;
#[cfg(feature = "sqlite")]
#[path = "bag/sqlite.rs"]
mod sqlite;
#[cfg(feature = "cli")]
#[path = "bag/told.rs"]
mod told;
#[cfg(feature = "cli")]
#[path = "bag/untrue.rs"]
mod untrue;
#[path = "bag/write.rs"]
mod write;
