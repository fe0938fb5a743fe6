//! The page of a score.
