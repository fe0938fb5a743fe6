//! Values of a report's JSON, with something in their stead where there is none.

use std::borrow::Cow;
use std::collections::BTreeSet;
use std::sync::Mutex;

use serde_json::Value;

use super::SCHEMA;
use crate::diagnosis::result::Interval;
use crate::effects::Stage;
use crate::signal::Signal;

/// A report that no page can be made of.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ReadError {
    /// Another schema, or none.
    #[error("expected a report of the schema {SCHEMA}, found `{0}`")]
    Schema(String),
    /// A word that is none of those that the place may hold.
    #[error("{place}: expected {expected}, found `{found}`")]
    Word {
        /// Where, as a path of keys.
        place: &'static str,
        /// What may stand there.
        expected: Cow<'static, str>,
        /// What does.
        found: String,
    },
}

/// Stages, the most probable first.
pub fn in_order(mut stages: Vec<(Stage, f64)>) -> Vec<(Stage, f64)> {
    stages.sort_by(|a, b| b.1.total_cmp(&a.1));
    stages
}

/// The rows of a list; none where there is no list.
pub fn rows(value: &Value) -> impl Iterator<Item = &Value> {
    value.as_array().into_iter().flatten()
}

/// A number; NaN where there is none.
pub fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or(f64::NAN)
}

/// A count; 0 where there is none.
pub fn count(value: &Value) -> usize {
    value.as_u64().and_then(|count| usize::try_from(count).ok()).unwrap_or_default()
}

/// A text; empty where there is none.
pub fn text(value: &Value) -> String {
    value.as_str().unwrap_or_default().to_owned()
}

/// The texts of a list.
pub fn texts(value: &Value) -> Vec<String> {
    rows(value).map(text).collect()
}

fn ends(value: &Value) -> (f64, f64) {
    (number(&value["ci90"][0]), number(&value["ci90"][1]))
}

/// A value with its interval.
pub fn interval(value: &Value) -> Interval {
    let (low, high) = ends(value);
    Interval { value: number(&value["value"]), low, high }
}

/// A text that lives as long as the program, each kept once: reports have a few dozen units and names of places.
pub fn lasting(value: &Value) -> &'static str {
    static KEPT: Mutex<BTreeSet<&'static str>> = Mutex::new(BTreeSet::new());
    let found = value.as_str().unwrap_or_default();
    let mut kept = KEPT.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
    if let Some(known) = kept.get(found) {
        return known;
    }
    let new: &'static str = Box::leak(found.to_owned().into_boxed_str());
    kept.insert(new);
    new
}

/// A measured signal by its id.
pub(super) fn signal(value: &Value) -> Result<Signal, ReadError> {
    let found = text(value);
    let known = Signal::ALL.into_iter().find(|signal| signal.id() == found);
    known.ok_or(ReadError::Word { place: "signal", expected: "a measured signal".into(), found })
}
