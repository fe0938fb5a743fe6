//! Values as files hold them: enumerations with a word for each variant, read by it, figures in JSON, which knows neither NaN nor infinity, and lasting texts.

use std::collections::BTreeSet;
use std::sync::Mutex;

use serde::{Deserialize, Deserializer};

/// An enumeration in which every variant has its word: all variants in their order, and the word of each.
#[doc(hidden)]
#[macro_export]
macro_rules! with_words {
    ($(#[$about:meta])* $seen:vis enum $name:ident: $word:ident { $($(#[$doc:meta])* $variant:ident = $text:literal,)+ }) => {
        $(#[$about])*
        $seen enum $name {
            $($(#[$doc])* $variant,)+
        }

        impl $name {
            /// All, in their order.
            pub const ALL: [Self; [$($text),+].len()] = [$(Self::$variant),+];

            /// What files, reports and messages call it.
            pub const fn $word(self) -> &'static str {
                match self {
                    $(Self::$variant => $text,)+
                }
            }
        }
    };
}

/// Writes and reads a type by `id()`, one of those of `ALL`; what else is found is named with all that may stand there.
#[doc(hidden)]
#[macro_export]
macro_rules! held_by_id {
    ($type:ty, $what:literal) => {
        impl $type {
            /// The one with an id of files and reports.
            pub fn with_id(id: &str) -> Option<Self> {
                Self::ALL.into_iter().find(|one| one.id() == id)
            }
        }

        impl serde::Serialize for $type {
            fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
                serializer.serialize_str(self.id())
            }
        }

        impl<'de> serde::Deserialize<'de> for $type {
            fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
                let found = String::deserialize(deserializer)?;
                Self::with_id(&found).ok_or_else(|| {
                    let ids = Self::ALL.map(Self::id).join(", ");
                    serde::de::Error::custom(format!("expected {} ({ids}), found `{found}`", $what))
                })
            }
        }
    };
}

pub use crate::{held_by_id, with_words};

/// No figure.
pub fn no_figure() -> f64 {
    f64::NAN
}

/// A figure; NaN where there is none.
///
/// # Errors
/// What is not of the kind that the field holds.
pub fn figure<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
    Ok(Option::deserialize(deserializer)?.unwrap_or(f64::NAN))
}

/// A size; infinite where there is none.
///
/// # Errors
/// What is not of the kind that the field holds.
pub fn unbounded<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
    Ok(Option::deserialize(deserializer)?.unwrap_or(f64::INFINITY))
}

/// Sizes; infinite where there is none.
///
/// # Errors
/// What is not of the kind that the field holds.
pub fn all_unbounded<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<f64>, D::Error> {
    let found: Vec<Option<f64>> = Deserialize::deserialize(deserializer)?;
    Ok(found.into_iter().map(|one| one.unwrap_or(f64::INFINITY)).collect())
}

/// Both ends of a range; NaN where there is none.
///
/// # Errors
/// What is not of the kind that the field holds.
pub fn ends<'de, D: Deserializer<'de>>(deserializer: D) -> Result<(f64, f64), D::Error> {
    let (low, high): (Option<f64>, Option<f64>) = Deserialize::deserialize(deserializer)?;
    Ok((low.unwrap_or(f64::NAN), high.unwrap_or(f64::NAN)))
}

/// Points of a curve.
///
/// # Errors
/// What is not of the kind that the field holds.
pub fn points<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<(f64, f64)>, D::Error> {
    let points: Vec<(Option<f64>, Option<f64>)> = Deserialize::deserialize(deserializer)?;
    Ok(points.into_iter().map(|(x, y)| (x.unwrap_or(f64::NAN), y.unwrap_or(f64::NAN))).collect())
}

/// A text with the lifetime of the program; serde would require the file of a reference to live as long.
pub type LastingText = &'static str;

/// Such a text, each kept once: reports have a few dozen units and names of places.
///
/// # Errors
/// What is not of the kind that the field holds.
pub fn lasting<'de, D: Deserializer<'de>>(deserializer: D) -> Result<LastingText, D::Error> {
    static KEPT: Mutex<BTreeSet<&'static str>> = Mutex::new(BTreeSet::new());
    let found = String::deserialize(deserializer)?;
    let mut kept = KEPT.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
    if let Some(known) = kept.get(found.as_str()) {
        return Ok(known);
    }
    let new: &'static str = Box::leak(found.into_boxed_str());
    kept.insert(new);
    Ok(new)
}
