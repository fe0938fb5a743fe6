//! Trips that a slow recorder wrote down with its next row: they came earlier, and what the unit did tells when.

use super::between::{GAP_NS, is_own};
use crate::frame::{EsvState, Frame};
use crate::recording::{Recording, SLOW_NS};
use crate::signal::{Signal, span};
use crate::twin::{Cut, Twin};
use crate::units::TICK_NS;

/// Places tried between two rows before the search narrows.
const PLACES: i64 = 20;

/// So long after a trip its time shows, and hardly what else differs between twin and unit, ns.
const JUDGED_NS: i64 = 1_000_000_000;

/// What the command does between the two rows about a trip.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CommandCourse {
    /// It runs from one to the other, as elsewhere.
    Runs,
    /// It steps with the trip, as where the governor takes it back then.
    Steps,
}

impl CommandCourse {
    /// Both.
    pub const ALL: [Self; 2] = [Self::Runs, Self::Steps];
}

/// Sets the trip of a row so much earlier; the row before it is the last one that was recorded without.
pub fn set_earlier(frames: &mut [Frame], (before, row): (usize, usize), early_ns: i64, command: CommandCourse) {
    let from_ns = frames[row].time_ns - early_ns;
    if command == CommandCourse::Steps {
        let [first_pu, last_pu] = [before, row].map(|row| frames[row].inputs.opening_command_pu);
        for frame in &mut frames[before..row] {
            frame.inputs.opening_command_pu = if frame.time_ns < from_ns { first_pu } else { last_pu };
        }
    }
    for frame in frames[..row].iter_mut().rev().take_while(|frame| frame.time_ns >= from_ns) {
        frame.inputs.esv = EsvState::Shutdown;
    }
}

/// The least price and its shift from 0 to a limit: a grid, then halved steps down to a tick.
pub fn cheapest(limit_ns: i64, price: impl Fn(i64) -> f64) -> (f64, i64) {
    let mut step_ns = (limit_ns / PLACES).max(TICK_NS);
    let mut best = (price(0), 0);
    let try_at = |shift_ns: i64, best: &mut (f64, i64)| {
        if (0..=limit_ns).contains(&shift_ns) {
            let cost = price(shift_ns);
            if cost < best.0 {
                *best = (cost, shift_ns);
            }
        }
    };
    for place in 1..=limit_ns / step_ns {
        try_at(place * step_ns, &mut best);
    }
    while step_ns > TICK_NS {
        step_ns = (step_ns / 2).max(TICK_NS);
        let centre_ns = best.1;
        try_at(centre_ns - step_ns, &mut best);
        try_at(centre_ns + step_ns, &mut best);
    }
    best
}

/// Sets every trip between slow rows to when the twin does most nearly what was measured in the second after it.
///
/// Rows that hold nothing measured count as added ones. A twin that is driven by the recorded spool, or whose inputs have a clock of their own,
/// is not asked: its trips stay. Gives by how much each was set earlier, ns.
pub fn place_trips(twin: &Twin, recording: &mut Recording) -> Vec<i64> {
    let mut earlier_ns = vec![];
    if twin.cut() == Cut::Spool || twin.plant().lookahead_s != 0.0 {
        return earlier_ns;
    }
    let mut twin = twin.clone();
    twin.reset();
    let frames = &mut recording.frames;
    let (mut before, mut at_before) = (0, twin.clone());
    for row in 0..frames.len() {
        if is_own(&frames[row]) {
            let trips = frames[row].inputs.esv == EsvState::Shutdown && frames[before].inputs.esv != EsvState::Shutdown;
            if trips && (SLOW_NS..=GAP_NS).contains(&(frames[row].time_ns - frames[before].time_ns)) {
                let (placed, early_ns) = placed(&at_before, frames, (before, row));
                earlier_ns.push(early_ns);
                frames[before..=row].copy_from_slice(&placed);
                // The rows between are run through again, with the trip where it is now.
                twin = at_before.clone();
                frames[before + 1..row].iter().for_each(|frame| twin.advance(frame));
            }
        }
        twin.advance(&frames[row]);
        if is_own(&frames[row]) {
            (before, at_before) = (row, twin.clone());
        }
    }
    earlier_ns
}

/// The rows about a trip, with the trip where it explains best what follows, and by how much that is earlier, ns; the twin stands at the first of them.
fn placed(at_before: &Twin, frames: &[Frame], (before, row): (usize, usize)) -> (Vec<Frame>, i64) {
    let pause_ns = frames[row].time_ns - frames[before].time_ns;
    let until_ns = frames[row].time_ns + JUDGED_NS;
    let judged = &frames[before..before + frames[before..].partition_point(|frame| frame.time_ns <= until_ns)];
    let row = row - before;
    let spans: Vec<(Signal, f64)> = Signal::POSITIONS
        .into_iter()
        .filter_map(|signal| Some((signal, span(judged.iter().map(|frame| signal.of(&frame.measured)))?)))
        .filter(|(_, span)| *span > 0.0)
        .collect();
    let price = |early_ns: i64, command: CommandCourse| {
        let mut moved = judged.to_vec();
        set_earlier(&mut moved, (0, row), early_ns, command);
        let mut twin = at_before.clone();
        let mut price = 0.0;
        for frame in &moved[1..] {
            let estimate = twin.step(frame);
            for (signal, span) in &spans {
                let error = (signal.of(&frame.measured) - signal.of(&estimate.signals)) / span;
                price += if error.is_finite() { error * error } else { 0.0 };
            }
        }
        price
    };
    let found =
        CommandCourse::ALL.map(|command| (cheapest(pause_ns - 1, |early_ns| price(early_ns, command)), command));
    let ((_, early_ns), command) = if found[1].0.0 < found[0].0.0 { found[1] } else { found[0] };
    let mut moved = judged[..=row].to_vec();
    set_earlier(&mut moved, (0, row), early_ns, command);
    (moved, early_ns)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::{Inputs, Signals};
    use crate::replay::{Scores, simulate};

    #[test]
    fn the_search_finds_the_shift_to_a_tick() {
        for truth_ns in [0, 3_000_000, 104_000_000, 200_000_000] {
            let (_, found_ns) = cheapest(200_000_000, |shift_ns| (shift_ns - truth_ns).abs() as f64);
            assert!((found_ns - truth_ns).abs() <= TICK_NS, "{truth_ns}: {found_ns}");
        }
    }

    /// Rows every 10 ms, of which every twentieth was recorded, straight between them; two trips, with a command that steps back then.
    fn slow(twin: &mut Twin, trips_ms: [i64; 2]) -> Recording {
        let row = |ms: i64| {
            let is_shut = (trips_ms[0]..6_000).contains(&ms) || ms >= trips_ms[1];
            let inputs = Inputs {
                opening_command_pu: if is_shut { 0.0 } else { 0.4 },
                esv: if is_shut { EsvState::Shutdown } else { EsvState::Normal },
                tank_pressure_pa: 6.3e6,
                piston_force_n: 0.0,
            };
            Frame {
                time_ns: ms * 1_000_000,
                inputs,
                measured: Signals { servomotor_position_pu: 0.4, ..Signals::NONE },
            }
        };
        let mut fast = Recording::new("a", (0..2_000).map(|k| row(10 * k)).collect());
        let truth = simulate(twin, &fast);
        for (k, frame) in fast.frames.iter_mut().enumerate() {
            let (ms, last_ms) = (10 * i64::try_from(k).unwrap(), 200 * i64::try_from(k / 20).unwrap());
            let [from, to] = [last_ms, last_ms + 200].map(|ms| row(ms).inputs);
            let share = (ms - last_ms) as f64 / 200.0;
            frame.inputs.opening_command_pu =
                from.opening_command_pu + share * (to.opening_command_pu - from.opening_command_pu);
            frame.inputs.esv = from.esv;
            frame.measured = if k % 20 == 0 { truth[k].signals } else { Signals::NONE };
        }
        fast
    }

    #[test]
    fn trips_and_the_commands_that_step_with_them_are_found_between_slow_rows() {
        let mut twin = Twin::new(&crate::params::reference());
        let as_recorded = slow(&mut twin, [2_130, 14_070]);
        let mut placed = as_recorded.clone();
        assert_eq!(place_trips(&twin, &mut placed).len(), 2);
        let trips_ms = |recording: &Recording| -> Vec<i64> {
            let pairs = recording.frames.windows(2);
            pairs
                .filter(|pair| pair[0].inputs.esv == EsvState::Normal && pair[1].inputs.esv != EsvState::Normal)
                .map(|pair| pair[1].time_ns / 1_000_000)
                .collect()
        };
        assert_eq!((trips_ms(&as_recorded), trips_ms(&placed)), (vec![2_200, 14_200], vec![2_130, 14_070]));
        let mut error_pu = |recording: &Recording| {
            let estimates = simulate(&mut twin, recording);
            Scores::of(recording, &estimates).figures(Signal::SpoolPosition).rmse
        };
        assert!(error_pu(&placed) < 0.05 * error_pu(&as_recorded), "{}", error_pu(&placed));
    }

    #[test]
    fn a_trip_between_fast_rows_stays() {
        let mut twin = Twin::new(&crate::params::reference());
        let mut fast = slow(&mut twin, [2_130, 14_070]);
        let all = simulate(&mut twin, &fast);
        fast.frames.iter_mut().zip(all).for_each(|(frame, estimate)| frame.measured = estimate.signals);
        let before = fast.clone();
        assert!(place_trips(&twin, &mut fast).is_empty());
        assert_eq!(fast, before);
    }
}
