//! Recordings with the noise to expect of them, against which units are judged.

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use nalgebra::DVector;
use rayon::iter::{IntoParallelIterator, ParallelIterator};

use crate::estimation::coordinate::{Judge, Residuals};
use crate::likelihood::noise::Noise;
use crate::likelihood::prepared::{PreparedRecording, Traces};
use crate::likelihood::whitener::{Whitener, independent_share, whiteners};
use govtwin_model::frame::Estimate;
use govtwin_model::parameters::Unit;
use govtwin_model::plant::lanes::Width;
use govtwin_model::plant::regulator::Regulator;
use govtwin_model::signal::Signal;
use govtwin_model::solver::Method;
use govtwin_model::twin::{Cut, Twin};

/// Cost per independent sample of sound generated units at 100 Hz.
pub const SOUND_MEAN_SQUARE: f64 = 0.92;

/// Noise inside the loop over that of one reading, as it is most often: the mean of six readings.
pub(crate) const USUAL_LOOP_NOISE: f64 = 0.41;

/// How units are simulated when they are compared with recordings: spool steps of 1 ms, of which the error, 5e-5 pu of the spool, is a tenth of
/// its transducer's noise; half of the default's work there.
pub const METHOD: Method = Method::Split { max_step_s: 1.0e-3 };

/// What stands for a simulated value that is no number, in any signal's unit: far from everything, so that no fit ends there.
const ASTRAY: f64 = 1.0e12;

/// Whether a simulated value is no number, or so far off that its square soon will be none.
fn is_astray(value: f64) -> bool {
    value.is_nan() || value.abs() > ASTRAY
}

/// A set of recordings with the noise to expect of them, against which units are judged.
#[derive(Debug)]
pub struct Problem {
    /// The recordings.
    pub recordings: Vec<PreparedRecording>,
    /// Filters, by recording and by signal.
    whiteners: Vec<Vec<Whitener>>,
    noise: Noise,
    /// Noise of one reading of the regulator's transducer, pu.
    reading_noise_pu: f64,
    /// Noise inside the loop over that.
    loop_noise_ratio: f64,
    simulations: Arc<AtomicUsize>,
}

impl Judge<Unit> for Problem {
    fn residuals_of(&self, units: &[Unit]) -> Vec<Residuals> {
        Self::residuals_of(self, units)
    }
}

impl Problem {
    /// Prepares recordings; the noise is laid out along a reference unit's simulation.
    pub fn new(recordings: Vec<PreparedRecording>, reference: &Unit, noise: &Noise) -> Self {
        let problem = Self {
            recordings,
            whiteners: Vec::new(),
            noise: *noise,
            reading_noise_pu: reference.sensors.servomotor_position_pu.noise,
            loop_noise_ratio: USUAL_LOOP_NOISE,
            simulations: Arc::default(),
        };
        problem.laid_along(reference)
    }

    /// The same recordings, their noise laid out along another unit's simulation.
    #[must_use]
    pub fn laid_along(&self, reference: &Unit) -> Self {
        let along = Self::whiteners_along(std::slice::from_ref(self), reference).into_iter();
        let whiteners = along.map(|of_problem| of_problem.into_iter().flat_map(|(whiteners, _)| whiteners).collect());
        self.of(self.recordings.clone(), whiteners.collect())
    }

    /// The same with each of these amounts of noise inside the loop, over that of one reading, and what the unit then leaves.
    pub(crate) fn laid_along_each(&self, reference: &Unit, ratios: &[f64]) -> Vec<(Self, Residuals)> {
        let mut problems: Vec<Self> = ratios.iter().map(|&ratio| self.with_loop_noise(ratio)).collect();
        let mut left = vec![Residuals::new(); ratios.len()];
        for (index, of_recording) in Self::whiteners_along(&problems, reference).into_iter().enumerate() {
            for ((problem, left), (whiteners, estimates)) in problems.iter_mut().zip(&mut left).zip(of_recording) {
                problem.whiteners.push(whiteners);
                let traces = Signal::ALL.map(|signal| signal.of_estimates(&estimates));
                left.push(problem.whitened(&self.recordings[index], index, traces));
            }
        }
        problems.into_iter().zip(left).collect()
    }

    /// By recording, and of each of several problems that differ in their noise alone, the filters along a unit and the unit's estimates.
    fn whiteners_along(problems: &[Self], reference: &Unit) -> Vec<Vec<(Vec<Whitener>, Vec<Estimate>)>> {
        let [less, more] = [-1.0, 1.0].map(|times| twin_of(&with_moved_stops(reference, times)));
        let twins = [twin_of(reference), less, more];
        let step_pu = Regulator::new(&reference.parameters.regulator).deadband_step_pu();
        let of_recording = |index: usize| {
            let recording = &problems[0].recordings[index];
            // A spool that is recorded stands where it stands.
            let loose = if recording.cut == Cut::Spool { 1 } else { twins.len() };
            let all = problems
                .iter()
                .flat_map(|problem| twins[..loose].iter().map(move |twin| problem.prepared(twin.clone(), index)));
            let mut all: Vec<Twin> = all.collect();
            problems[0].simulations.fetch_add(all.len(), Ordering::Relaxed);
            let batches = all.chunks_mut(Width::most_lanes());
            let mut estimates = batches.flat_map(|batch| recording.run_batch(batch));
            let of_problem = |problem: &Self| {
                let own = estimates.next().unwrap_or_default();
                let moved: Vec<Vec<Estimate>> = estimates.by_ref().take(loose - 1).collect();
                (whiteners(recording, &problem.noise, &own, &moved, step_pu), own)
            };
            problems.iter().map(of_problem).collect()
        };
        let count = problems.first().map_or(0, |problem| problem.recordings.len());
        (0..count).into_par_iter().map(of_recording).collect()
    }

    /// Other versions of the recordings, their noise laid out along a unit's simulation; what it simulates counts with this problem's.
    #[must_use]
    pub fn anew(&self, recordings: Vec<PreparedRecording>, reference: &Unit) -> Self {
        self.of(recordings, Vec::new()).laid_along(reference)
    }

    /// Twice the logarithm of how wide the noise is, over all samples: what a likelihood charges for a noise that excuses more.
    pub fn width(&self) -> f64 {
        self.whiteners.iter().flatten().map(Whitener::width).sum()
    }

    /// A problem with one of the recordings alone, its noise as laid out here.
    #[must_use]
    pub fn only(&self, recording: usize) -> Self {
        self.part(&[recording])
    }

    /// The same with some of the recordings.
    #[must_use]
    pub fn part(&self, recordings: &[usize]) -> Self {
        let (kept, whiteners) =
            recordings.iter().map(|&k| (self.recordings[k].clone(), self.whiteners[k].clone())).unzip();
        self.of(kept, whiteners)
    }

    /// One recording through the mean twin of a unit.
    pub fn simulate(&self, unit: &Unit, recording: usize) -> Vec<Estimate> {
        self.simulations.fetch_add(1, Ordering::Relaxed);
        self.recordings[recording].run(&mut self.prepared(twin_of(unit), recording))
    }

    /// All recordings through the mean twins of several units, in parallel: for each unit its estimates by recording.
    pub fn simulate_all(&self, units: &[Unit]) -> Vec<Vec<Vec<Estimate>>> {
        let twins: Vec<Twin> = units.iter().map(twin_of).collect();
        self.of_all(&twins, |recording, twins| self.recordings[recording].run_batch(twins))
    }

    /// A twin with the cut of a recording; the mean over the noise that the regulator hears, where there is a regulator.
    fn prepared(&self, twin: Twin, recording: usize) -> Twin {
        match self.recordings[recording].cut {
            Cut::Spool => twin.with_cut(Cut::Spool),
            cut => twin.with_dither(self.dither_pu(recording)).with_cut(cut),
        }
    }

    /// The same problem without one recording; what it simulates counts with the whole.
    #[must_use]
    pub fn without(&self, left: usize) -> Self {
        fn others<T: Clone>(all: &[T], left: usize) -> Vec<T> {
            all.iter().enumerate().filter(|&(k, _)| k != left).map(|(_, one)| one.clone()).collect()
        }
        self.of(others(&self.recordings, left), others(&self.whiteners, left))
    }

    /// A problem with other recordings; what it simulates counts with this one's.
    fn of(&self, recordings: Vec<PreparedRecording>, whiteners: Vec<Vec<Whitener>>) -> Self {
        Self {
            recordings,
            whiteners,
            noise: self.noise,
            reading_noise_pu: self.reading_noise_pu,
            loop_noise_ratio: self.loop_noise_ratio,
            simulations: Arc::clone(&self.simulations),
        }
    }

    /// How many recordings were simulated so far.
    pub fn simulations(&self) -> usize {
        self.simulations.load(Ordering::Relaxed)
    }

    /// The same problem, its noise not laid out, with other noise to expect of the signals.
    pub(crate) fn with_noise(&self, noise: Noise) -> Self {
        Self { noise, ..self.of(self.recordings.clone(), Vec::new()) }
    }

    /// Noise inside the loop over that of one reading.
    pub fn loop_noise_ratio(&self) -> f64 {
        self.loop_noise_ratio
    }

    /// The same problem, its noise not laid out, with so much noise inside the loop over that of one reading of the regulator's transducer.
    #[must_use]
    pub fn with_loop_noise(&self, ratio: f64) -> Self {
        Self { loop_noise_ratio: ratio, ..self.of(self.recordings.clone(), Vec::new()) }
    }

    /// Noise inside the loop over which the twin is a mean, pu: what the regulator hears of its transducer's, and what a slow recorder does not show of the command.
    pub fn dither_pu(&self, recording: usize) -> f64 {
        (self.loop_noise_ratio * self.reading_noise_pu).hypot(self.recordings[recording].command_jitter_pu)
    }

    /// Mean square that a right model would leave of a signal in a recording, in its unit squared; 0 where it was not measured.
    pub(crate) fn floor_square(&self, recording: usize, signal: Signal) -> f64 {
        self.recordings[recording].place(signal).map_or(0.0, |place| self.whiteners[recording][place].floor_square)
    }

    /// Squared residuals of a signal in a recording at each sample, in its unit squared; in a limit cycle, those of its loudness.
    ///
    /// Not a number where it was not measured; none where it never was.
    pub fn squares(&self, recording: usize, signal: Signal, estimates: &[Estimate]) -> Option<Vec<f64>> {
        let place = self.recordings[recording].place(signal)?;
        let simulated = signal.of_estimates(estimates);
        let whitener = &self.whiteners[recording][place];
        Some(whitener.limit_cycles.squares(&whitener.measured, &simulated))
    }

    /// Whether any recording has samples so far apart that nobody knows what drives the unit between them.
    pub(crate) fn is_slow(&self) -> bool {
        self.recordings.iter().any(PreparedRecording::is_slow)
    }

    /// Independent samples, all recordings and signals together; one that may hold a kick counts as it costs a right model.
    pub(crate) fn independent_samples(&self) -> f64 {
        let whiteners = self.whiteners.iter().flatten();
        whiteners.map(|whitener| whitener.expected_square() * whitener.share).sum()
    }

    /// Sum of squares that innovations of a signal in a recording have where the model is right; see [`Self::innovations`].
    pub(crate) fn expected_square(&self, recording: usize, signal: Signal) -> f64 {
        self.recordings[recording].place(signal).map_or(0.0, |place| self.whiteners[recording][place].expected_square())
    }

    /// The cost that a right model has: one for each independent sample, the noise being a little generous.
    pub fn expected_cost(&self) -> f64 {
        SOUND_MEAN_SQUARE * self.independent_samples()
    }

    /// For how long a recording is in a limit cycle, s.
    pub fn limit_cycles_s(&self, recording: usize) -> f64 {
        let samples =
            self.whiteners[recording].iter().map(|whitener| whitener.limit_cycles.samples()).max().unwrap_or(0);
        samples as f64 * self.recordings[recording].period_s
    }

    /// Whether any recording holds limit cycles.
    pub fn chatters(&self) -> bool {
        (0..self.recordings.len()).any(|recording| self.limit_cycles_s(recording) > 0.0)
    }

    /// Which recordings are in a limit cycle and for how long, in a sentence.
    pub fn limit_cycle_note(&self) -> Option<String> {
        let times =
            self.recordings.iter().enumerate().map(|(index, recording)| (&recording.name, self.limit_cycles_s(index)));
        let said: Vec<String> = times
            .filter(|(_, time_s)| *time_s > 0.0)
            .map(|(name, time_s)| format!("{name} for {time_s:.0} s"))
            .collect();
        (!said.is_empty()).then(|| {
            format!(
                "Limit cycles in {}: no twin can follow their phase, so all figures for them compare power and frequency \
                 instead of samples.",
                said.join(", ")
            )
        })
    }

    /// Residuals of a unit in one recording.
    pub fn residuals(&self, unit: &Unit, recording: usize) -> DVector<f64> {
        self.residuals_in(&self.recordings[recording], twin_of(unit), recording)
    }

    /// The same in another version of a recording, with other inputs but the same samples.
    pub(crate) fn residuals_in(&self, data: &PreparedRecording, twin: Twin, index: usize) -> DVector<f64> {
        self.simulations.fetch_add(1, Ordering::Relaxed);
        let traces = data.traces(&mut [self.prepared(twin, index)]).pop().unwrap_or_default();
        self.whitened(data, index, traces)
    }

    /// Residuals of simulated signals in a version of a recording.
    fn whitened(&self, data: &PreparedRecording, index: usize, mut traces: Traces) -> DVector<f64> {
        let count = data.samples.len();
        let mut all = Vec::with_capacity(count * self.whiteners[index].len());
        let mut limit_cycles = Vec::new();
        for (signal, whitener) in data.signals().zip(&self.whiteners[index]) {
            let start = all.len();
            let simulated = &mut traces[signal as usize];
            simulated.iter_mut().filter(|value| is_astray(**value)).for_each(|value| *value = ASTRAY);
            all.extend(whitener.measured.iter().zip(&*simulated).map(|(measured, simulated)| measured - simulated));
            whitener.apply(&mut all[start..]);
            limit_cycles.extend(whitener.limit_cycles(simulated));
        }
        all.append(&mut limit_cycles);
        DVector::from_vec(all)
    }

    /// Normalised innovations of a signal in a recording, of its residuals there: each sample over what it may leave, outliers by their size.
    pub fn innovations(&self, recording: usize, signal: Signal, residuals: &DVector<f64>) -> Vec<f64> {
        let data = &self.recordings[recording];
        let Some(place) = data.place(signal) else { return Vec::new() };
        let whitener = &self.whiteners[recording][place];
        let root = whitener.share.sqrt();
        let own = residuals.iter().skip(place * data.samples.len());
        let measured = whitener.measured.iter().zip(own).filter(|(measured, _)| measured.is_finite());
        measured.map(|(_, residual)| residual / root).collect()
    }

    /// One over the standard deviation that each innovation of a signal in a recording is divided by.
    pub fn scales(&self, recording: usize, signal: Signal) -> Vec<f64> {
        self.recordings[recording]
            .place(signal)
            .map_or_else(Vec::new, |place| self.whiteners[recording][place].scales())
    }

    /// Independent samples per sample of a recording.
    pub fn share(&self, recording: usize) -> f64 {
        independent_share(self.recordings[recording].unit_period_s())
    }

    /// Residuals of several units in all recordings, in parallel, in order.
    pub fn residuals_of(&self, units: &[Unit]) -> Vec<Residuals> {
        let twins: Vec<Twin> = units.iter().map(twin_of).collect();
        self.residuals_of_twins(&twins)
    }

    /// The same of twins that no unit describes, such as those with terms of their own; each recording sets their cut.
    pub fn residuals_of_twins(&self, twins: &[Twin]) -> Vec<Residuals> {
        self.of_all(twins, |recording, twins| {
            let data = &self.recordings[recording];
            data.traces(twins).into_iter().map(|traces| self.whitened(data, recording, traces)).collect()
        })
    }

    /// What `run` makes of several twins on each recording, side by side and in parallel: for each twin its results by recording.
    fn of_all<R: Send>(&self, twins: &[Twin], run: impl Fn(usize, &mut [Twin]) -> Vec<R> + Sync) -> Vec<Vec<R>> {
        let lanes = Width::most_lanes();
        let batches: Vec<&[Twin]> = twins.chunks(lanes).collect();
        let jobs: Vec<Vec<R>> = (0..batches.len() * self.recordings.len())
            .into_par_iter()
            .map(|job| {
                let (batch, recording) = (batches[job / self.recordings.len()], job % self.recordings.len());
                self.simulations.fetch_add(batch.len(), Ordering::Relaxed);
                let mut prepared: Vec<Twin> = batch.iter().map(|twin| self.prepared(twin.clone(), recording)).collect();
                run(recording, &mut prepared)
            })
            .collect();
        let mut all: Vec<Vec<R>> = twins.iter().map(|_| Vec::with_capacity(self.recordings.len())).collect();
        for (job, of_batch) in jobs.into_iter().enumerate() {
            let first = job / self.recordings.len() * lanes;
            for (of_twin, one) in all[first..].iter_mut().zip(of_batch) {
                of_twin.push(one);
            }
        }
        all
    }
}

/// The twin of a unit as it is compared with recordings.
pub fn twin_of(unit: &Unit) -> Twin {
    Twin::with_method(unit, METHOD)
}

/// The unit with the spool's stops farther apart by so many times the noise of the spool's transducer.
fn with_moved_stops(unit: &Unit, times: f64) -> Unit {
    let mut moved = unit.clone();
    let valve = &mut moved.parameters.distributing_valve;
    let by_m = times * unit.sensors.spool_position_pu.noise * valve.reference_stroke_m;
    valve.stroke_min_m -= by_m;
    valve.stroke_max_m += by_m;
    moved
}
