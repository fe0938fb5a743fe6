//! A study: generated stages and loops of four laws at three speeds, each diagnosed as `diagnose --stage-alone` does it.
//!
//! What counts: the right name or the right refusal, figures inside their 90 % intervals, and the error of the model that the report gives over that
//! of the best plain model, both on the same held-out pieces.
#![cfg(feature = "cli")]

#[expect(dead_code, reason = "several tests share it")]
#[path = "support/plain_stage.rs"]
mod plain_stage;
#[expect(dead_code, reason = "several tests share it")]
#[path = "support/position_loop.rs"]
mod position_loop;
#[expect(dead_code, reason = "several tests share it")]
#[path = "support/stage.rs"]
mod stage;

use govtwin_diagnosis::result::{ComparedModel, Diagnosis, Interval, ModelParameter, Verdict};
use govtwin_model::recording::Recording;
use plain_stage::{PlainStage, in_units};
use position_loop::{Loop, ROW_S};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use stage::Spool;

/// The laws, and what is right of each.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Law {
    /// An integrator with a dead zone, alike both ways: nothing is named.
    DeadZone,
    /// An integrator with a gain each way: its asymmetry is named, or one of the effects that look alike.
    TwoGains,
    /// A position servo with delay, lag and rate limits: nothing is named, and it is called a set point.
    Servo,
    /// The same with backlash: that is named, or part of the set point.
    ServoWithBacklash,
}

const LAWS: [Law; 4] = [Law::DeadZone, Law::TwoGains, Law::Servo, Law::ServoWithBacklash];
/// All times over the usual ones.
const SLOWER: [f64; 3] = [0.1, 1.0, 10.0];
const ROWS: usize = 2000;
/// What a stage's two directions may differ by.
const UNEQUAL: [&str; 4] = ["port_asymmetry", "load", "supply_loss", "return_loss"];
/// Held-out error of the report's model over the best plain one's that is as good.
const AS_GOOD: f64 = 1.05;

/// A recording, its law and what a report should find, by name.
struct Generated {
    law: Law,
    slower: f64,
    recording: Recording,
    truth: Vec<(&'static str, f64)>,
}

fn generated(place: usize, seed: u64) -> Generated {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let law = LAWS[place % LAWS.len()];
    let slower = SLOWER[place / LAWS.len() % SLOWER.len()];
    let mut between = |low: f64, high: f64| low * (high / low).powf(random.random_range(0.0..1.0));
    let mut scale = |high: f64| between(1.0 / high, high) * if between(1.0, 2.0) < 1.41 { -1.0 } else { 1.0 };
    let (drive, position) = ([scale(50.0), 0.3], [scale(50.0), -7.0]);
    let (recording, truth) = match law {
        Law::DeadZone | Law::TwoGains => {
            let gain_1_s = between(0.06, 0.2);
            let ratio = if law == Law::TwoGains { between(1.3, 2.5) } else { 1.0 };
            let stage = PlainStage {
                dead_pu: if law == Law::TwoGains { between(0.005, 0.03) } else { between(0.02, 0.12) },
                gains_pu_s: [gain_1_s * ratio.sqrt(), gain_1_s / ratio.sqrt()],
                lag_s: 0.0,
                most_pu_s: f64::INFINITY,
            };
            let recording = stage.record(&Spool::usual(seed), 1.0 / ROW_S, ROWS as i64);
            let truth = stage_truth(&stage, &recording, slower, drive, position);
            (in_units(&recording, drive, position), truth)
        }
        Law::Servo | Law::ServoWithBacklash => {
            let servo = Loop {
                gain: between(0.9, 1.1),
                delay_s: between(0.05, 0.2),
                lag_s: between(0.15, 0.5),
                limits_s: [between(0.2, 0.5), between(0.2, 0.5)],
                half_play: if law == Law::Servo { 0.0 } else { between(0.01, 0.04) },
                slower: 1.0,
            };
            let mut recording = in_units(&servo.record(seed, ROWS), [1.0, 0.0], position);
            for frame in &mut recording.frames {
                frame.inputs.opening_command_pu = frame.inputs.opening_command_pu * drive[0] + drive[1];
            }
            (recording, loop_truth(&servo, slower, drive, position))
        }
    };
    let mut recording = recording;
    recording.frames.iter_mut().for_each(|frame| frame.time_ns = (frame.time_ns as f64 * slower).round() as i64);
    Generated { law, slower, recording, truth }
}

/// The figures of a stage in the units of its recording.
fn stage_truth(
    stage: &PlainStage,
    recording: &Recording,
    slower: f64,
    drive: [f64; 2],
    position: [f64; 2],
) -> Vec<(&'static str, f64)> {
    let speed = |sign: f64, gain: f64| {
        let spools = recording.frames.iter().map(|frame| sign * frame.measured.spool_position_pu);
        sign * gain * (spools.fold(0.0, f64::max) - stage.dead_pu) * position[0] / slower
    };
    let ends = [1.0, -1.0].map(|sign| drive[1] + sign * stage.dead_pu * drive[0]);
    let speeds = [speed(1.0, stage.gains_pu_s[0]), speed(-1.0, stage.gains_pu_s[1])];
    let [rises, falls] = if position[0] > 0.0 { [0, 1] } else { [1, 0] };
    vec![
        ("spool_zero", drive[1]),
        ("dead_band", (2.0 * stage.dead_pu * drive[0]).abs()),
        ("rises_from", ends[rises]),
        ("falls_from", ends[falls]),
        ("rising_speed", speeds[rises]),
        ("falling_speed", speeds[falls]),
    ]
}

/// The parameters of a set point in the units of its recording.
fn loop_truth(servo: &Loop, slower: f64, drive: [f64; 2], position: [f64; 2]) -> Vec<(&'static str, f64)> {
    let gain = servo.gain * position[0] / drive[0];
    let [rises, falls] = if position[0] > 0.0 { [0, 1] } else { [1, 0] };
    let mut all = vec![
        ("gain", gain),
        ("level", position[1] - gain * drive[1]),
        ("lag", servo.lag_s * slower),
        ("delay", servo.delay_s * slower),
        ("rate limit, rising", servo.limits_s[rises] * position[0].abs() / slower),
        ("rate limit, falling", servo.limits_s[falls] * position[0].abs() / slower),
    ];
    if servo.half_play > 0.0 {
        all.push(("backlash or dead band, full width", 2.0 * servo.half_play * position[0].abs()));
    }
    all
}

/// What came of one.
struct Outcome {
    law: Law,
    slower: f64,
    is_right: bool,
    /// Figures inside their intervals, and all that have one.
    inside: [usize; 2],
    /// Error of the report's model over that of the best plain one.
    share: f64,
    line: String,
}

/// The figures with their intervals: those of the stage, or of the set point where that refuses it.
fn figures(said: &Diagnosis) -> Vec<(&'static str, Interval)> {
    let figures = &said.part.as_ref().unwrap().figures;
    if !figures.is_empty() {
        return figures.iter().map(|one| (one.id, one.value)).collect();
    }
    let of = |one: &ModelParameter| (one.name, Interval { value: one.value, low: one.ends.0, high: one.ends.1 });
    given(said).parameters.iter().map(of).collect()
}

/// The model that the report gives: the plain one that wins, the twin with what is named, or the recalibrated one.
fn given(said: &Diagnosis) -> &ComparedModel {
    let part = said.part.as_ref().unwrap();
    let of = |name: &str| part.models.iter().find(|one| one.model == name);
    let blamed: Vec<&str> = said.blamed.iter().map(|one| one.id.as_str()).collect();
    let named = if said.verdict == Verdict::Named {
        blamed.join(" + ")
    } else {
        blamed.first().copied().unwrap_or_default().to_owned()
    };
    let plain = part.plain_wins.as_deref().or(part.plain_as_good.as_deref()).and_then(of);
    plain.or_else(|| of(&named)).or_else(|| of("")).unwrap()
}

fn outcome(place: usize, seed: u64) -> Outcome {
    let Generated { law, slower, recording, truth } = generated(place, seed);
    let said = stage::freely(vec![recording]);
    let part = said.part.as_ref().unwrap();
    let ids: Vec<&str> = said.blamed.iter().map(|one| one.id.as_str()).collect();
    let won = part.plain_wins.as_deref();
    let is_set_point = won == Some("set point with lag") && said.verdict != Verdict::NoSuchUnit;
    let has_play = given(&said).parameters.iter().any(|one| one.name == "backlash or dead band, full width");
    let is_right = match law {
        Law::DeadZone => ids.is_empty() && said.verdict != Verdict::NoSuchUnit,
        Law::TwoGains => ids.iter().any(|id| UNEQUAL.contains(id)) || won == Some("integrator with two gains"),
        Law::Servo => ids.is_empty() && is_set_point && !has_play,
        Law::ServoWithBacklash => ids.contains(&"backlash") || (is_set_point && has_play),
    };
    let mut inside = [0, 0];
    let mut missed = Vec::new();
    for (name, found) in figures(&said) {
        if let Some((_, wanted)) = truth.iter().find(|(known, _)| *known == name) {
            let is_inside = found.low <= *wanted && *wanted <= found.high;
            inside = [inside[0] + usize::from(is_inside), inside[1] + 1];
            if !is_inside {
                missed.push(format!("{name} {:.4} [{:.4}, {:.4}] of {wanted:.4}", found.value, found.low, found.high));
            }
        }
    }
    let plain = part.models.iter().filter(|one| one.is_plain).min_by(|a, b| a.held_out.total_cmp(&b.held_out)).unwrap();
    let share = given(&said).held_out / plain.held_out;
    let line = format!(
        "{place}: {law:?} × {slower}: {}, {:?} {ids:?}, plain {won:?}, best plain {}, figures {inside:?} {missed:?}, error {:.4} × {share:.3} halves {:?} {:?}; {:?}",
        if is_right { "right" } else { "WRONG" },
        said.verdict,
        plain.model,
        plain.held_out,
        given(&said).halves,
        plain.halves,
        given(&said).parameters.iter().map(|one| format!("{} {:.4}", one.name, one.value)).collect::<Vec<_>>()
    );
    println!("{line}");
    Outcome { law, slower, is_right, inside, share, line }
}

/// `STAGES` says how many, `SEED` which.
#[test]
#[ignore = "a study of 200 diagnoses, hours"]
fn how_often_generated_laws_are_told_as_what_they_are() {
    let number = |name: &str, usual: usize| std::env::var(name).map_or(usual, |text| text.parse().unwrap());
    let (count, seed) = (number("STAGES", 200), number("SEED", 700));
    let outcomes: Vec<Outcome> = (0..count).map(|place| outcome(place, (seed + place) as u64)).collect();
    println!(
        "| law | × time | n | right | figures inside 90 % | error ≤ {AS_GOOD} × best plain | median |\n|---|---|---|---|---|---|---|"
    );
    let row = |name: String, slower: String, some: &[&Outcome]| {
        let inside: [usize; 2] = std::array::from_fn(|k| some.iter().map(|one| one.inside[k]).sum());
        let right = some.iter().filter(|one| one.is_right).count();
        let as_good = some.iter().filter(|one| one.share <= AS_GOOD).count();
        let mut shares: Vec<f64> = some.iter().map(|one| one.share).collect();
        shares.sort_by(f64::total_cmp);
        let (n, median) = (some.len(), shares.get(shares.len() / 2).copied().unwrap_or(f64::NAN));
        println!("| {name} | {slower} | {n} | {right} | {} of {} | {as_good} | {median:.2} |", inside[0], inside[1]);
    };
    for law in LAWS {
        for slower in SLOWER {
            let some: Vec<&Outcome> = outcomes.iter().filter(|one| one.law == law && one.slower == slower).collect();
            row(format!("{law:?}"), slower.to_string(), &some);
        }
    }
    row("all".to_owned(), String::new(), &outcomes.iter().collect::<Vec<_>>());
    for one in outcomes.iter().filter(|one| !one.is_right || one.share > AS_GOOD) {
        println!("{}", one.line);
    }
}
