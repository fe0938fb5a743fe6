//! The alignment rule against a slow and obvious reading of it, on streams with their own rates and jitter.

use govtwin_bag::{Interpolation, ReadOptions};
use govtwin_model::frame::EsvState;
use mcap::WriteOptions;
use proptest::prelude::{Just, ProptestConfig, Strategy, any, prop, prop_assert, prop_assert_eq, proptest};

use super::make::{BEGIN_NS, Bag, MS, read_both_ways};

/// Times within four seconds, in any order, each once.
fn stamps(most: usize) -> impl Strategy<Value = Vec<i64>> {
    let times = prop::collection::btree_set(0..4000i64, 1..most);
    times.prop_map(|times| times.into_iter().map(|ms| BEGIN_NS + ms * MS).collect::<Vec<_>>())
}

fn samples(most: usize) -> impl Strategy<Value = Vec<(i64, f64)>> {
    stamps(most).prop_flat_map(|stamps| {
        let values = prop::collection::vec(0.0..1.0, stamps.len());
        (Just(stamps), values).prop_map(|(stamps, values)| stamps.into_iter().zip(values).collect())
    })
}

/// The newest sample at or before a time.
fn newest<V: Copy>(samples: &[(i64, V)], time_ns: i64) -> Option<(i64, V)> {
    samples.iter().rev().find(|(stamp_ns, _)| *stamp_ns <= time_ns).copied()
}

/// On the straight line between the samples around a time.
fn straight(samples: &[(i64, f64)], time_ns: i64) -> Option<f64> {
    let (before_ns, before) = newest(samples, time_ns)?;
    let after = samples.iter().find(|(stamp_ns, _)| *stamp_ns > time_ns);
    Some(after.map_or(before, |(after_ns, after)| {
        before + (time_ns - before_ns) as f64 / (after_ns - before_ns) as f64 * (after - before)
    }))
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn rows_follow_the_rule(
        command in samples(60),
        esv in stamps(10).prop_map(|stamps| {
            stamps.into_iter().enumerate().map(|(i, stamp)| (stamp, (i % 2) as u8)).collect::<Vec<_>>()
        }),
        pressure in samples(30),
        servo in samples(60),
        linear: bool,
        shuffle in any::<u64>(),
    ) {
        let mut bag = Bag::default();
        command.iter().for_each(|(stamp_ns, value)| bag.command(*stamp_ns, *value));
        esv.iter().for_each(|(stamp_ns, state)| bag.esv(*stamp_ns, *state));
        pressure.iter().for_each(|(stamp_ns, value)| bag.pressure(*stamp_ns, 1e6 * value));
        servo.iter().for_each(|(stamp_ns, value)| bag.servo(*stamp_ns, -value, *value));
        // Arrival with up to 0.2 s of jitter, other for each message.
        for (i, entry) in bag.entries.iter_mut().enumerate() {
            entry.log_ns += (shuffle.wrapping_mul(i as u64 + 1) % 200) as i64 * MS;
        }
        bag.entries.sort_by_key(|entry| entry.log_ns);
        let (_folder, path) = bag.file(WriteOptions::new());
        let period_ns = 7 * MS;
        let interpolation = if linear { Interpolation::Linear { period_ns } } else { Interpolation::Hold };
        let read = read_both_ways(&path, &ReadOptions { interpolation, ..ReadOptions::default() });

        let begin_ns = command[0].0.max(esv[0].0).max(pressure[0].0);
        let stamps = command.iter().chain(&pressure).chain(&servo).map(|sample| sample.0);
        let mut times_ns: Vec<i64> = stamps.chain(esv.iter().map(|sample| sample.0)).filter(|ns| *ns >= begin_ns).collect();
        let end_ns = command.last().unwrap().0.max(servo.last().unwrap().0).max(begin_ns);
        times_ns.retain(|time_ns| *time_ns <= end_ns);
        if linear {
            times_ns.extend((0..).map(|step| begin_ns + step * period_ns).take_while(|time_ns| *time_ns <= end_ns));
        }
        times_ns.sort_unstable();
        times_ns.dedup();

        let frames = read.unwrap().recording.frames;
        prop_assert_eq!(frames.iter().map(|frame| frame.time_ns).collect::<Vec<_>>(), times_ns);
        for frame in &frames {
            let (opening, tank) = if linear {
                (straight(&command, frame.time_ns).unwrap(), straight(&pressure, frame.time_ns).unwrap())
            } else {
                (newest(&command, frame.time_ns).unwrap().1, newest(&pressure, frame.time_ns).unwrap().1)
            };
            prop_assert!((frame.inputs.opening_command_pu - opening).abs() < 1e-12);
            prop_assert!((frame.inputs.tank_pressure_pa - 1e6 * tank).abs() < 1e-6);
            let open = newest(&esv, frame.time_ns).unwrap().1 == 1;
            prop_assert_eq!(frame.inputs.esv, if open { EsvState::Normal } else { EsvState::Shutdown });
            let measured = frame.measured.servomotor_position_pu;
            match servo.iter().find(|(stamp_ns, _)| *stamp_ns == frame.time_ns) {
                Some((_, value)) => prop_assert_eq!(measured, *value),
                None => prop_assert!(measured.is_nan()),
            }
        }
    }
}

#[test]
fn rows_begin_when_every_input_has_a_value() {
    let mut bag = Bag::default();
    bag.esv(BEGIN_NS, 1);
    bag.pressure(BEGIN_NS, 4e6);
    bag.servo(BEGIN_NS, 0.0, 0.0);
    bag.command(BEGIN_NS + 500 * MS, 0.2);
    let (_folder, path) = bag.file(WriteOptions::new());
    let frames = read_both_ways(&path, &ReadOptions::default()).unwrap().recording.frames;
    assert_eq!(frames.len(), 1, "only the last stamp has all inputs");
    assert_eq!(frames[0].time_ns, BEGIN_NS + 500 * MS);
}
