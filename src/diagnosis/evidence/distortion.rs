//! Distortion tests: whether what a fitted model leaves of a signal stands out somewhere, by time, position, speed or frequency.
//!
//! Each test is a weighted sum of a signal's innovations, `z = ℓᵀ r`. Where the model is right but for errors of its equations and laws,
//! `r = (I − H)(n + M w)` with noise n, the marks M of these errors, `w ~ N(0, κ²)`, and the hat matrix `H = J (JᵀJ + P)⁻¹ Jᵀ` of the fit: z is Gaussian with
//! a variance that follows without any simulation (Cook & Weisberg 1982, *Residuals and Influence in Regression*, chapter 2). Of all tests the most extreme
//! one counts, its probability multiplied by how many there are (Bonferroni).
//!
//! The noise is that of the likelihood: what a model gets wrong stays alike over several samples, of which one counts. A residual is weighed by the root
//! of that share, so a sum of n residuals has the variance n. No plant is its twin: tests that took each sample for itself reject every twin.

use std::ops::Range;

use nalgebra::{Cholesky, DMatrix, DVector};
use serde::{Deserialize, Serialize};
use statrs::distribution::{ContinuousCDF, Normal};

use super::law_error::{LAW_ERROR, limits};
use super::{ExtendedEquations, Shared};
use crate::likelihood::prepared::PreparedRecording;
use crate::likelihood::problem::Problem;
use crate::model::FittedModel;
use govtwin_model::signal::Signal;
use govtwin_model::stored::figure;

/// Cells that tests by time are made of, s: half of the time over which errors of equations stay alike.
const CELL_S: f64 = 0.1;

/// Highest frequency that is looked at, Hz.
const HIGHEST_HZ: f64 = 2.0;

/// Bins of a position or a speed, over what the recordings show of it.
const BINS: usize = 24;

/// Speed below which a servomotor or spool stands, pu/s.
const STANDING_PU_S: f64 = 1e-3;

/// Fewest samples that a test sums up.
const FEWEST: f64 = 8.0;

/// What a test goes by.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", tag = "by")]
pub enum Place {
    /// A time of one recording.
    Time {
        /// Its name.
        recording: String,
        /// From its start, s.
        from_s: f64,
        /// The same, s.
        to_s: f64,
    },
    /// A range of a measured position, while it rises, falls or stands.
    Position {
        /// Of what.
        of: Signal,
        /// Lower end, pu.
        from_pu: f64,
        /// Upper end, pu.
        to_pu: f64,
        /// 1 while it rises, −1 while it falls, 0 while it stands.
        direction: i8,
    },
    /// A range of the servomotor's speed.
    Speed {
        /// Lower end, pu/s.
        from_pu_s: f64,
        /// Upper end, pu/s.
        to_pu_s: f64,
    },
    /// An oscillation through one recording.
    Frequency {
        /// Its name.
        recording: String,
        /// How fast, Hz.
        hz: f64,
    },
}

/// The strongest distortion of all.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Distortion {
    /// Of which signal.
    pub signal: Signal,
    /// Where it stands out.
    #[serde(flatten)]
    pub place: Place,
    /// By how many standard deviations.
    #[serde(deserialize_with = "figure")]
    pub deviations: f64,
    /// Probability that the most extreme of all tests is as extreme by chance.
    #[serde(deserialize_with = "figure")]
    pub p_value: f64,
}

impl Distortion {
    /// What stands out, where and how much.
    pub fn words(&self) -> String {
        let place = match &self.place {
            Place::Time { recording, from_s, to_s } => format!("from {from_s:.1} to {to_s:.1} s of {recording}"),
            Place::Position { of, from_pu, to_pu, direction } => {
                let moves = match direction {
                    1 => "rises",
                    0 => "stands",
                    _ => "falls",
                };
                format!("where the {} {moves} between {from_pu:.3} and {to_pu:.3} pu", of.title().to_lowercase())
            }
            Place::Speed { from_pu_s, to_pu_s } => {
                format!("where the servomotor moves at {from_pu_s:.3} to {to_pu_s:.3} pu/s")
            }
            Place::Frequency { recording, hz } => format!("as an oscillation of {hz:.2} Hz in {recording}"),
        };
        format!("{} {place}, by {:.1} standard deviations", self.signal.title().to_lowercase(), self.deviations.abs())
    }
}

/// Sums over the rows of a test: of the residuals, of the noise, and along the free parameters and the errors of equations and laws.
#[derive(Clone, Debug)]
struct Sums {
    samples: f64,
    residual: f64,
    noise: f64,
    slopes: DVector<f64>,
    marks: DVector<f64>,
}

impl Sums {
    fn zeros(slopes: usize, marks: usize) -> Self {
        let zeros = DVector::zeros;
        Self { samples: 0.0, residual: 0.0, noise: 0.0, slopes: zeros(slopes), marks: zeros(marks) }
    }

    /// Adds another's, weighted.
    fn add(&mut self, other: &Self, weight: f64) {
        self.samples += other.samples;
        self.residual += weight * other.residual;
        self.noise += weight * weight * other.noise;
        self.slopes.axpy(weight, &other.slopes, 1.0);
        self.marks.axpy(weight, &other.marks, 1.0);
    }
}

/// The innovations of a model in one recording, with slopes and marks.
struct Rows<'a> {
    data: &'a PreparedRecording,
    residuals: &'a DVector<f64>,
    slopes: &'a DMatrix<f64>,
    marks: [&'a DMatrix<f64>; 2],
}

impl Rows<'_> {
    /// Adds a sample of a signal.
    fn add(&self, sums: &mut Sums, signal: usize, sample: usize) {
        let row = self.data.residual(signal, sample);
        sums.samples += 1.0;
        sums.residual += self.residuals[row];
        sums.noise += 1.0;
        for (sum, slope) in sums.slopes.iter_mut().zip(self.slopes.row(row).iter()) {
            *sum += slope;
        }
        let [terms, laws] = self.marks;
        for (sum, k) in sums.marks.iter_mut().zip(0..) {
            *sum += if k < terms.ncols() { terms[(row, k)] } else { laws[(row, k - terms.ncols())] };
        }
    }
}

/// The variance of tests by a fit's normal equations.
struct Calibration {
    inverse: DMatrix<f64>,
    squares: DMatrix<f64>,
    marked: DMatrix<f64>,
    sizes: DVector<f64>,
}

impl Calibration {
    fn new(normal: &ExtendedEquations, sizes: (f64, f64)) -> Option<Self> {
        let (n, b) = (normal.slopes(), normal.terms);
        let rest = normal.gradient.len() - n;
        let squares = normal.fit.parts.iter().fold(DMatrix::zeros(n, n), |sum, part| sum + &part.hessian);
        let mut inverse = Cholesky::new(normal.hessian.view((0, 0), (n, n)).into_owned())?.inverse();
        // A parameter that is held has slopes and does not follow them.
        for &held in &normal.fit.held {
            inverse.row_mut(held).fill(0.0);
            inverse.column_mut(held).fill(0.0);
        }
        Some(Self {
            inverse,
            squares,
            marked: normal.hessian.view((n, 0), (rest, n)).into_owned(),
            sizes: DVector::from_fn(rest, |k, _| if k < b { sizes.0 } else { sizes.1 }),
        })
    }

    /// By how many standard deviations a sum is off.
    fn deviations(&self, sums: &Sums) -> f64 {
        let follow = &self.inverse * &sums.slopes;
        let noise = sums.noise - 2.0 * follow.dot(&sums.slopes) + follow.dot(&(&self.squares * &follow));
        let errors = (&sums.marks - &self.marked * &follow).component_mul(&self.sizes).norm_squared();
        sums.residual / (noise.max(1e-3 * sums.noise) + errors).max(f64::MIN_POSITIVE).sqrt()
    }
}

impl Shared {
    /// The strongest distortion that a fitted model leaves, its equations as wrong as is likeliest, its laws as usual; none where nothing can be tested.
    pub fn distortion(&self, problem: &Problem, model: &FittedModel) -> Option<Distortion> {
        let equations = self.extended(model);
        let laws: Vec<DMatrix<f64>> = {
            let limits = limits(model, self.without_effects);
            (0..problem.recordings.len()).map(|recording| self.modulations.marks(model, recording, &limits)).collect()
        };
        let rows: Vec<Rows<'_>> = (problem.recordings.iter().enumerate())
            .map(|(k, data)| Rows {
                data,
                residuals: &model.fit.residuals[k],
                slopes: &model.fit.slopes[k],
                marks: [&self.columns.marks[k], &laws[k]],
            })
            .collect();
        let calibration = Calibration::new(&equations, (equations.likeliest_kappa(LAW_ERROR), LAW_ERROR))?;
        let zeros = Sums::zeros(equations.slopes(), equations.gradient.len() - equations.slopes());
        let mut strongest: Option<(f64, Signal, Place)> = None;
        let mut count = 0.0;
        let mut test = |sums: &Sums, signal: Signal, place: &dyn Fn() -> Place| {
            if sums.samples < FEWEST {
                return;
            }
            count += 1.0;
            let off = calibration.deviations(sums);
            if strongest.as_ref().is_none_or(|(most, ..)| off.abs() > most.abs()) {
                strongest = Some((off, signal, place()));
            }
        };
        for signal in Signal::ALL {
            for rows in &rows {
                by_time(rows, signal, &zeros, &mut test);
            }
        }
        by_state(&rows, &zeros, &mut test);
        let (deviations, signal, place) = strongest?;
        let tail = Normal::standard().sf(deviations.abs());
        Some(Distortion { signal, place, deviations, p_value: (2.0 * count * tail).min(1.0) })
    }
}

/// Tests by time, in windows of a cell and of each twice as many, half overlapping, and by frequency.
fn by_time(rows: &Rows<'_>, signal: Signal, zeros: &Sums, test: &mut impl FnMut(&Sums, Signal, &dyn Fn() -> Place)) {
    let Some(place) = rows.data.place(signal) else { return };
    let measured = rows.data.measured(signal);
    let time_s: Vec<f64> = (0..measured.len()).map(|sample| rows.data.time_s(sample)).collect();
    let mut cells: Vec<(Range<f64>, Sums)> = Vec::new();
    for (sample, time_s) in time_s.iter().copied().enumerate().filter(|(sample, _)| measured[*sample].is_finite()) {
        if cells.last().is_none_or(|(times, _)| time_s - times.start >= CELL_S) {
            cells.push((time_s..time_s, zeros.clone()));
        }
        let Some((times, sums)) = cells.last_mut() else { continue };
        times.end = time_s;
        rows.add(sums, place, sample);
    }
    let name = || rows.data.name.clone();
    let mut length = 1;
    while length <= cells.len() {
        for first in (0..=cells.len() - length).step_by((length / 2).max(1)) {
            let window = &cells[first..first + length];
            let mut sums = zeros.clone();
            for (_, cell) in window {
                sums.add(cell, 1.0);
            }
            let (from_s, to_s) = (window[0].0.start, window[length - 1].0.end);
            test(&sums, signal, &|| Place::Time { recording: name(), from_s, to_s });
        }
        length *= 2;
    }
    let span_s = time_s.last().map_or(0.0, |last| last - time_s[0]);
    let highest = whole(2.0 * span_s * HIGHEST_HZ.min(0.25 / rows.data.period_s.max(CELL_S)));
    for k in 2..=highest {
        let hz = 0.5 * k as f64 / span_s;
        for quarter in [0.0, 0.25] {
            let mut sums = zeros.clone();
            for (times, cell) in &cells {
                let turns = hz * 0.5 * (times.start + times.end) + quarter;
                sums.add(cell, (std::f64::consts::TAU * turns).cos());
            }
            test(&sums, signal, &|| Place::Frequency { recording: name(), hz });
        }
    }
}

/// Tests of every signal by position of spool and servomotor, and by the servomotor's speed, over all recordings together.
fn by_state(rows: &[Rows<'_>], zeros: &Sums, test: &mut impl FnMut(&Sums, Signal, &dyn Fn() -> Place)) {
    for of in [Signal::ServomotorPosition, Signal::SpoolPosition] {
        let states = |rows: &Rows<'_>| rows.data.measured(of).into_iter().zip(rows.data.speeds(of, CELL_S)).collect();
        let states: Vec<Vec<(f64, f64)>> = rows.iter().map(states).collect();
        let positions = edges(states.iter().flatten().map(|state| state.0));
        let speeds = edges(states.iter().flatten().map(|state| state.1));
        for signal in Signal::ALL {
            let mut bins = vec![zeros.clone(); 3 * BINS];
            collect(rows, signal, &states, &mut bins, |(position, speed)| {
                let direction = if speed.abs() < STANDING_PU_S { 0 } else { 1 + usize::from(speed > 0.0) };
                bin(&positions, position).map(|bin| 3 * bin + direction)
            });
            for (k, sums) in bins.iter().enumerate() {
                let (from_pu, to_pu) = (positions[k / 3], positions[k / 3 + 1]);
                test(sums, signal, &|| Place::Position { of, from_pu, to_pu, direction: [0, -1, 1][k % 3] });
            }
            if of == Signal::ServomotorPosition {
                let mut bins = vec![zeros.clone(); BINS];
                collect(rows, signal, &states, &mut bins, |(_, speed)| bin(&speeds, speed));
                for (k, sums) in bins.iter().enumerate() {
                    test(sums, signal, &|| Place::Speed { from_pu_s: speeds[k], to_pu_s: speeds[k + 1] });
                }
            }
        }
    }
}

/// Sums each sample of a signal up in the bin of its state.
fn collect(
    rows: &[Rows<'_>],
    signal: Signal,
    states: &[Vec<(f64, f64)>],
    bins: &mut [Sums],
    bin_of: impl Fn((f64, f64)) -> Option<usize>,
) {
    for (rows, states) in rows.iter().zip(states) {
        let Some(place) = rows.data.place(signal) else { continue };
        let measured = rows.data.measured(signal);
        for (sample, state) in states.iter().enumerate().filter(|(sample, _)| measured[*sample].is_finite()) {
            if let Some(bin) = bin_of(*state) {
                rows.add(&mut bins[bin], place, sample);
            }
        }
    }
}

/// Edges of bins that hold all but the farthest hundredths.
fn edges(values: impl Iterator<Item = f64>) -> Vec<f64> {
    let mut values: Vec<f64> = values.filter(|value| value.is_finite()).collect();
    values.sort_by(f64::total_cmp);
    let at = |share: f64| values.get(whole(share * values.len().saturating_sub(1) as f64)).copied().unwrap_or(0.0);
    let (low, high) = (at(0.01), at(0.99));
    (0..=BINS).map(|k| low + (high - low) * k as f64 / BINS as f64).collect()
}

fn bin(edges: &[f64], value: f64) -> Option<usize> {
    let (low, high) = (edges[0], edges[BINS]);
    let place = BINS as f64 * (value - low) / (high - low);
    (place >= 0.0 && place < BINS as f64).then(|| whole(place))
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a small count that is not negative")]
fn whole(count: f64) -> usize {
    count as usize
}

#[cfg(test)]
mod tests {
    use nalgebra::{DMatrix, DVector};
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    use super::{BINS, Calibration, Sums, bin, edges};
    use crate::evidence::ExtendedEquations;
    use crate::model::normal_equations::{NormalEquations, RecordingNormal};

    /// A fit takes some of the noise away and errors of equations bring some: the variance of a test counts both. A parameter that is held, the last of
    /// four, has slopes and takes nothing.
    #[test]
    fn tests_of_a_right_model_have_unit_variance() {
        const ROWS: usize = 120;
        const KAPPA: f64 = 0.3;
        let mut random = ChaCha8Rng::seed_from_u64(5);
        let mut normal = move || -> f64 { StandardNormal.sample(&mut random) };
        let slopes = DMatrix::from_fn(ROWS, 4, |_, k| if k < 3 { normal() } else { 1.0 });
        let followed = slopes.columns(0, 3).into_owned();
        // Errors of equations that are slow, and in part what the free parameters do as well.
        let marks = DMatrix::from_fn(ROWS, 2, |row, k| (row as f64 * (k + 1) as f64 / 40.0).sin() + slopes[(row, k)]);
        let mut squares = DMatrix::zeros(4, 4);
        squares.view_mut((0, 0), (3, 3)).copy_from(&followed.tr_mul(&followed));
        let mut hessian = DMatrix::zeros(6, 6);
        hessian.view_mut((0, 0), (4, 4)).copy_from(&(&squares + DMatrix::identity(4, 4)));
        hessian.view_mut((4, 0), (2, 3)).copy_from(&marks.tr_mul(&followed));
        let part = RecordingNormal { cost: 0.0, hessian: squares.clone(), gradient: DVector::zeros(4) };
        let fit = NormalEquations {
            cost: 0.0,
            hessian: hessian.view((0, 0), (4, 4)).into_owned(),
            gradient: DVector::zeros(4),
            parts: vec![part],
            held: vec![3],
        };
        let equations = ExtendedEquations { fit, terms: 2, hessian, gradient: DVector::zeros(6) };
        let calibration = Calibration::new(&equations, (KAPPA, 0.0)).unwrap();
        let inverse = (&followed.tr_mul(&followed) + DMatrix::identity(3, 3)).try_inverse().unwrap();
        let window = 30..70;
        let weights = DVector::from_fn(ROWS, |row, _| if window.contains(&row) { 1.0 } else { 0.0 });
        let mut squared = 0.0;
        const DRAWS: usize = 4000;
        for _ in 0..DRAWS {
            let errors = DVector::from_fn(2, |_, _| KAPPA * normal());
            let all = DVector::from_fn(ROWS, |_, _| normal()) + &marks * errors;
            let left = &all - &followed * (&inverse * followed.tr_mul(&all));
            let sums = Sums {
                samples: 40.0,
                residual: weights.dot(&left),
                noise: 40.0,
                slopes: slopes.tr_mul(&weights),
                marks: marks.tr_mul(&weights),
            };
            squared += calibration.deviations(&sums).powi(2);
        }
        let variance = squared / DRAWS as f64;
        assert!((variance - 1.0).abs() < 0.1, "{variance}");
    }

    #[test]
    fn bins_hold_what_recordings_show() {
        let edges = edges((0..=100).map(f64::from).chain([f64::NAN]));
        assert_eq!((edges[0], edges[BINS], edges.len()), (1.0, 99.0, BINS + 1));
        assert_eq!(
            [0.0, 1.0, 50.0, 98.9, 99.0].map(|value| bin(&edges, value)),
            [None, Some(0), Some(12), Some(BINS - 1), None]
        );
        assert_eq!(bin(&[2.0; BINS + 1], 2.0), None, "what never moves has no bins");
        assert_eq!(bin(&edges, f64::NAN), None);
    }
}
