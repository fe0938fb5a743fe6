//! The learned residual: what a booster knows of the gap between the twin and the unit, guarded.
//!
//! The hybrid of Liu et al. 2025, section 3.4: `y = f(u) + Δ`, with `f` the twin and `Δ` learned from rows of
//! inputs, of the twin's own output and of what derives from them. Preparation, features, splits, trees, guard
//! and the model file need no foreign library, so that every build can run a model; only `booster`, `search` and `training`,
//! which make one, need the feature `residual`.

pub mod adapt;
pub mod band;
#[cfg(feature = "residual")]
pub mod booster;
pub mod corrector;
#[cfg(feature = "deep")]
pub mod deep;
pub mod features;
pub mod forest;
pub mod guard;
pub mod history;
pub(crate) mod leaves;
pub mod model;
pub mod prepare;
pub mod rate;
pub mod reach;
pub mod row;
#[cfg(feature = "residual")]
pub mod search;
pub mod shipped;
pub mod split;
pub mod table;
#[cfg(feature = "residual")]
pub mod training;
