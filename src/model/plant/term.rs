//! Terms: additions of effects for which no block of the plant has a coefficient.
//!
//! A term acts at one point of the chain, reads the signal there and the state of the last tick, and
//! returns the changed signal. Its memory is in the twin's state and advances once a tick.

pub(crate) mod delay;
pub(crate) mod play;

use std::fmt;
use std::sync::Arc;

use crate::state::State;
use crate::stored::with_words;

with_words! {
    /// Where in the chain a term acts.
    #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
    pub enum Point: id {
        /// The opening command on its way to the regulator, pu.
        Command = "command_pu",
        /// The ESV's opening, 1 normal, 0 shutdown.
        EsvOpening = "esv_opening_pu",
        /// The tank's pressure as it reaches the valves, Pa.
        SupplyPressure = "supply_pressure_pa",
        /// The servomotor's reading in the regulator, pu.
        RegulatorServomotor = "regulator_servomotor_pu",
        /// The spool's reading in the regulator, pu.
        RegulatorSpool = "regulator_spool_pu",
        /// The regulator's current to the proportional valve, pu.
        ValveCurrent = "valve_current_pu",
        /// The servomotor's transducer, pu.
        ServomotorReading = "servomotor_reading_pu",
        /// The spool's position as it drives the ports where it is recorded, m; not used for a simulated spool.
        DrivingSpool = "driving_spool_m",
        /// Force on the spool, N, + opens.
        SpoolForce = "spool_force_n",
        /// Flow into the control chamber, m³/s.
        ChamberFlow = "chamber_flow_m3_s",
        /// Force on the piston, N, + opens.
        ServomotorForce = "servomotor_force_n",
        /// Flow into the opening chamber, m³/s.
        OpeningFlow = "opening_flow_m3_s",
        /// Flow into the closing chamber, m³/s.
        ClosingFlow = "closing_flow_m3_s",
    }
}

/// Number of points.
pub(crate) const POINTS: usize = Point::ALL.len();

/// What a term may look at.
#[derive(Clone, Copy, Debug)]
pub struct View<'a> {
    /// Time since the first frame, s.
    pub time_s: f64,
    /// Length of a tick, s.
    pub tick_s: f64,
    /// State at the start of the tick.
    pub state: &'a State,
    /// Tank pressure, Pa gauge.
    pub tank_pressure_pa: f64,
    /// Spool reading, pu.
    pub spool_reading_pu: f64,
    /// Servomotor reading, pu.
    pub servomotor_reading_pu: f64,
}

/// A law that acts at one point of the chain.
pub trait Term: fmt::Debug + Send + Sync {
    /// Where it acts.
    fn point(&self) -> Point;

    /// How many numbers it remembers.
    fn memory_len(&self) -> usize {
        0
    }

    /// Sets its memory for a signal that has long been constant.
    fn reset(&self, _signal: f64, _memory: &mut [f64]) {}

    /// The changed signal; called once a tick.
    fn apply(&self, signal: f64, view: &View<'_>, memory: &mut [f64]) -> f64;

    /// What comes out, by what it remembers, once a signal has stood still for long: the signal, but for a gap, whose side depends on the past.
    fn settled(&self, signal: f64, _memory: &[f64]) -> f64 {
        signal
    }
}

/// All terms of a plant, by point and in the order in which effects added them.
#[derive(Clone, Debug, Default)]
pub struct Terms {
    list: Vec<(Arc<dyn Term>, usize)>,
    ranges: [(usize, usize); POINTS],
    /// A bit for each point that has a term: most points have none.
    occupied: u16,
    memory_len: usize,
}

impl Terms {
    /// Adds a term; terms at one point act in the order in which they were added.
    pub fn push(&mut self, term: Arc<dyn Term>) {
        let at = self.ranges[term.point() as usize].1;
        let start = self.memory_len;
        self.memory_len += term.memory_len();
        let point = term.point() as usize;
        self.list.insert(at, (term, start));
        self.occupied |= 1 << point;
        self.ranges[point].1 += 1;
        for range in &mut self.ranges[point + 1..] {
            range.0 += 1;
            range.1 += 1;
        }
    }

    /// Numbers that all terms remember together.
    pub fn memory_len(&self) -> usize {
        self.memory_len
    }

    /// Whether terms at the same points have the same places in both memories.
    pub(crate) fn remember_like(&self, other: &Self) -> bool {
        let place = |(term, start): &(Arc<dyn Term>, usize)| (term.point(), *start);
        self.memory_len == other.memory_len && self.list.iter().map(place).eq(other.list.iter().map(place))
    }

    /// True when no term acts at the point.
    #[inline]
    pub(crate) fn is_empty_at(&self, point: Point) -> bool {
        self.occupied & (1 << point as u16) == 0
    }

    /// Sets the memories at a point for a signal that has long been constant.
    pub fn reset(&self, point: Point, signal: f64, memory: &mut [f64]) {
        let (from, to) = self.ranges[point as usize];
        for (term, start) in &self.list[from..to] {
            term.reset(signal, &mut memory[*start..*start + term.memory_len()]);
        }
    }

    /// What comes out at a point once a signal has stood still for long.
    pub(crate) fn settled(&self, point: Point, signal: f64, memory: &[f64]) -> f64 {
        let (from, to) = self.ranges[point as usize];
        let settled = |signal: f64, (term, start): &(Arc<dyn Term>, usize)| {
            term.settled(signal, &memory[*start..*start + term.memory_len()])
        };
        self.list[from..to].iter().fold(signal, settled)
    }

    /// Passes a signal through all terms at a point.
    #[inline]
    #[must_use]
    pub fn apply(&self, point: Point, mut signal: f64, view: &View<'_>, memory: &mut [f64]) -> f64 {
        if self.is_empty_at(point) {
            return signal;
        }
        let (from, to) = self.ranges[point as usize];
        for (term, start) in &self.list[from..to] {
            signal = term.apply(signal, view, &mut memory[*start..*start + term.memory_len()]);
        }
        signal
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Debug)]
    struct Affine(Point, f64, f64);

    impl Term for Affine {
        fn point(&self) -> Point {
            self.0
        }
        fn apply(&self, signal: f64, _view: &View<'_>, _memory: &mut [f64]) -> f64 {
            self.1 * signal + self.2
        }
    }

    #[test]
    fn terms_act_at_their_point_in_the_order_added() {
        let mut terms = Terms::default();
        terms.push(Arc::new(Affine(Point::ServomotorReading, 1.0, 1.0)));
        terms.push(Arc::new(Affine(Point::Command, 1.0, 10.0)));
        terms.push(Arc::new(Affine(Point::ServomotorReading, 2.0, 0.0)));
        let state = State::default();
        let view = View {
            time_s: 0.0,
            tick_s: 1e-3,
            state: &state,
            tank_pressure_pa: 6.3e6,
            spool_reading_pu: 0.0,
            servomotor_reading_pu: 0.0,
        };
        assert_eq!(terms.apply(Point::ServomotorReading, 3.0, &view, &mut []), 8.0);
        assert_eq!(terms.apply(Point::Command, 3.0, &view, &mut []), 13.0);
        assert_eq!(terms.apply(Point::EsvOpening, 3.0, &view, &mut []), 3.0);
        assert!(terms.is_empty_at(Point::SpoolForce) && !terms.is_empty_at(Point::Command));
    }
}
