//! What it would help most to know: how much sharper each fault would show if an item of the plate were known.
//!
//! Faults and tolerances are compared as signatures: whitened differences of generated recordings of the four processes. A fault of typical
//! size with signature `s` shows with `d² = sᵀ (1 + J Jᵀ)⁻¹ s` standard deviations squared, `J` holding the signatures of all tolerances, one
//! standard deviation each: what a tolerance can imitate does not count (the likelihood ratio of a linear Gaussian model; Kay 1998,
//! *Detection Theory*, section 5.3). Knowing an item takes its columns out of `J`.

use nalgebra::{DMatrix, DVector};

use super::Plate;
use super::item::{ITEMS, PlateItem};
use crate::estimation::coordinate::{Residuals, subject_at};
use crate::generate::{Scenario, recording};
use crate::identification::free_parameter::FreeParameter;
use crate::likelihood::noise::expected;
use crate::likelihood::prepared::PreparedRecording;
use crate::likelihood::problem::Problem;
use crate::likelihood::whitener::independent_share;
use govtwin_model::effects::CATALOGUE;
use govtwin_model::parameters::{ENTRIES, EffectSetting, Unit};
use govtwin_model::recording::Process;

/// Rate and length of the generated recordings.
const RATE_HZ: f64 = 20.0;
const DURATION_S: f64 = 40.0;
/// Positions of the tolerances at which signatures are taken, standard deviations.
const STEP: f64 = 0.5;
/// A fault shows from so many standard deviations on.
const SHOWS: f64 = 3.0;
/// Knowing an item helps a fault where it shows sharper by this ratio.
const HELPS: f64 = 1.15;

/// How a fault of typical size shows.
#[derive(Clone, Debug, PartialEq)]
pub struct Shows {
    /// The fault, an id of the catalogue.
    pub effect: &'static str,
    /// Its separation with this sheet, in standard deviations.
    pub with_sheet_ratio: f64,
    /// The same if every parameter were known, 1.
    pub at_best_ratio: f64,
}

/// What an item would help.
#[derive(Clone, Debug, PartialEq)]
pub struct Help {
    /// The item's key.
    pub item: &'static PlateItem,
    /// Sum over all faults of the logarithm of how much sharper they show, 1.
    pub gain: f64,
    /// The faults that it helps most, with the ratio.
    pub effects: Vec<(&'static str, f64)>,
}

impl PartialEq for PlateItem {
    fn eq(&self, other: &Self) -> bool {
        self.key == other.key
    }
}

/// What matters of a sheet.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Matter {
    /// The items that the plate does not state, the most helpful first.
    pub missing: Vec<Help>,
    /// Every fault, the hardest to see first.
    pub faults: Vec<Shows>,
}

impl Matter {
    /// Faults of typical size that the sheet's tolerances hide, though they would show if all were known.
    pub fn hidden(&self) -> impl Iterator<Item = &Shows> {
        self.faults.iter().filter(|fault| fault.with_sheet_ratio < SHOWS && fault.at_best_ratio >= SHOWS)
    }
}

/// Finds what matters of a unit derived from a plate; `seed` decides the generated recordings.
pub fn matter(unit: &Unit, plate: &Plate, seed: u64, on_progress: &dyn Fn()) -> Matter {
    let of = |process: Process| {
        let scenario =
            Scenario { unit: unit.clone(), process, rate_hz: RATE_HZ, duration_s: DURATION_S, rich: false, seed };
        PreparedRecording::new(recording(&scenario))
    };
    let recordings: Vec<PreparedRecording> = Process::ALL.into_iter().map(of).collect();
    let period_s = 1.0 / RATE_HZ;
    let problem = Problem::new(recordings, unit, &expected(&unit.sensors));
    on_progress();
    let free_parameters = FreeParameter::nuisances(unit);
    let faults: Vec<(&'static str, Unit)> = CATALOGUE.iter().map(|spec| (spec.id, with(unit, spec))).collect();
    let mut units = vec![unit.clone()];
    for place in 0..free_parameters.len() {
        let mut positions = vec![0.0; free_parameters.len()];
        positions[place] = STEP;
        units.push(subject_at(unit, &free_parameters, &positions));
    }
    units.extend(faults.iter().map(|(_, unit)| unit.clone()));
    let mut columns: Vec<DVector<f64>> = vec![];
    for some in units.chunks(16) {
        columns.extend(problem.residuals_of(some).iter().map(flat));
        on_progress();
    }
    let Some((base, rest)) = columns.split_first() else { return Matter::default() };
    let (moved, faulty) = rest.split_at(free_parameters.len());
    let weight = independent_share(period_s).sqrt();
    let signatures: Vec<DVector<f64>> = moved.iter().map(|column| (column - base) * (weight / STEP)).collect();
    let faulty: Vec<DVector<f64>> = faulty.iter().map(|column| (column - base) * weight).collect();
    let gram = |columns: &[DVector<f64>], others: &[DVector<f64>]| {
        DMatrix::from_fn(columns.len(), others.len(), |i, k| columns[i].dot(&others[k]))
    };
    let (inner, across) = (gram(&signatures, &signatures), gram(&signatures, &faulty));
    // How sharply every fault shows with these tolerances left.
    let sharpness = |left: &[usize]| -> Vec<f64> {
        let n = left.len();
        let information = DMatrix::from_fn(n, n, |i, k| inner[(left[i], left[k])] + f64::from(u8::from(i == k)));
        let cholesky = information.cholesky();
        let of = |fault: usize| {
            let square = faulty[fault].norm_squared();
            let b = DVector::from_fn(n, |i, _| across[(left[i], fault)]);
            let hidden = cholesky.as_ref().map_or(0.0, |cholesky| b.dot(&cholesky.solve(&b)));
            (square - hidden).max(0.0).sqrt()
        };
        (0..faulty.len()).map(of).collect()
    };
    let all: Vec<usize> = (0..free_parameters.len()).collect();
    let (with_sheet, at_best) = (sharpness(&all), sharpness(&[]));
    let key = |place: usize| match free_parameters[place] {
        FreeParameter::Parameter { index, .. } => ENTRIES[index].key,
        _ => "",
    };
    let known = |key: &str| plate.values.contains_key(key);
    let settled = |item: &PlateItem| item.settles.iter().any(|settled| all.iter().any(|place| key(*place) == *settled));
    let helps = ITEMS.iter().filter(|item| !known(item.key) && settled(item)).map(|item| {
        let left: Vec<usize> = all.iter().copied().filter(|place| !item.settles.contains(&key(*place))).collect();
        let ratios: Vec<f64> = sharpness(&left)
            .iter()
            .zip(&with_sheet)
            .map(|(with, without)| (with.max(1e-3) / without.max(1e-3)).max(1.0))
            .collect();
        // A fault that is not detectable in any case does not count.
        let counts = |fault: &usize| at_best[*fault] >= SHOWS;
        let gain = (0..ratios.len()).filter(counts).map(|fault| ratios[fault].min(20.0).ln()).sum();
        let mut effects: Vec<(&'static str, f64)> = (0..ratios.len())
            .filter(counts)
            .filter(|fault| ratios[*fault] > HELPS)
            .map(|fault| (faults[fault].0, ratios[fault]))
            .collect();
        effects.sort_by(|a, b| b.1.total_cmp(&a.1));
        Help { item, gain, effects }
    });
    let mut missing: Vec<Help> = helps.collect();
    missing.sort_by(|a, b| b.gain.total_cmp(&a.gain));
    let shows = |fault: usize| Shows {
        effect: faults[fault].0,
        with_sheet_ratio: with_sheet[fault],
        at_best_ratio: at_best[fault],
    };
    let mut faults: Vec<Shows> = (0..faults.len()).map(shows).collect();
    faults.sort_by(|a, b| a.with_sheet_ratio.total_cmp(&b.with_sheet_ratio));
    Matter { missing, faults }
}

/// How often [`matter`] calls for progress, about.
pub const PARTS: usize = 7;

/// The unit with an effect of typical size.
fn with(unit: &Unit, spec: &govtwin_model::effects::EffectSpec) -> Unit {
    let mut unit = unit.clone();
    let values = spec.parameters.iter().map(|parameter| parameter.on(&unit.parameters).typical).collect();
    unit.effects.push(EffectSetting { id: spec.id.to_owned(), values });
    unit
}

fn flat(residuals: &Residuals) -> DVector<f64> {
    let all = residuals
        .iter()
        .flat_map(|recording| recording.iter().map(|residual| if residual.is_finite() { *residual } else { 0.0 }));
    DVector::from_iterator(residuals.iter().map(DVector::len).sum(), all)
}
