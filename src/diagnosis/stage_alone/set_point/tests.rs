//! What a fit of the law finds in runs of it.

use super::*;

const LOOP: SetPoint = SetPoint {
    gain: 1.0,
    level: 0.02,
    delay_s: 0.12,
    lag_s: 0.35,
    rising_limit: 0.25,
    falling_limit: 0.18,
    ..SetPoint::NONE
};

fn random(seed: u64) -> impl FnMut() -> f64 {
    let mut state = seed;
    move || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1_u64 << 53) as f64
    }
}

/// Steps of a command.
fn run_of(seed: u64) -> Run {
    let mut random = random(seed);
    let (mut command, mut until_s) = (0.5, 0.0);
    let mut run = Run { opening: vec![0.5], ..Run::default() };
    for k in 0..6000 {
        let time_s = f64::from(k) * 0.02;
        if time_s >= until_s {
            (command, until_s) = (0.2 + 0.6 * random(), time_s + 1.0 + 4.0 * random());
        }
        run.time_s.push(time_s);
        run.spool.push(command);
    }
    run
}

/// Free runs of a law under steps of its command, with a little noise.
fn recorded(law: SetPoint, seed: u64) -> Vec<Run> {
    let mut run = run_of(seed);
    run.opening = law.simulated(&run);
    let mut random = random(seed + 100);
    run.opening.iter_mut().for_each(|y| *y += 1e-3 * (random() - 0.5));
    run.windows(10.0)
}

#[test]
fn gain_delay_lag_and_limits_of_a_loop_are_found() {
    let near = |found: f64, wanted: f64, share: f64| (found / wanted - 1.0).abs() < share;
    let found = SetPoint::fitted(&recorded(LOOP, 1), true).unwrap();
    assert!(near(found.gain, 1.0, 0.01) && (found.level - 0.02).abs() < 0.01, "{found:?}");
    assert!(near(found.delay_s, 0.12, 0.15) && near(found.lag_s, 0.35, 0.1), "{found:?}");
    assert!(near(found.rising_limit, 0.25, 0.05) && near(found.falling_limit, 0.18, 0.05), "{found:?}");
    // What is not there is not found.
    let free = SetPoint { delay_s: 0.0, rising_limit: f64::INFINITY, falling_limit: f64::INFINITY, ..LOOP };
    let found = SetPoint::fitted(&recorded(free, 2), true).unwrap();
    assert!(found.rising_limit.is_infinite() && found.falling_limit.is_infinite(), "{found:?}");
    assert!(found.delay_s < 0.03 && near(found.lag_s, 0.35, 0.05) && near(found.gain, 1.0, 0.005), "{found:?}");
    assert!(found.half_play == 0.0, "{found:?}");
    let lag = SetPoint::fitted(&recorded(free, 3), false).unwrap();
    assert!(lag.delay_s == 0.0 && near(lag.lag_s, 0.35, 0.05) && near(lag.gain, 1.0, 0.005), "{lag:?}");
}

/// A command that steps up and ramps down: nothing shows a limit of its own as the position falls.
#[test]
fn a_limit_holds_both_ways_unless_pieces_show_otherwise() {
    let law = SetPoint { falling_limit: LOOP.rising_limit, ..LOOP };
    for seed in 1..4 {
        let mut run = run_of(seed);
        let mut command = run.spool[0];
        for goal in &mut run.spool {
            command = goal.max(command - 0.02 * 0.1);
            *goal = command;
        }
        run.opening = law.simulated(&run);
        let mut random = random(seed);
        run.opening.iter_mut().for_each(|y| *y += 1e-3 * (random() - 0.5));
        let found = SetPoint::fitted(&run.windows(10.0), true).unwrap();
        assert!(found.rising_limit == found.falling_limit, "{found:?}");
        assert!((found.rising_limit / law.rising_limit - 1.0).abs() < 0.05, "{found:?}");
    }
}

/// The same run in other units of command and position, and by another clock.
fn in_units(run: &Run, slower: f64, command: f64, position: f64) -> Run {
    Run {
        before: run.before.iter().map(|(t, u)| (slower * t, command * u - 3.0)).collect(),
        time_s: run.time_s.iter().map(|t| slower * t).collect(),
        spool: run.spool.iter().map(|u| command * u - 3.0).collect(),
        opening: run.opening.iter().map(|y| position * y + 20.0).collect(),
    }
}

#[test]
fn play_is_found_where_it_is_in_any_unit_and_clock() {
    for half_play in [0.01, 0.03] {
        let runs = recorded(SetPoint { half_play, ..LOOP }, 5);
        let first = SetPoint::fitted(&runs, true).unwrap();
        // A run begins somewhere in the play, which nobody measured.
        assert!((first.half_play / half_play - 1.0).abs() < 0.1, "{half_play}: {first:?}");
        assert!((first.lag_s / 0.35 - 1.0).abs() < 0.15, "{half_play}: {first:?}");
        for (slower, command, position) in [(10.0, -40.0, 0.02), (0.1, 0.03, -500.0)] {
            let runs: Vec<Run> = runs.iter().map(|run| in_units(run, slower, command, position)).collect();
            let found = SetPoint::fitted(&runs, true).unwrap();
            let same = |found: f64, wanted: f64| (found / wanted - 1.0).abs() < 0.02;
            assert!(same(found.half_play, first.half_play * position.abs()), "{first:?} {found:?}");
            assert!(same(found.lag_s, first.lag_s * slower), "{first:?} {found:?}");
        }
    }
}

/// Positions of a PI loop, by many small steps of its own: a proportional gain and an integral of the error, a speed limit each way, a valve's lag.
fn pi_loop(seed: u64, integral_s: f64, [rising, falling]: [f64; 2], winds_up: bool, valve_s: f64) -> Vec<Run> {
    let mut run = run_of(seed);
    let (lag_s, steps) = (0.3, 40);
    let (mut at, mut sum, mut valve, mut opening) = (0.5, 0.0, 0.0, vec![0.5]);
    for pair in run.spool.windows(2) {
        for _ in 0..steps {
            let (error, step_s) = (pair[0] - at, 0.02 / f64::from(steps));
            let wanted = (error + sum / integral_s) / lag_s;
            let speed = wanted.clamp(-falling, rising);
            if winds_up || speed == wanted {
                sum += step_s * error;
            }
            valve += if valve_s > 0.0 { step_s / valve_s * (speed - valve) } else { speed - valve };
            at += step_s * valve;
        }
        opening.push(at);
    }
    run.opening = opening;
    let mut random = random(seed);
    run.opening.iter_mut().for_each(|y| *y += 1e-3 * (random() - 0.5));
    // Each with what the command did for a while before.
    run.windows(10.0).split_off(1)
}

#[test]
fn integral_action_and_a_valves_lag_are_found_where_they_are_with_and_without_limits() {
    let free = [f64::INFINITY; 2];
    for (seed, integral_s, limits, winds_up, valve_s) in [
        (1, 1.0, free, false, 0.0),
        (3, 1.5, [0.4, 0.3], false, 0.0),
        (4, 1.5, [0.4, 0.3], true, 0.0),
        (5, 1.0, free, false, 0.1),
        (7, 1.5, [0.4, 0.3], true, 0.15),
    ] {
        let found = SetPoint::fitted(&pi_loop(seed, integral_s, limits, winds_up, valve_s), true).unwrap();
        let near = |found: f64, wanted: f64, share: f64| (found / wanted - 1.0).abs() < share;
        assert!(near(found.gain, 1.0, 0.005) && near(found.integral_s, integral_s, 0.1), "{found:?}");
        assert!(near(found.lag_s, 0.3, 0.1) && found.half_play == 0.0, "{found:?}");
        assert!(limits[0].is_infinite() || found.winds_up == winds_up, "{found:?}");
        assert!(if valve_s > 0.0 { near(found.valve_s, valve_s, 0.1) } else { found.valve_s < 0.03 }, "{found:?}");
    }
    for seed in 5..7 {
        let found = SetPoint::fitted(&recorded(LOOP, seed), true).unwrap();
        assert!(found.integral_s.is_infinite(), "a proportional loop has none: {found:?}");
    }
}
