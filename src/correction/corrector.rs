//! A model at work: one frame and the twin's estimate in, a guarded correction and its band out.

use serde::Serialize;

use super::adapt::{Adaptation, Adapter};
use super::band::Band;
use super::features::{self, Feature};
use super::forest::Forest;
use super::guard::{Guard, GuardCounts, Passed};
use super::history::History;
use super::model::{Learned, Model, ModelError};
use super::row::{RowChannel, RowMaker};
use govtwin_model::frame::{Estimate, Frame};
use govtwin_model::signal::Signal;

/// The output of a model for one row, in the unit of its signal.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Correction {
    /// The twin's own value; the coefficient's unit is the signal's.
    pub uncorrected: f64,
    /// The corrected value, equal to the twin's where the guard is off; the coefficient's unit is the signal's.
    pub corrected: f64,
    /// Half width of the band around it, wider where training rows are far; NaN where there is none: without a band, or outside the support. In the signal's unit, pu or Pa.
    pub half_width: f64,
    /// How much of the learned correction was let through, 1 in the support; a share of 1.
    pub weight_share: f64,
}

/// A model with its memory. A step allocates nothing and cannot fail.
#[derive(Clone, Debug)]
pub struct Corrector {
    signal: Signal,
    learned: Learned,
    rows: RowMaker,
    period_ns: i64,
    features: Vec<Feature>,
    forest: Forest,
    guard: Guard,
    band: Option<Band>,
    history: History,
    values: Vec<f64>,
    counts: GuardCounts,
    adapter: Option<Adapter>,
}

impl Corrector {
    /// A model, ready to run.
    ///
    /// # Errors
    /// Where its features, trees or signal are not known here.
    pub fn new(model: &Model) -> Result<Self, ModelError> {
        let features = model.features()?;
        Ok(Self {
            signal: model.signal()?,
            learned: model.learned,
            rows: RowMaker::new(model.opening, model.signal()?),
            period_ns: model.period_ns,
            values: vec![0.0; features.len()],
            features,
            forest: model.forest()?,
            guard: model.guard.clone(),
            band: model.band,
            history: History::new(model.period_ns),
            counts: GuardCounts::default(),
            adapter: None,
        })
    }

    /// The same with adaptation to drift, fed by what frames hold as measured.
    ///
    /// # Errors
    /// If the model has no band that separates drift from its usual residuals.
    pub fn adapting(mut self, model: &Model) -> Result<Self, ModelError> {
        let missing = || ModelError::Mismatch {
            what: "band, against which drift is judged,",
            found: "missing".to_owned(),
            expected: "a model trained on more rows".to_owned(),
        };
        self.adapter = Some(Adapter::new(model, &self.forest).ok_or_else(missing)?);
        Ok(self)
    }

    /// What the adaptation saw and did, where there is one.
    pub fn adaptation(&self) -> Option<Adaptation> {
        self.adapter.as_ref().map(Adapter::counts)
    }

    /// The signal that it corrects.
    pub fn signal(&self) -> Signal {
        self.signal
    }

    /// Share of the measured values that its band is to hold, where it has one.
    pub fn coverage_share(&self) -> Option<f64> {
        self.band.map(|band| band.coverage_share)
    }

    /// What the guard did so far.
    pub fn counts(&self) -> &GuardCounts {
        &self.counts
    }

    /// What the guard did since it was last taken.
    pub fn take_counts(&mut self) -> GuardCounts {
        std::mem::take(&mut self.counts)
    }

    /// Alarms of drift so far.
    pub fn alarms(&self) -> u64 {
        self.adapter.as_ref().map_or(0, Adapter::alarms)
    }

    /// Forgets the past; counts and adaptation go on.
    pub fn reset(&mut self) {
        self.rows.reset();
        self.history.reset();
    }

    /// Corrects one estimate. Rows must come in time order; a step back begins a new past.
    pub fn step(&mut self, frame: &Frame, estimate: &Estimate) -> Correction {
        let row = self.rows.row(frame, estimate);
        let taps = self.history.push(frame.time_ns, &row);
        features::fill(&self.features, taps, self.period_ns, &mut self.values);
        let motion = motion(taps.iter().take(5).map(|tap| tap[RowChannel::Model as usize]));
        let said = match &mut self.adapter {
            Some(adapter) => self.forest.value_and_leaves(&self.values, adapter.leaves()),
            None => self.forest.value(&self.values),
        };
        let Passed { value, weight_share, widening } = self.guard.apply(said, &self.values, &mut self.counts);
        let uncorrected = self.signal.of(&estimate.signals);
        let mut corrected = match self.learned {
            Learned::Residual => uncorrected + value,
            Learned::Signal => value,
        };
        // What the guard does not vouch for is neither adapted nor learned from.
        if let Some(adapter) = self.adapter.as_mut().filter(|_| weight_share == 1.0) {
            let added = adapter.correction(uncorrected);
            adapter.hear(frame.time_ns, self.signal.of(&frame.measured), corrected, uncorrected, motion);
            if added != 0.0 {
                corrected += added;
            }
        }
        let half_width = self.band.map_or(f64::NAN, |band| band.half_width(motion)) * widening;
        Correction { uncorrected, corrected, half_width, weight_share }
    }
}

/// How far a signal moved over its values.
pub fn motion(values: impl Iterator<Item = f64>) -> f64 {
    let (low, high) =
        values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| (low.min(value), high.max(value)));
    high - low
}

#[cfg(test)]
mod tests {
    use super::Corrector;
    use crate::model::tests::model;
    use govtwin_model::frame::{EsvState, Frame, Inputs, Signals};
    use govtwin_model::twin::Twin;

    fn frame(k: i64, command_pu: f64) -> Frame {
        let inputs = Inputs {
            opening_command_pu: command_pu,
            esv: EsvState::Normal,
            tank_pressure_pa: 6.3e6,
            piston_force_n: 0.0,
        };
        Frame { time_ns: k * 1_000_000, inputs, measured: Signals::NONE }
    }

    #[test]
    fn corrects_by_what_its_trees_say_and_goes_off_on_bad_input() {
        let mut twin = Twin::new(&govtwin_model::params::reference());
        let mut corrector = Corrector::new(&model()).unwrap();
        for k in 0..300 {
            let frame = frame(k, if k < 100 { 0.4 } else { 0.6 });
            let mut estimate = twin.step(&frame);
            if k == 299 {
                estimate.signals.control_pressure_pa = f64::NAN;
            }
            let correction = corrector.step(&frame, &estimate);
            let by = if k == 299 {
                0.0
            } else if k < 100 {
                -0.01
            } else {
                0.01
            };
            assert_eq!(correction.corrected, estimate.signals.spool_position_pu + by);
            assert_eq!(correction.uncorrected, estimate.signals.spool_position_pu);
        }
        assert_eq!((corrector.counts().rows, corrector.counts().bad), (300, 1));
    }
}
