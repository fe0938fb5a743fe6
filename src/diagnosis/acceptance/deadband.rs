//! Dead band and hysteresis: what slow movement of the command does not move.
//!
//! The dead band is the width w of a play operator (Krasnosel'skii & Pokrovskii 1989, *Systems with Hysteresis*, section 2) that, behind a delay τ,
//! takes the command to the position with the least squared error over slow movement; an offset is free. Its interval is that of a jackknife over
//! stretches of 5 s.

use super::series::{Series, rate, smooth};
use super::statistics::{MeasuredEvent, found, missing, student_90};
use super::{Measure, MeasureFound};
use crate::result::Interval;

/// Fastest command of slow movement, pu/s.
const SLOW_PU_S: f64 = 0.01;
/// Window for this criterion, s.
const SLOW_WINDOW_S: f64 = 1.0;
/// Time for which a fast movement is remembered, s.
const REMEMBERED_S: f64 = 3.0;
/// A position farther from its command is on its way, pu.
const ON_ITS_WAY_PU: f64 = 0.03;
/// Rate of the samples that are used, Hz.
const RATE_HZ: f64 = 50.0;
/// Length of the stretches that are left out in turn, s.
const BLOCK_S: f64 = 5.0;
/// Fewest stretches.
const FEWEST_BLOCKS: usize = 4;
/// Fewest turns of the play.
const FEWEST_TURNS: usize = 3;
/// Largest dead band that is looked for, pu.
const WIDEST_PU: f64 = 0.04;
/// Smallest, pu.
const NARROWEST_PU: f64 = 2e-5;
/// Ratio of two widths that are tried.
const STEP_RATIO: f64 = 1.12;
/// Longest delay, s.
const LONGEST_S: f64 = 0.8;
/// Number of delays.
const DELAYS: usize = 41;
/// Width of the bins of the command in which rising and falling are compared, pu.
const BIN_PU: f64 = 0.005;
/// Slowest command that rises or falls, pu/s.
const MOVES_PU_S: f64 = 2e-4;
/// Window for the direction, s.
const DIRECTION_WINDOW_S: f64 = 0.5;

/// Samples of one series at the rate used, and the stretch of each; none where the movement is not slow.
struct Slow {
    time_s: Vec<f64>,
    command_pu: Vec<f64>,
    position_pu: Vec<f64>,
    block: Vec<Option<usize>>,
}

/// Which samples are of slow movement.
fn is_slow(series: &Series) -> Vec<bool> {
    let means = smooth(&series.time_s, &series.command_pu, 0.2);
    let rates = rate(&series.time_s, &means, SLOW_WINDOW_S);
    let mut last_fast_s = f64::NEG_INFINITY;
    let mut slow = Vec::with_capacity(series.len());
    for (i, rate_pu_s) in rates.into_iter().enumerate() {
        let fast = rate_pu_s.abs() > SLOW_PU_S || series.tripped[i] || series.error_pu(i).abs() > ON_ITS_WAY_PU;
        if fast {
            last_fast_s = series.time_s[i];
        }
        slow.push(series.time_s[i] - last_fast_s > REMEMBERED_S);
    }
    slow
}

fn slow_of(series: &Series, blocks: &mut usize) -> Slow {
    let slow = is_slow(series);
    let every_s = 1.0 / RATE_HZ;
    let mut out = Slow { time_s: vec![], command_pu: vec![], position_pu: vec![], block: vec![] };
    let (mut next_s, mut current) = (0.0, None);
    for (i, slow) in slow.into_iter().enumerate() {
        let time_s = series.time_s[i];
        if time_s < next_s - 1e-9 {
            continue;
        }
        next_s = time_s + every_s;
        let number = (time_s / BLOCK_S).floor();
        let block = slow.then(|| match current {
            Some((known, id)) if known == number => id,
            _ => {
                *blocks += 1;
                current = Some((number, *blocks - 1));
                *blocks - 1
            }
        });
        out.time_s.push(time_s);
        out.command_pu.push(series.command_pu[i]);
        out.position_pu.push(series.position_pu[i]);
        out.block.push(block);
    }
    out
}

/// Sums over the residuals of one stretch.
#[derive(Clone, Copy, Debug, Default)]
struct ResidualSums {
    count: f64,
    sum: f64,
    square: f64,
}

impl ResidualSums {
    fn add(&mut self, residual: f64) {
        self.count += 1.0;
        self.sum += residual;
        self.square += residual * residual;
    }

    fn merged(self, other: &Self, sign: f64) -> Self {
        Self {
            count: self.count + sign * other.count,
            sum: self.sum + sign * other.sum,
            square: self.square + sign * other.square,
        }
    }

    /// Squared residuals about their mean, each.
    fn spread(&self) -> f64 {
        (self.square - self.sum * self.sum / self.count.max(1.0)) / self.count.max(1.0)
    }
}

/// The command a delay earlier, at each sample.
fn delayed(slow: &Slow, delay_s: f64) -> Vec<f64> {
    let mut at = 0;
    let command = |t: f64, at: &mut usize| {
        while *at + 1 < slow.time_s.len() && slow.time_s[*at + 1] <= t {
            *at += 1;
        }
        let next = (*at + 1).min(slow.time_s.len() - 1);
        let apart_s = slow.time_s[next] - slow.time_s[*at];
        let share = if apart_s > 0.0 { ((t - slow.time_s[*at]) / apart_s).clamp(0.0, 1.0) } else { 0.0 };
        slow.command_pu[*at] + share * (slow.command_pu[next] - slow.command_pu[*at])
    };
    slow.time_s.iter().map(|t| command(t - delay_s, &mut at)).collect()
}

/// Residuals of a width, stretch by stretch, and how often the play turned there.
fn residuals(slow: &Slow, command_pu: &[f64], width_pu: f64, sums: &mut [ResidualSums]) -> usize {
    let half_pu = 0.5 * width_pu;
    let mut play_pu = slow.position_pu[0].clamp(command_pu[0] - half_pu, command_pu[0] + half_pu);
    let (mut turns, mut direction) = (0, 0.0);
    for (i, command_pu) in command_pu.iter().enumerate() {
        let before_pu = play_pu;
        play_pu = play_pu.clamp(command_pu - half_pu, command_pu + half_pu);
        let moved_pu = play_pu - before_pu;
        if let Some(block) = slow.block[i] {
            sums[block].add(slow.position_pu[i] - play_pu);
            if moved_pu != 0.0 && moved_pu.signum() != direction {
                turns += usize::from(direction != 0.0);
                direction = moved_pu.signum();
            }
        }
    }
    turns
}

fn widths_pu() -> Vec<f64> {
    let tried = std::iter::successors(Some(NARROWEST_PU), |width| Some(width * STEP_RATIO));
    std::iter::once(0.0).chain(tried.take_while(|width| *width <= WIDEST_PU)).collect()
}

/// The width of least error of a profile, between those tried.
fn least(widths: &[f64], profile: &[f64]) -> f64 {
    let best = (0..profile.len()).min_by(|&a, &b| profile[a].total_cmp(&profile[b])).unwrap_or(0);
    if best < 2 || best + 1 >= profile.len() {
        return widths[best];
    }
    let (a, b, c) = (profile[best - 1], profile[best], profile[best + 1]);
    let bend = a - 2.0 * b + c;
    let shift = if bend > 0.0 { (0.5 * (a - c) / bend).clamp(-1.0, 1.0) } else { 0.0 };
    widths[best] * STEP_RATIO.powf(shift)
}

/// Width of the command's movement that the position does not follow.
pub fn dead_band(all: &[Series]) -> MeasureFound {
    let measure = Measure::DeadBand;
    let mut blocks = 0;
    let slow: Vec<Slow> = all.iter().map(|series| slow_of(series, &mut blocks)).collect();
    if blocks < FEWEST_BLOCKS {
        return missing(measure, "less than 20 s of movement slower than 1 %/s");
    }
    let widths = widths_pu();
    // Sums by delay, width and stretch.
    let mut tables = vec![];
    let mut turns = vec![0_usize; widths.len()];
    for k in 0..DELAYS {
        let delay_s = LONGEST_S * k as f64 / (DELAYS - 1) as f64;
        let mut table = vec![vec![ResidualSums::default(); blocks]; widths.len()];
        for slow in &slow {
            let command_pu = delayed(slow, delay_s);
            for (w, width_pu) in widths.iter().enumerate() {
                let turned = residuals(slow, &command_pu, *width_pu, &mut table[w]);
                turns[w] += if k == 0 { turned } else { 0 };
            }
        }
        tables.push(table);
    }
    let whole: Vec<Vec<ResidualSums>> = tables
        .iter()
        .map(|table| {
            table.iter().map(|row| row.iter().fold(ResidualSums::default(), |all, one| all.merged(one, 1.0))).collect()
        })
        .collect();
    let profile = |left: Option<usize>| -> Vec<f64> {
        let of = |k: usize, w: usize| match left {
            Some(left) => whole[k][w].merged(&tables[k][w][left], -1.0).spread(),
            None => whole[k][w].spread(),
        };
        (0..widths.len()).map(|w| (0..DELAYS).map(|k| of(k, w)).fold(f64::INFINITY, f64::min)).collect()
    };
    let value = least(&widths, &profile(None));
    let near = widths.iter().rposition(|width| *width <= value).unwrap_or(0);
    if turns[near] < FEWEST_TURNS {
        return missing(measure, "the slow movement reverses fewer than three times");
    }
    let left_out: Vec<f64> = (0..blocks).map(|left| least(&widths, &profile(Some(left)))).collect();
    let count = blocks as f64;
    let mean = left_out.iter().sum::<f64>() / count;
    let square: f64 = left_out.iter().map(|width| (width - mean).powi(2)).sum::<f64>() * (count - 1.0) / count;
    // A fifth of a step is what the parabola between widths may miss.
    let half = (student_90(count - 1.0) * square.sqrt()).max(0.2 * (STEP_RATIO - 1.0) * value).max(NARROWEST_PU);
    let value = Interval { value, low: (value - half).max(0.0), high: value + half };
    MeasureFound { measure, value: Some(value), events: blocks, note: String::new() }
}

/// How far apart the positions of rising and of falling commands are.
pub fn hysteresis(all: &[Series]) -> MeasureFound {
    let measure = Measure::Hysteresis;
    let mut events: Vec<MeasuredEvent> = vec![];
    for series in all {
        let slow = is_slow(series);
        let means = smooth(&series.time_s, &series.command_pu, 0.2);
        let rates = rate(&series.time_s, &means, DIRECTION_WINDOW_S);
        let bin = |i: usize| (means[i] / BIN_PU).floor();
        let mut bins: std::collections::BTreeMap<i64, [Vec<f64>; 2]> = std::collections::BTreeMap::new();
        for i in (0..series.len()).filter(|&i| slow[i] && rates[i].abs() >= MOVES_PU_S) {
            #[expect(clippy::cast_possible_truncation, reason = "a few hundred bins")]
            let both = bins.entry(bin(i) as i64).or_default();
            both[usize::from(rates[i] < 0.0)].push(series.position_pu[i] - means[i]);
        }
        for [rising, falling] in bins.into_values() {
            let enough = series.samples_in(0.5).clamp(3.0, 25.0);
            if (rising.len().min(falling.len()) as f64) < enough {
                continue;
            }
            let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
            let sd = series.noise_pu * (1.0 / rising.len() as f64 + 1.0 / falling.len() as f64).sqrt();
            events.push(MeasuredEvent { value: mean(&falling) - mean(&rising), sd });
        }
    }
    found(measure, &events, "no opening at which the command both rises and falls slower than 1 %/s")
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A slow wander through a delay and a play of known width.
    fn wander(width_pu: f64, delay_s: f64, noise_pu: f64, seed: u32) -> Series {
        use rand::SeedableRng as _;
        use rand_distr::Distribution as _;
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(u64::from(seed));
        let normal = rand_distr::Normal::new(0.0, 1.0).unwrap();
        let time_s: Vec<f64> = (0..6000).map(|i| f64::from(i) * 0.01).collect();
        let phase = f64::from(seed);
        let command = |t: f64| 0.5 + 0.004 * (0.5 * t + phase).sin() + 0.002 * (1.3 * t + 2.0 * phase).sin();
        let mut play = command(-delay_s);
        let mut position_pu = vec![];
        for t in &time_s {
            let c = command(t - delay_s);
            play = play.clamp(c - 0.5 * width_pu, c + 0.5 * width_pu);
            position_pu.push(play + noise_pu * normal.sample(&mut rng));
        }
        let command_pu = time_s.iter().map(|t| command(*t)).collect();
        Series::new("wander", time_s, command_pu, position_pu, vec![false; 6000]).unwrap()
    }

    #[test]
    fn a_known_play_is_found_and_its_interval_holds_it() {
        let mut held = 0;
        for seed in 0..20 {
            let found = dead_band(&[wander(2e-3, 0.1, 2e-4, seed)]).value.unwrap();
            assert!((found.value - 2e-3).abs() < 2e-4, "{found:?}");
            held += usize::from(found.low <= 2e-3 && 2e-3 <= found.high);
        }
        assert!(held >= 16, "{held} of 20");
    }

    #[test]
    fn without_play_there_is_hardly_a_dead_band() {
        let found = dead_band(&[wander(0.0, 0.1, 2e-4, 3)]).value.unwrap();
        assert!(found.low == 0.0 && found.value < 2e-4, "{found:?}");
        let still = Series::new(
            "still",
            (0..4000).map(|i| f64::from(i) * 0.01).collect(),
            vec![0.5; 4000],
            vec![0.5; 4000],
            vec![false; 4000],
        );
        assert!(dead_band(&[still.unwrap()]).value.is_none());
    }

    #[test]
    fn hysteresis_of_a_slow_triangle_is_the_play() {
        let time_s: Vec<f64> = (0..8000).map(|i| f64::from(i) * 0.01).collect();
        let command = |t: f64| 0.5 + 0.04 * (2.0 * (t / 20.0 - (t / 20.0 + 0.5).floor())).abs();
        let (mut play, mut position_pu) = (0.5, vec![]);
        for t in &time_s {
            play = f64::clamp(play, command(*t) - 1e-3, command(*t) + 1e-3);
            position_pu.push(play);
        }
        let command_pu = time_s.iter().map(|t| command(*t)).collect();
        let series = Series::new("triangle", time_s, command_pu, position_pu, vec![false; 8000]).unwrap();
        let found = hysteresis(&[series]).value.unwrap();
        // Next to the turns the play is being crossed.
        assert!(found.value > 1.7e-3 && found.value <= 2.01e-3, "{found:?}");
    }
}
