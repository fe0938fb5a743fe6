//! What a bench on this machine recorded, against a simulation of the bag that was played: `scripts/hil_loopback`.
//!
//! The bus delays each input by its way through DDS and to the next tick; nothing else may differ. So the
//! recorded servomotor lies within (fastest speed × delay) of the simulated one, plus the width of the dead
//! band, inside which the regulator lets it rest anywhere. The spool may differ by the regulator's gain
//! times that, plus the jump that the overlap compensation makes at the edge of the dead band.
#![cfg(feature = "node")]

#[path = "support/journal.rs"]
mod journal;

use std::path::PathBuf;

use govtwin_bag::msg::{GovernorCommand, ServoState};
use govtwin_bag::{ReadOptions, cdr};
use govtwin_model::frame::{Frame, Signals};
use govtwin_model::params;
use govtwin_model::twin::Twin;

/// Besides the measured jitter of arrival: one tick until a command acts, and one for the recorder's own stamp.
const TICKS_S: f64 = 0.002;

/// A machine that delays samples by more than this is no bench.
const LARGEST_JITTER_S: f64 = 0.05;

fn path_in(variable: &str) -> PathBuf {
    PathBuf::from(
        std::env::var_os(variable).unwrap_or_else(|| panic!("{variable} is not set; run scripts/hil_loopback")),
    )
}

/// Messages of a topic with their log times.
fn decoded<M: serde::de::DeserializeOwned>(bag: &std::path::Path, topic: &str) -> Vec<(i64, M)> {
    let messages = govtwin_bag::messages(bag).unwrap().map(Result::unwrap);
    let of_topic = messages.filter(|message| message.topic.name == topic);
    of_topic.map(|message| (message.log_time_ns, cdr::decode(&message.data).unwrap())).collect()
}

#[test]
#[ignore = "needs three processes and a bag: scripts/hil_loopback runs it"]
fn the_bench_is_the_simulation() {
    let recorded = path_in("GOVTWIN_HIL_RECORDED");
    // Wall time minus the bag's time, and how much it jitters.
    let commands: Vec<(i64, GovernorCommand)> = decoded(&recorded, "/governor/command");
    let mut shifts_ns: Vec<i64> =
        commands.iter().map(|(log_ns, command)| log_ns - command.header.stamp.nanos().unwrap()).collect();
    shifts_ns.sort_unstable();
    let shift_ns = shifts_ns[shifts_ns.len() / 2];
    let jitter_s = (shifts_ns.last().unwrap() - shifts_ns[0]) as f64 * 1e-9;

    let source = govtwin_bag::read(&path_in("GOVTWIN_HIL_SOURCE"), &ReadOptions::default()).unwrap().recording.frames;
    let last_ns = commands.iter().map(|(log_ns, _)| log_ns - shift_ns).max().unwrap();
    let states: Vec<(i64, ServoState)> = decoded(&recorded, "/sim/servo_state");
    let unit = params::reference();
    let regulator = unit.parameters.regulator;
    let mut twin = Twin::new(&unit);
    let mut rows = source.iter().peekable();
    let mut held: Option<Frame> = None;
    let (mut worst, mut squares, mut fastest_1_s, mut fastest_spool_1_s, mut count) =
        ([0.0_f64; 2], [0.0_f64; 2], 0.0_f64, 0.0_f64, 0);
    for (_, state) in &states {
        let time_ns = state.header.stamp.nanos().unwrap() - shift_ns;
        while let Some(row) = rows.next_if(|row| row.time_ns <= time_ns) {
            let frame = Frame { measured: Signals::NONE, ..*row };
            let _ = twin.step(&frame);
            held = Some(frame);
        }
        let Some(frame) = held.filter(|_| time_ns <= last_ns) else { continue };
        let estimate = twin.step(&Frame { time_ns, ..frame });
        let differences = [
            estimate.signals.servomotor_position_pu - state.servomotor_position,
            estimate.signals.spool_position_pu - state.spool_position,
        ];
        for (index, difference) in differences.into_iter().enumerate() {
            worst[index] = worst[index].max(difference.abs());
            squares[index] += difference * difference;
        }
        fastest_1_s = fastest_1_s.max(estimate.servomotor_velocity_m_s.abs() / unit.parameters.servomotor.stroke_m);
        let spool_1_s = estimate.spool_velocity_m_s.abs() / unit.parameters.distributing_valve.reference_stroke_m;
        fastest_spool_1_s = fastest_spool_1_s.max(spool_1_s);
        count += 1;
    }
    let delay_s = jitter_s + TICKS_S;
    let dead_band_pu = regulator.deadband_upper_pu - regulator.deadband_lower_pu;
    let jump_pu = regulator.compensation_positive_pu - regulator.compensation_negative_pu;
    let bound_pu = fastest_1_s * delay_s + dead_band_pu;
    let spool_bound_pu = fastest_spool_1_s * delay_s + regulator.position_gain * bound_pu + jump_pu;
    let rms = squares.map(|sum| (sum / f64::from(count)).sqrt());
    println!("{count} states over {:.1} s; arrival jitters by {:.2} ms", f64::from(count) * 0.01, jitter_s * 1e3);
    println!("servomotor: rms {:.2e} pu, worst {:.2e} pu, bound {bound_pu:.2e} pu", rms[0], worst[0]);
    println!("spool:      rms {:.2e} pu, worst {:.2e} pu, bound {spool_bound_pu:.2e} pu", rms[1], worst[1]);
    assert!(count > 100, "too few states");
    assert!(jitter_s < LARGEST_JITTER_S, "arrival jitters by {:.1} ms: the machine is too busy", jitter_s * 1e3);
    assert!(fastest_1_s > 0.01, "nothing moved: nothing was shown");
    assert!(worst[0] <= bound_pu, "servomotor out of bound");
    assert!(worst[1] <= spool_bound_pu, "spool out of bound");
    journal::assert_replays(&path_in("GOVTWIN_HIL_JOURNAL"), 100);
    println!("the node's own bag replays to the last bit");
}
