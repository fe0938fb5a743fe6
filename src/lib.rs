//! A digital twin of a hydro-turbine governor's servo system.
//!
//! The data flow and the floors of the house are drawn in `ARCHITECTURE.md`.

// words
pub mod digest;
pub mod frame;
pub mod parameters;
pub mod recording;
pub mod signal;
pub mod state;
pub mod units;

// physics
pub mod plant;
pub mod provenance;
pub mod solver;

// corrections
pub mod effects;
pub mod residual;

// heart
pub mod twin;

// judgement
pub mod acceptance;
pub mod baselines;
pub mod battery;
pub mod blind;
pub mod comparison;
pub mod diagnosis;
pub mod generate;
pub mod metrics;
pub mod replay;
pub mod report;
pub mod sheet;
pub mod trend;
pub mod tuning;
pub mod watch;

// edges
pub mod bag;
pub mod files;
pub mod import;
pub mod msg;
#[cfg(feature = "node")]
pub mod node;
pub mod params;
