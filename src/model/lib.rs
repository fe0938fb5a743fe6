//! The simulated unit: what flows through it, the plant, its effects, the solver, the twin.
//!
//! Start at [`frame`], then [`twin`], then [`plant`] with one file per block of the chain. Nothing here knows bags, buses or clocks; the only
//! file format is that of parameter files ([`params`]).

pub mod effects;
pub mod frame;
pub mod metrics;
pub mod number;
pub mod parameters;
pub mod params;
pub mod plant;
pub mod provenance;
pub mod recording;
pub mod replay;
pub mod signal;
pub mod solver;
pub mod state;
pub mod stored;
pub mod twin;
pub mod units;
