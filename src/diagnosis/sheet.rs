//! A data sheet from a name plate: the items of plate and manual, the rest by stated formulas with wide tolerances.
//!
//! [`Plate`] holds what is known, [`derive()`] makes a whole [`Unit`](govtwin_model::parameters::Unit) of it with the source of every
//! value. Laws of similarity tie missing values to given ones: flows, areas and volumes of a valve scale with the flow that it has to
//! pass, forces with pressure times area. [`matter`] finds what it would help most to know; [`recorded`] estimates missing items from recordings.

mod derive;
pub mod item;
pub mod matter;
pub mod plate_file;
mod ports;
pub(crate) mod quantity;
pub mod recorded;

use std::collections::BTreeMap;

pub use derive::{Derived, Sourced, derive};
pub use item::{ITEMS, PlateItem};

/// A value from plate or manual.
#[derive(Clone, Debug, PartialEq)]
pub struct GivenValue {
    /// In the SI unit of its item, in the item's unit.
    pub value: f64,
    /// Standard deviation as a share of the value; none where the item's own counts.
    pub tolerance_share: Option<f64>,
    /// As it was written, `63 bar`.
    pub text: String,
    /// Where it was read; empty for plate or manual.
    pub source: String,
}

/// What is known of a unit, by the keys of [`ITEMS`].
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Plate {
    /// What the unit is called.
    pub name: String,
    /// The values.
    pub values: BTreeMap<&'static str, GivenValue>,
}

impl Plate {
    /// A value, in the SI unit of its item; none where it is not known.
    pub fn get(&self, key: &str) -> Option<f64> {
        self.values.get(key).map(|given| given.value)
    }
}
