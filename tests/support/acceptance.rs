//! Generated units and their recordings for acceptance measures, and what the true unit measures without transducers.

use govtwin_diagnosis::acceptance::series::Series;
use govtwin_diagnosis::acceptance::{Measures, measure};
use govtwin_diagnosis::generate::{self, Scenario};
use govtwin_model::parameters::{EffectSetting, Unit};
use govtwin_model::params;
use govtwin_model::recording::{Process, Recording};
use govtwin_model::replay::simulate;
use govtwin_model::twin::Twin;

pub fn unit(seed: u64, effects: &[(&str, &[f64])]) -> Unit {
    let mut unit = generate::spread(&params::reference(), seed);
    let setting = |(id, values): &(&str, &[f64])| EffectSetting { id: (*id).to_owned(), values: values.to_vec() };
    unit.effects = effects.iter().map(setting).collect();
    unit
}

/// The four processes of a minute each.
pub fn recordings(unit: &Unit, seed: u64, rate_hz: f64) -> Vec<Recording> {
    let of = |process| Scenario { unit: unit.clone(), process, rate_hz, duration_s: 60.0, rich: false, seed };
    Process::ALL.into_iter().map(|process| generate::recording(&of(process))).collect()
}

pub fn measured(recordings: &[Recording]) -> Measures {
    measure(&recordings.iter().filter_map(Series::measured).collect::<Vec<_>>())
}

/// The true unit along the same recordings, without transducers.
pub fn true_measures(unit: &Unit, recordings: &[Recording]) -> Measures {
    let along = |recording: &Recording| Series::simulated(recording, &simulate(&mut Twin::new(unit), recording));
    measure(&recordings.iter().filter_map(along).collect::<Vec<_>>())
}
