//! Limit cycles: how loud and how fast they are, where no twin can keep step with it sample by sample.
//!
//! A loop that has gone unstable ends in a limit cycle, and a regulator whose cycle jitters hunts: two runs of the very same unit then
//! differ by as much as either amplitude. There the power of a signal is compared octave by octave: its wavelet variance (Percival & Walden
//! 2000, *Wavelet Methods for Time Series Analysis*, chapter 8; Haar filters, maximal overlap), which knows no phase.

use std::ops::Range;

/// Octaves at most.
const OCTAVES: usize = 6;

/// Length of a block, s, and in samples at least: a few periods of what is looked for.
const BLOCK: (f64, usize) = (2.0, 16);

/// A recording is in a limit cycle where its power in an octave is so many times what reference and noise have together.
const LOUD: f64 = 4.0;

/// A block is in a limit cycle with so many of so many blocks about it: an event that comes at another time is soon over.
const LASTING: (usize, usize) = (3, 5);

/// So many times the variance of the limit cycle counts as noise where samples are compared: one for the recording's, one for the twin's, and
/// most for not favouring a twin that stands still.
const IGNORED: f64 = 8.0;

/// For so many blocks what comes after a limit cycle depends on where in it that began.
const AFTER: usize = 2;

/// How far the logarithm of a right equation's power may be off, one standard deviation.
const INEXACT: f64 = 0.3;

/// Power in each octave, in the signal's unit squared.
type Powers = [f64; OCTAVES];

/// One signal of a recording, its reference, and the variance of noise, at each sample.
#[derive(Clone, Debug)]
pub struct SignalSamples {
    /// As recorded; not a number where it was not.
    pub measured: Vec<f64>,
    /// As the reference has it.
    pub reference: Vec<f64>,
    /// Variance of what a right model may leave, in the signal's unit squared.
    pub noise_squares: Vec<f64>,
}

/// One block of samples in a limit cycle.
#[derive(Clone, Debug)]
struct CycleBlock {
    samples: Range<usize>,
    measured: Powers,
    noise_square: f64,
}

/// Where a recording is in a limit cycle, and how one of its signals moves there.
#[derive(Clone, Debug)]
pub struct LimitCycles {
    blocks: Vec<CycleBlock>,
    octaves: usize,
    /// What of the limit cycle counts as noise at each sample, in the signal's unit squared.
    pub ignored_squares: Vec<f64>,
}

/// Looks for stretches in which any signal of a recording is in a limit cycle and the reference is not; then all of them are. One for each signal.
pub fn limit_cycles(looks: &[SignalSamples], period_s: f64) -> Vec<LimitCycles> {
    let count = looks.first().map_or(0, |look| look.measured.len());
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a small count")]
    let length = ((BLOCK.0 / period_s.max(1e-3)).round() as usize).max(BLOCK.1);
    // The slowest filter must fit into a block twice.
    let octaves = ((length / 2).ilog2() as usize).min(OCTAVES);
    // The last block holds what is over.
    let blocks: Vec<Range<usize>> = (0..count / length)
        .map(|k| k * length..if (k + 2) * length > count { count } else { (k + 1) * length })
        .collect();
    let compared: Vec<Vec<ComparedBlock>> =
        looks.iter().map(|look| blocks.iter().map(|block| look.at(block)).collect()).collect();
    let loud: Vec<bool> = (0..blocks.len()).map(|k| compared.iter().any(|signal| signal[k].is_loud(octaves))).collect();
    let window = |k: usize| {
        let first = k.saturating_sub(LASTING.1 / 2).min(blocks.len().saturating_sub(LASTING.1));
        first..(first + LASTING.1).min(blocks.len())
    };
    let lasting = |k: &usize| loud[window(*k)].iter().filter(|loud| **loud).count() >= LASTING.0;
    let swinging: Vec<usize> = (0..blocks.len()).filter(lasting).collect();
    let of = |signal: &Vec<ComparedBlock>| {
        let excesses: Vec<f64> = signal.iter().map(|block| block.excess(octaves)).collect();
        let mut ignored_squares = vec![0.0; count];
        for &k in &swinging {
            // The limit cycle goes on where an event hides it, and is no louder where an event comes at another time.
            let mut about = excesses[window(k)].to_vec();
            about.sort_by(f64::total_cmp);
            let end = blocks[(k + AFTER).min(blocks.len() - 1)].end;
            ignored_squares[blocks[k].start..end].fill(IGNORED * about[about.len() / 2]);
        }
        let whole = |block: &&CycleBlock| block.measured.iter().all(|power| power.is_finite());
        let blocks = swinging.iter().map(|&k| &signal[k].block).filter(whole).cloned().collect();
        LimitCycles { blocks, octaves, ignored_squares }
    };
    compared.iter().map(of).collect()
}

/// A block and the powers of its reference.
struct ComparedBlock {
    block: CycleBlock,
    reference: Powers,
}

impl SignalSamples {
    fn at(&self, samples: &Range<usize>) -> ComparedBlock {
        let samples = samples.clone();
        let noise_square = self.noise_squares[samples.clone()].iter().sum::<f64>() / samples.len() as f64;
        let [measured, reference] = [&self.measured, &self.reference].map(|signal| powers(&signal[samples.clone()]));
        ComparedBlock { block: CycleBlock { samples, measured, noise_square }, reference }
    }
}

impl ComparedBlock {
    /// Whether the recording is louder than it should; not where it has gaps.
    fn is_loud(&self, octaves: usize) -> bool {
        (0..octaves).any(|k| self.block.measured[k] > LOUD * (self.reference[k] + self.block.noise_square))
    }

    /// Power of the recording beyond the reference's.
    fn excess(&self, octaves: usize) -> f64 {
        (0..octaves).map(|k| (self.block.measured[k] - self.reference[k]).max(0.0)).sum()
    }
}

impl LimitCycles {
    /// Of a signal without a loop that could cycle.
    pub fn none(look: &SignalSamples) -> Self {
        Self { blocks: Vec::new(), octaves: 0, ignored_squares: vec![0.0; look.measured.len()] }
    }

    /// By how much a simulated limit cycle differs: residuals of unit size where the model is right, block by block, octave by octave.
    pub fn residuals<'a>(&'a self, simulated: &'a [f64]) -> impl Iterator<Item = f64> + 'a {
        self.blocks.iter().flat_map(move |block| {
            let powers = powers(&simulated[block.samples.clone()]);
            (0..self.octaves).map(move |k| {
                // Every second to sixty-fourth sample says something new.
                let chance = 2.0 * f64::from(2_u32 << k) / block.samples.len() as f64;
                let off = ((block.measured[k] + block.noise_square) / (powers[k] + block.noise_square)).ln();
                off / (INEXACT * INEXACT + chance).sqrt()
            })
        })
    }

    /// How many samples are in a limit cycle.
    pub fn samples(&self) -> usize {
        self.blocks.iter().map(|block| block.samples.len()).sum()
    }

    /// Squares of residuals at each sample, as far as two runs can be in step: of a limit cycle that of its loudness, octave by octave, and of its mean.
    pub fn squares(&self, measured: &[f64], simulated: &[f64]) -> Vec<f64> {
        let mut squares: Vec<f64> = measured.iter().zip(simulated).map(|(a, b)| (a - b).powi(2)).collect();
        for block in &self.blocks {
            let powers = powers(&simulated[block.samples.clone()]);
            let mean = |of: &[f64]| of[block.samples.clone()].iter().sum::<f64>() / block.samples.len() as f64;
            let loudness =
                (0..self.octaves).map(|k| (block.measured[k].sqrt() - powers[k].sqrt()).powi(2)).sum::<f64>();
            squares[block.samples.clone()].fill(loudness + (mean(measured) - mean(simulated)).powi(2));
        }
        squares
    }
}

/// Mean square of the Haar details of a stretch, octave by octave, fastest first.
fn powers(signal: &[f64]) -> Powers {
    // Sums about the first value lose no digits.
    let origin = signal.first().copied().unwrap_or(0.0);
    let mut sum = 0.0;
    let sums: Vec<f64> = std::iter::once(0.0)
        .chain(signal.iter().map(|value| {
            sum += value - origin;
            sum
        }))
        .collect();
    std::array::from_fn(|octave| {
        let half = 1 << octave;
        let count = (signal.len() + 1).saturating_sub(2 * half);
        let square = |start: usize| {
            let (first, second) = (sums[start + half] - sums[start], sums[start + 2 * half] - sums[start + half]);
            (0.5 * (second - first) / half as f64).powi(2)
        };
        (0..count).map(square).sum::<f64>() / count.max(1) as f64
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const PERIOD_S: f64 = 0.01;

    fn signal(of: impl Fn(f64) -> f64) -> Vec<f64> {
        (0..2000).map(|k| of(f64::from(k) * PERIOD_S)).collect()
    }

    /// A limit cycle about a slow movement.
    fn swing(loudness: f64, frequency_hz: f64, phase: f64) -> Vec<f64> {
        signal(|t| 0.3 * (0.2 * t).sin() + loudness * (std::f64::consts::TAU * frequency_hz * t + phase).sin())
    }

    fn found(measured: Vec<f64>) -> LimitCycles {
        let noise_squares = vec![1e-6; measured.len()];
        limit_cycles(&[SignalSamples { measured, reference: swing(0.0, 0.0, 0.0), noise_squares }], PERIOD_S).remove(0)
    }

    fn square(limit_cycles: &LimitCycles, simulated: &[f64]) -> f64 {
        limit_cycles.residuals(simulated).map(|residual| residual * residual).sum::<f64>() / (10 * OCTAVES) as f64
    }

    #[test]
    fn a_swing_is_known_by_loudness_and_pace_and_not_by_its_phase() {
        let limit_cycles = found(swing(0.05, 3.0, 0.0));
        assert_eq!(limit_cycles.samples(), 2000);
        for phase in [0.0, 1.0, 2.5] {
            assert!(square(&limit_cycles, &swing(0.05, 3.0, phase)) < 0.01);
        }
        assert!(square(&limit_cycles, &swing(0.03, 3.0, 0.0)) > 3.0);
        assert!(square(&limit_cycles, &swing(0.05, 6.0, 0.0)) > 3.0);
        assert!(square(&limit_cycles, &swing(0.0, 0.0, 0.0)) > 20.0);
    }

    #[test]
    fn squares_in_a_swing_are_those_of_its_loudness_and_mean() {
        let (measured, other) = (swing(0.05, 3.0, 0.0), swing(0.05, 3.0, 2.0));
        let limit_cycles = found(measured.clone());
        let mean = |simulated: &[f64]| limit_cycles.squares(&measured, simulated).iter().sum::<f64>() / 2000.0;
        let standing = mean(&swing(0.0, 0.0, 0.0));
        // Half the square of its loudness, as far as the octaves catch it.
        assert!((0.8..1.2).contains(&(standing / (0.5 * 0.05 * 0.05))), "{standing}");
        assert!(mean(&other) < 0.02 * standing, "{}", mean(&other));
        let off: Vec<f64> = other.iter().map(|value| value + 0.1).collect();
        assert!((mean(&off) / 0.01 - 1.0).abs() < 0.05, "{}", mean(&off));
    }

    #[test]
    fn an_event_at_another_time_and_louder_noise_are_no_swing() {
        let step = |at_s: f64| signal(|t| if t > at_s { 0.5 } else { 0.0 });
        let noise_squares = vec![1e-6; 2000];
        let event = SignalSamples { measured: step(7.0), reference: step(9.5), noise_squares: noise_squares.clone() };
        let noisy = SignalSamples {
            measured: (0..2000).map(|k| if k % 2 == 0 { 1.5e-3 } else { -1.5e-3 }).collect(),
            reference: vec![0.0; 2000],
            noise_squares,
        };
        for limit_cycles in limit_cycles(&[event, noisy], PERIOD_S) {
            assert_eq!(limit_cycles.samples(), 0);
            assert!(limit_cycles.ignored_squares.iter().all(|square| *square == 0.0));
        }
    }

    #[test]
    fn where_one_signal_swings_all_do_but_for_gaps() {
        let mut gappy = swing(0.0, 0.0, 0.0);
        gappy[1000] = f64::NAN;
        let noise_squares = vec![1e-6; 2000];
        let reference = swing(0.0, 0.0, 0.0);
        let looks = [swing(0.05, 3.0, 0.0), gappy].map(|measured| SignalSamples {
            measured,
            reference: reference.clone(),
            noise_squares: noise_squares.clone(),
        });
        let samples: Vec<usize> = limit_cycles(&looks, PERIOD_S).iter().map(LimitCycles::samples).collect();
        assert_eq!(samples, [2000, 1800]);
    }

    #[test]
    fn recordings_shorter_than_a_block_have_no_swings() {
        for count in [0, 1, 50] {
            let look = SignalSamples {
                measured: vec![1.0; count],
                reference: vec![0.0; count],
                noise_squares: vec![1e-6; count],
            };
            assert_eq!(limit_cycles(&[look], PERIOD_S)[0].samples(), 0);
        }
    }
}
