//! Servomotor stages alone whose faults are known: the spool is moved, and spool and servomotor are recorded.
//!
//! Half of the stages are the twin's own, half of those that have such an equation follow the plain law (a dead zone, a gain each way, a lag, a greatest
//! speed). No law is exact: their speed is off by a smooth function of how far the spool is open, and wanders. In a fault-free stage that is at most a percent,
//! in a faulty one up to twelve, as in real machines; in one without a fault more than a few percent is something that no catalogue lists. Everything follows from seeds.

mod plain_law;
mod strange;

use crate::battery::draws::{Draw, Question};
use crate::battery::stage::plain_law::{PLAIN, PlainLaw, plain_law};
use crate::battery::stage::strange::{STRANGERS, Strange};
use crate::battery::{Case, CaseKind, Label, TrueFault, truth, unmeasured};
use govtwin_diagnosis::generate::spread;
use govtwin_diagnosis::generate::streams::GeneratedStreams;
use govtwin_model::effects::{Stage, find};
use govtwin_model::frame::{EsvState, Frame, Inputs, Signals};
use govtwin_model::parameters::{EffectSetting, Unit};
use govtwin_model::twin::{Cut, Twin};

/// Effects that a stage may have, with a data sheet and without one: its sign, scale and zero mean something only there.
const EFFECTS: [&str; 12] = [
    "port_asymmetry",
    "port_wear",
    "valve_lag",
    "flow_saturation",
    "backlash",
    "servo_friction",
    "servo_leak",
    "cushion",
    "load",
    "supply_loss",
    "return_loss",
    "feedback_lag",
];
/// Effects besides where there is a data sheet.
const WITH_SHEET: [&str; 4] = ["port_overlap", "lvdt_gain", "lvdt_bias", "feedback_bias"];
/// How kinds follow each other.
const PATTERN: [&str; 12] = [
    "sound", "single", "single", "stranger", "sound", "single", "pair", "left_out", "sound", "single", "stranger",
    "single",
];
/// Simulated steps between two rows.
const STEPS: i64 = 10;
/// Periods of rows, ms.
const PERIODS_MS: [i64; 5] = [10, 20, 50, 100, 200];
/// Rows of a recording, and its length in s.
const ROWS: (f64, f64) = (900.0, 3000.0);
const LENGTH_S: (f64, f64) = (30.0, 200.0);
/// Error of the law of a fault-free stage and of a faulty one, as a share of the speed.
const LAW_ERRORS: [(f64, f64); 2] = [(0.001, 0.01), (0.001, 0.12)];
/// By how much effects are larger than those of whole chains: a stage alone is looked at where it is known to be off.
const LARGER: (f64, f64) = (1.0, 3.0);
/// How much of it wanders with time, and in what time, s.
const WANDERS: (f64, f64) = (1.0, 10.0);

/// The first `count` stages of a seed's battery, all diagnosed with a data sheet or all without.
pub fn plan(count: usize, seed: u64, with_sheet: bool) -> Vec<Case> {
    let mut draw = Draw::new(seed, Question::Plan, 2);
    let known: Vec<&str> = EFFECTS.iter().chain(WITH_SHEET.iter().filter(|_| with_sheet)).copied().collect();
    let (mut effects, mut strangers) = (Vec::new(), Vec::new());
    let next = |from: &[&'static str], deck: &mut Vec<&'static str>, draw: &mut Draw| -> String {
        if deck.is_empty() {
            deck.extend(from);
            draw.shuffle(deck);
        }
        deck.pop().unwrap_or_default().to_owned()
    };
    let of_strangers = STRANGERS.map(|(id, ..)| id);
    let known: Vec<&'static str> = known.into_iter().filter_map(|id| find(id).map(|spec| spec.id)).collect();
    (0..count)
        .map(|place| {
            let kind = match PATTERN[place % PATTERN.len()] {
                "sound" => CaseKind::Sound,
                "stranger" => CaseKind::Stranger(next(&of_strangers, &mut strangers, &mut draw)),
                "left_out" => CaseKind::LeftOut(next(&known, &mut effects, &mut draw)),
                "pair" => {
                    let first = next(&known, &mut effects, &mut draw);
                    let second = loop {
                        let other = known[draw.below(known.len())];
                        if other != first {
                            break other.to_owned();
                        }
                    };
                    CaseKind::Pair(first, second)
                }
                _ => CaseKind::Single(next(&known, &mut effects, &mut draw)),
            };
            let period_ms = PERIODS_MS[draw.below(PERIODS_MS.len())];
            Case {
                name: format!("case_{:03}", place + 1),
                kind,
                rate_hz: 1e3 / period_ms as f64,
                rich: false,
                mismatch: 1.0,
                seed: draw.seed(),
                alone: Some(with_sheet),
            }
        })
        .collect()
}

/// What is in a stage.
pub(super) fn label(unit: &Unit, case: &Case) -> Label {
    unmeasured(case, StageRig::new(unit, case).effects)
}

/// Its only recording.
pub(super) fn record(unit: &Unit, case: &Case) -> GeneratedStreams {
    StageRig::new(unit, case).record()
}

/// A stage and whoever moves its spool.
struct StageRig {
    unit: Unit,
    plain: Option<PlainLaw>,
    stranger: Option<(String, f64)>,
    effects: Vec<TrueFault>,
    /// Waves of the error of law: size, turns over the spool's range, phase.
    law_error: [[f64; 3]; 3],
    /// Share by which the speed wanders.
    wanders: f64,
    farthest_pu: f64,
    dwell_s: f64,
    noise_pu: [f64; 2],
    /// Scale and offset of both channels as they are recorded.
    recorded: [[f64; 2]; 2],
    period_ns: i64,
    seed: u64,
}

impl StageRig {
    fn new(sheet: &Unit, case: &Case) -> Self {
        let with_sheet = case.alone == Some(true);
        let mut draw = Draw::new(case.seed, Question::Mismatch, 1);
        let mut base = sheet.clone();
        base.effects.clear();
        let mut unit = if with_sheet { spread(&base, case.seed) } else { alike(&base, &mut draw) };
        let mut sizes = Draw::new(case.seed, Question::Size, 1);
        let (mut effects, mut stranger) = (Vec::new(), None);
        for id in case.kind.ids() {
            if let Some((id, [low, high], of, meaning)) = STRANGERS.into_iter().find(|one| one.0 == id) {
                let size = sizes.log_between(low, high);
                stranger = Some((id.to_owned(), size));
                effects.push(TrueFault {
                    id: id.to_owned(),
                    stage: Stage::Servomotor,
                    size,
                    unit: of.to_owned(),
                    meaning: meaning.to_owned(),
                });
            } else {
                let larger = sizes.log_between(LARGER.0, LARGER.1);
                effects.extend(truth(id, &mut sizes, &unit.parameters).map(|truth| enlarged(truth, larger, &unit)));
            }
        }
        let in_plain_law = effects.iter().all(|truth| stranger.is_some() || PLAIN.contains(&truth.id.as_str()));
        let plain = (!with_sheet && in_plain_law && draw.chance(0.5)).then(|| plain_law(&effects, &mut draw));
        for truth in effects.iter().filter(|_| stranger.is_none()) {
            let Some(spec) = find(&truth.id) else { continue };
            let mut values: Vec<f64> = spec.parameters.iter().map(|one| one.on(&unit.parameters).typical).collect();
            values[0] = truth.size;
            unit.effects.push(EffectSetting { id: truth.id.clone(), values });
        }
        let (least, most) = LAW_ERRORS[usize::from(!matches!(case.kind, CaseKind::Sound | CaseKind::Stranger(_)))];
        let drawn = draw.log_between(least, most);
        let error = stranger.as_ref().filter(|(id, _)| id == "odd_law").map_or(drawn, |(_, size)| *size);
        let wave = |turns: f64, draw: &mut Draw| {
            [error * draw.normal(), turns * draw.between(0.7, 1.3), draw.between(0.0, std::f64::consts::TAU)]
        };
        let law_error = [0.5, 1.0, 2.0].map(|turns| wave(turns, &mut draw));
        let mut reading = |scales: (f64, f64)| {
            let scale = draw.log_between(scales.0, scales.1) * if draw.chance(0.3) { -1.0 } else { 1.0 };
            [scale, scale * draw.between(-1.0, 1.0)]
        };
        let readings = [reading((0.5, 100.0)), reading((1.0, 1000.0))];
        #[expect(clippy::cast_possible_truncation, reason = "a period in ms")]
        let period_ns = (1e3 / case.rate_hz).round() as i64 * 1_000_000;
        Self {
            unit,
            plain,
            stranger,
            effects,
            law_error,
            wanders: WANDERS.0 * drawn,
            farthest_pu: draw.log_between(0.35, 0.95),
            dwell_s: draw.log_between(1.5, 6.0),
            noise_pu: [draw.log_between(1e-4, 1e-3), draw.log_between(5e-5, 1e-3)],
            recorded: if with_sheet { [[1.0, 0.0]; 2] } else { readings },
            period_ns,
            seed: case.seed,
        }
    }

    /// The share by which the law is off at a position of the spool.
    fn off(&self, spool_pu: f64) -> f64 {
        self.law_error
            .iter()
            .map(|[size, turns, phase]| size * (std::f64::consts::TAU * turns * spool_pu.abs() + phase).sin())
            .sum()
    }

    fn record(&self) -> GeneratedStreams {
        let mut draw = Draw::new(self.seed, Question::Time, 1);
        let step_ns = self.period_ns / STEPS;
        let step_s = step_ns as f64 * 1e-9;
        let rate_hz = 1e9 / self.period_ns as f64;
        let rows = draw.between(ROWS.0, ROWS.1).clamp(LENGTH_S.0 * rate_hz, LENGTH_S.1 * rate_hz);
        let mut twin = Twin::new(&self.unit).with_cut(Cut::Spool);
        let mut plain = self.plain;
        let mut spool = MovedSpool { position_pu: 0.0, target_pu: 0.0, until_s: 0.0 };
        let mut strange = Strange::new(self.stranger.as_ref(), &mut draw);
        let mut opening = draw.between(0.35, 0.65);
        let mut before = f64::NAN;
        let (mut wandered, keeps) = (0.0, (-step_s / WANDERS.1).exp());
        let mut streams = GeneratedStreams::default();
        #[expect(clippy::cast_possible_truncation, reason = "a number of rows")]
        for step in 0..rows as i64 * STEPS {
            let time_s = step as f64 * step_s;
            spool.go(self, opening, time_s, step_s, &mut draw);
            let seen = strange.spool_of(spool.position_pu);
            let speed = if let Some(law) = &mut plain {
                law.speed(seen, step_s)
            } else {
                let mut measured = Signals { spool_position_pu: seen, ..Signals::NONE };
                if step == 0 {
                    (measured.servomotor_position_pu, before) = (opening, opening);
                }
                let inputs = Inputs {
                    opening_command_pu: f64::NAN,
                    esv: EsvState::Normal,
                    tank_pressure_pa: f64::NAN,
                    piston_force_n: 0.0,
                };
                let said = twin.step(&Frame { time_ns: step * step_ns, inputs, measured });
                let now = said.signals.servomotor_position_pu;
                let speed = (now - before) / step_s;
                before = now;
                speed
            };
            wandered = keeps * wandered + (1.0 - keeps * keeps).sqrt() * self.wanders * draw.normal();
            let speed = speed * (1.0 + self.off(seen) + wandered) * strange.factor(opening, time_s, step_s, &mut draw);
            opening = (opening + step_s * speed).clamp(0.0, 1.0);
            if step % STEPS == 0 {
                let [spool_noise, noise] = self.noise_pu.map(|size| size * draw.normal());
                let read = |value: f64, [scale, offset]: [f64; 2]| value * scale + offset;
                let shown = ((opening + strange.sway(time_s) + noise) * 4096.0).round() / 4096.0;
                let measured = Signals {
                    spool_position_pu: read(spool.position_pu + spool_noise, self.recorded[0]),
                    servomotor_position_pu: read(shown, self.recorded[1]),
                    ..Signals::NONE
                };
                streams.servo_state.push((step * step_ns, measured));
            }
        }
        streams
    }
}

/// The same fault, so many times as far from neutral, within its range.
fn enlarged(mut truth: TrueFault, factor: f64, unit: &Unit) -> TrueFault {
    if let Some(first) = find(&truth.id).and_then(|spec| spec.parameters.first()) {
        let first = first.on(&unit.parameters);
        truth.size = (first.neutral + factor * (truth.size - first.neutral)).clamp(first.min, first.max);
    }
    truth
}

/// A stage alike both ways, of some speed and overlap.
fn alike(sheet: &Unit, draw: &mut Draw) -> Unit {
    let mut unit = sheet.clone();
    let oil = unit.parameters.oil;
    let servo = &mut unit.parameters.servomotor;
    servo.load_closed_n = 0.3 * oil.tank_pressure_pa * servo.opening_area_m2;
    servo.load_slope_n = 0.0;
    servo.closing_area_m2 =
        servo.opening_area_m2 - 2.0 * servo.load_closed_n / (oil.tank_pressure_pa + oil.return_pressure_pa);
    let valve = &mut unit.parameters.distributing_valve;
    valve.stroke_max_m = -valve.stroke_min_m;
    unit.parameters.main_ports.width_m *= draw.log_between(0.5, 3.0);
    unit.parameters.main_ports.overlap_m = valve.reference_stroke_m * draw.log_between(0.01, 0.12);
    unit
}

/// Somebody's spool.
struct MovedSpool {
    position_pu: f64,
    target_pu: f64,
    until_s: f64,
}

impl MovedSpool {
    /// On to where it is wanted: away from an end that is near, sometimes to rest.
    fn go(&mut self, rig: &StageRig, opening: f64, time_s: f64, step_s: f64, draw: &mut Draw) {
        if time_s >= self.until_s {
            let size = rig.farthest_pu * draw.between(0.05, 1.0);
            let up = opening < 0.3 || (opening <= 0.7 && draw.chance(0.5));
            self.target_pu = if draw.chance(0.15) { 0.0 } else { size * if up { 1.0 } else { -1.0 } };
            self.until_s = time_s + rig.dwell_s * draw.between(0.4, 1.6);
        }
        if (opening > 0.9 && self.target_pu > 0.0) || (opening < 0.1 && self.target_pu < 0.0) {
            self.target_pu *= -0.5;
        }
        self.position_pu += (self.target_pu - self.position_pu) * (1.0 - (-step_s / 0.3).exp());
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use govtwin_model::params::reference;

    #[test]
    fn stages_move_and_a_seed_makes_the_same_ones() {
        let unit = reference();
        for with_sheet in [false, true] {
            let cases = plan(24, 5, with_sheet);
            assert_eq!(cases, plan(24, 5, with_sheet));
            for case in &cases[..8] {
                let rows = record(&unit, case).servo_state;
                let travel = |of: fn(&Signals) -> f64| {
                    let values = rows.iter().map(|(_, signals)| of(signals));
                    let (low, high) = values.fold((f64::MAX, f64::MIN), |(low, high), v| (low.min(v), high.max(v)));
                    high - low
                };
                assert!(rows.len() >= 150, "{case:?}: {}", rows.len());
                assert!(travel(|one| one.servomotor_position_pu) > 0.1 && travel(|one| one.spool_position_pu) > 0.1);
                let label = label(&unit, case);
                assert_eq!(label.effects.len(), case.kind.ids().len(), "{case:?}");
            }
            assert!(cases.iter().any(|case| matches!(case.kind, CaseKind::Stranger(_))));
        }
    }
}
