//! The messages of a recording by stream, and the rows that a reader makes of them.

use govtwin_model::frame::{EsvState, Frame, Inputs, Signals};

/// Four streams of values with their stamps, ns, each strictly rising.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct GeneratedStreams {
    /// Opening command, pu.
    pub command: Vec<(i64, f64)>,
    /// State of the ESV.
    pub esv: Vec<(i64, EsvState)>,
    /// Tank pressure, Pa.
    pub tank_pressure: Vec<(i64, f64)>,
    /// Positions and pilot signals.
    pub servo_state: Vec<(i64, Signals)>,
}

impl GeneratedStreams {
    /// The same, so much later, ns.
    #[must_use]
    pub fn later(self, by_ns: i64) -> Self {
        fn later<T>(stream: Vec<(i64, T)>, by_ns: i64) -> Vec<(i64, T)> {
            stream.into_iter().map(|(stamp_ns, value)| (stamp_ns + by_ns, value)).collect()
        }
        Self {
            command: later(self.command, by_ns),
            esv: later(self.esv, by_ns),
            tank_pressure: later(self.tank_pressure, by_ns),
            servo_state: later(self.servo_state, by_ns),
        }
    }

    /// Lets command and ESV hold from the start where their stamps lag behind the plant's.
    pub fn fill_start(&mut self, begin_ns: i64) {
        if let Some(&(_, value)) = self.command.first().filter(|(stamp_ns, _)| *stamp_ns > begin_ns) {
            self.command.insert(0, (begin_ns, value));
        }
        if let Some(&(_, value)) = self.esv.first().filter(|(stamp_ns, _)| *stamp_ns > begin_ns) {
            self.esv.insert(0, (begin_ns, value));
        }
    }

    /// One row for each distinct stamp; inputs hold, measured signals stand only at their own stamps.
    pub fn rows(&self) -> Vec<Frame> {
        let mut stamps_ns: Vec<i64> = self.servo_state.iter().map(|(stamp_ns, _)| *stamp_ns).collect();
        stamps_ns.extend(self.command.iter().map(|(stamp_ns, _)| *stamp_ns));
        stamps_ns.extend(self.esv.iter().map(|(stamp_ns, _)| *stamp_ns));
        stamps_ns.extend(self.tank_pressure.iter().map(|(stamp_ns, _)| *stamp_ns));
        stamps_ns.sort_unstable();
        stamps_ns.dedup();
        let (mut command, mut esv, mut tank_pressure, mut servo_state) = (0, 0, 0, 0);
        let mut rows = Vec::with_capacity(stamps_ns.len());
        for time_ns in stamps_ns {
            let opening_command_pu = newest(&self.command, &mut command, time_ns);
            let state = newest(&self.esv, &mut esv, time_ns);
            let pressure_pa = newest(&self.tank_pressure, &mut tank_pressure, time_ns);
            let measured = newest(&self.servo_state, &mut servo_state, time_ns)
                .filter(|_| servo_state.checked_sub(1).is_some_and(|newest| self.servo_state[newest].0 == time_ns));
            if let (Some(opening_command_pu), Some(esv), Some(tank_pressure_pa)) =
                (opening_command_pu, state, pressure_pa)
            {
                rows.push(Frame {
                    time_ns,
                    inputs: Inputs { opening_command_pu, esv, tank_pressure_pa, piston_force_n: 0.0 },
                    measured: measured.unwrap_or(Signals::NONE),
                });
            }
        }
        rows
    }
}

/// The newest value at or before a time; `passed` counts the values up to it.
fn newest<V: Copy>(stream: &[(i64, V)], passed: &mut usize, time_ns: i64) -> Option<V> {
    while stream.get(*passed).is_some_and(|(stamp_ns, _)| *stamp_ns <= time_ns) {
        *passed += 1;
    }
    passed.checked_sub(1).and_then(|newest| stream.get(newest)).map(|(_, value)| *value)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn inputs_hold_and_measured_signals_do_not() {
        let measured = |spool_position_pu| Signals { spool_position_pu, ..Signals::NONE };
        let mut streams = GeneratedStreams {
            command: vec![(5, 0.1), (15, 0.2)],
            esv: vec![(0, EsvState::Normal), (12, EsvState::Shutdown)],
            tank_pressure: vec![(0, 6e6)],
            servo_state: vec![(0, measured(0.3)), (10, measured(0.4))],
        };
        streams.fill_start(0);
        let rows = streams.rows();
        assert_eq!(rows.iter().map(|row| row.time_ns).collect::<Vec<_>>(), [0, 5, 10, 12, 15]);
        assert_eq!(rows.iter().map(|row| row.inputs.opening_command_pu).collect::<Vec<_>>(), [0.1, 0.1, 0.1, 0.1, 0.2]);
        assert_eq!(rows[2].inputs.esv, EsvState::Normal);
        assert_eq!(rows[3].inputs.esv, EsvState::Shutdown);
        assert_eq!(rows[2].measured.spool_position_pu, 0.4);
        assert!(rows[1].measured.spool_position_pu.is_nan() && rows[3].measured.spool_position_pu.is_nan());
    }
}
