//! Watching a unit: processes cut out of what it does all day, one diagnosis of each, and sizes of faults followed over them.

pub mod cut;
pub mod excerpt;
pub mod history;
