//! Whether a position jumps from one sample to the next and stays there, as none does that is moved by oil.

use govtwin_model::units::seconds_from_nanos;

use super::impossible::Impossible;
use super::{FAST_PU, FASTEST_PU_S};

/// After a jump the next sample is where it went to, but for this share of it; a sample that lies alone is none.
const STAYS: f64 = 0.25;

/// The last step of a position that was too large, and the first that stayed.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct JumpWatch {
    last: Option<(i64, f64)>,
    step: Option<(i64, f64, f64)>,
    count: u64,
    first: Option<(i64, f64, f64)>,
}

impl JumpWatch {
    pub(super) fn take(&mut self, time_ns: i64, position: f64) {
        let Some((last_ns, last)) = self.last.replace((time_ns, position)) else { return };
        let (step_s, by_pu) = (seconds_from_nanos(time_ns.saturating_sub(last_ns)), position - last);
        let before = self.step.take();
        if let Some(jump) = before.filter(|(_, jumped_pu, _)| by_pu.abs() < STAYS * jumped_pu.abs()) {
            self.count += 1;
            self.first.get_or_insert(jump);
        }
        let jumps = step_s > 0.0 && by_pu.abs() > FAST_PU && by_pu.abs() > FASTEST_PU_S * step_s;
        // The way back from a sample that lies alone is none.
        let returns = before.is_some_and(|(_, jumped_pu, _)| (by_pu + jumped_pu).abs() < STAYS * jumped_pu.abs());
        self.step = (jumps && !returns).then_some((time_ns, by_pu, step_s));
    }

    pub(super) fn found(&self) -> Option<Impossible> {
        let (time_ns, by_pu, step_s) = self.first?;
        Some(Impossible::Jumps { by_pu, step_s, time_ns, count: self.count })
    }
}
