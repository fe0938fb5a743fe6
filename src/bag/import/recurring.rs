//! What is given again and again: constants from the first row on, the ESV on change, both once a second, as a governor does.

use super::map::{Map, SignalPlace};
use super::row::{ImportedRow, Target};

/// Time after which the state of the ESV, and what is constant, is given again, ns.
const AGAIN_NS: i64 = 1_000_000_000;

/// Completes rows by constants, and thins out the ESV.
#[derive(Clone, Debug, Default)]
pub struct Recurring {
    constants: Vec<(Target, f64)>,
    given_ns: Option<i64>,
    esv: Option<(i64, f64)>,
}

impl Recurring {
    /// With the constants of a map.
    pub fn new(map: &Map) -> Self {
        let constant = |signal: &super::SignalMap| match signal.from {
            SignalPlace::Constant(value) => Some((signal.target, value)),
            _ => None,
        };
        Self { constants: map.signals.iter().filter_map(constant).collect(), given_ns: None, esv: None }
    }

    /// Completes a row, which may be empty afterwards.
    pub fn complete(&mut self, row: &mut ImportedRow) {
        // Also where time goes back: what is constant holds before its first row, too.
        if self.given_ns.is_none_or(|given_ns| !(0..AGAIN_NS).contains(&row.time_ns.saturating_sub(given_ns))) {
            self.given_ns = Some(row.time_ns);
            for (target, value) in &self.constants {
                row.set(*target, *value);
            }
        }
        let Some(state) = row.value(Target::Esv) else { return };
        match self.esv {
            Some((time_ns, last)) if last == state && (0..AGAIN_NS).contains(&row.time_ns.saturating_sub(time_ns)) => {
                row.set(Target::Esv, f64::NAN);
            }
            _ => self.esv = Some((row.time_ns, state)),
        }
    }
}
