//! The sim-to-real diagnosis: where the gap lies, which effect causes it, how far it shrinks.

pub mod outcome;
pub mod search;
