//! Synthetic recordings of the servomotor stage alone: a script moves the spool, the twin answers, transducers add noise.

use govtwin_diagnosis::result::{Diagnosis, Setup};
use govtwin_diagnosis::{DiagnosisSettings, diagnose};
use govtwin_model::frame::{EsvState, Frame, Inputs, Signals};
use govtwin_model::parameters::{EffectSetting, Unit};
use govtwin_model::params::reference;
use govtwin_model::recording::Recording;
use govtwin_model::twin::{Cut, Twin};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// A diagnosis of a stage of which nothing but these recordings is known.
pub fn freely(recordings: Vec<Recording>) -> Diagnosis {
    let settings = DiagnosisSettings { setup: Setup::StageFree, ..DiagnosisSettings::default() };
    diagnose(recordings, &reference(), &settings, &|_, _| ()).unwrap()
}

/// How somebody moves the spool.
pub struct Spool {
    pub seed: u64,
    /// Greatest position, pu.
    pub farthest_pu: f64,
    /// Time between changes of mind, s.
    pub dwell_s: f64,
}

impl Spool {
    pub fn usual(seed: u64) -> Self {
        Self { seed, farthest_pu: 0.9, dwell_s: 3.0 }
    }

    /// Where it goes next at an opening: away from an end that is near, sometimes to rest.
    pub fn target(&self, opening: f64, random: &mut ChaCha8Rng) -> f64 {
        let size = self.farthest_pu * random.random_range(0.05_f64..1.0);
        let up = if opening > 0.7 {
            false
        } else if opening < 0.3 {
            true
        } else {
            random.random_bool(0.5)
        };
        if random.random_bool(0.15) {
            0.0
        } else if up {
            size
        } else {
            -size
        }
    }
}

/// The unit with an effect.
pub fn with(mut unit: Unit, id: &str, values: &[f64]) -> Unit {
    unit.effects.push(EffectSetting { id: id.to_owned(), values: values.to_vec() });
    unit
}

/// A unit whose servomotor moves alike both ways: areas and load balance, and the load is constant.
pub fn symmetric(unit: &Unit) -> Unit {
    let mut unit = unit.clone();
    let oil = unit.parameters.oil;
    let servo = &mut unit.parameters.servomotor;
    servo.load_closed_n = 0.3 * oil.tank_pressure_pa * servo.opening_area_m2;
    servo.load_slope_n = 0.0;
    servo.closing_area_m2 =
        servo.opening_area_m2 - 2.0 * servo.load_closed_n / (oil.tank_pressure_pa + oil.return_pressure_pa);
    unit.parameters.distributing_valve.stroke_max_m = 0.015;
    unit
}

/// A recording of so many samples: the spool wanders between random positions and turns back before the ends of the stroke.
pub fn record(unit: &Unit, spool: &Spool, rate_hz: f64, samples: i64) -> Recording {
    let mut random = ChaCha8Rng::seed_from_u64(spool.seed);
    let mut noise = ChaCha8Rng::seed_from_u64(spool.seed ^ 0xA5);
    let mut normal = move || (0..12).map(|_| noise.random_range(-0.5..0.5)).sum::<f64>();
    let mut twin = Twin::new(unit).with_cut(Cut::Spool);
    let period_ns = (1e9 / rate_hz) as i64;
    let (mut position, mut target, mut until) = (0.0, 0.0, 0);
    let mut opening = 0.4;
    let mut frames = Vec::new();
    for k in 0..samples {
        let time_ns = k * period_ns;
        if time_ns >= until {
            target = spool.target(opening, &mut random);
            until = time_ns + (spool.dwell_s * random.random_range(0.4..1.6) * 1e9) as i64;
        }
        if (opening > 0.9 && target > 0.0) || (opening < 0.1 && target < 0.0) {
            target *= -0.5;
        }
        position += (target - position) * (1.0 - (-1.0 / (0.3 * rate_hz)).exp());
        let inputs = Inputs {
            opening_command_pu: f64::NAN,
            esv: EsvState::Normal,
            tank_pressure_pa: f64::NAN,
            piston_force_n: 0.0,
        };
        let mut measured = Signals { spool_position_pu: position, ..Signals::NONE };
        if k == 0 {
            measured.servomotor_position_pu = opening;
        }
        opening = twin.step(&Frame { time_ns, inputs, measured }).signals.servomotor_position_pu;
        measured.servomotor_position_pu = ((opening + 3.0e-4 * normal()) * 4096.0).round() / 4096.0;
        measured.spool_position_pu = position + 3.0e-4 * normal();
        frames.push(Frame { time_ns, inputs, measured });
    }
    Recording::new("stage", frames)
}
