//! The plain law of a servomotor stage: a zero of the spool, a dead band about it, one gain each way, and a lag. It needs no sheet and no unit.
//!
//! `dY/dt = k_o max(u − z − h, 0) + k_c min(u − z + h, 0)`, with `u` the spool some time ago, or settling to it (a valve with dead zone before an integrator: Jelali
//! & Kroll 2003, *Hydraulic Servo-systems*, section 4.3). The gains are linear in free runs; zero, half width and lag are searched on a grid that
//! scales with the recording, then by a pattern that halves its steps (Hooke & Jeeves 1961).

use crate::stage_alone::run::{Lag, Run, typical_s};

/// Samples of a run that the grid looks at, and the pattern.
const LOOKED_AT: (usize, usize) = (800, 5000);
/// Zeros on the grid lie at even shares of the spool's samples, so many.
const ZEROS: usize = 25;
/// Half widths on the grid, as shares of the spool's usual travel.
const HALVES: [f64; 6] = [0.0, 0.02, 0.05, 0.1, 0.2, 0.35];
/// First steps of the pattern, as shares: of the run's length, of the spool's travel twice.
const STEPS: [f64; 3] = [0.005, 0.02, 0.02];
/// Where the pattern walks, either way: along each axis, and along each edge of the dead band alone, on which one direction of movement depends.
const DIRECTIONS: [SearchPlace; 5] =
    [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.0, 1.0, 1.0], [0.0, 1.0, -1.0]];
/// How often the pattern halves its steps, and how often it walks at one size.
const WALKS: (usize, usize) = (10, 12);

/// The law as fitted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plain {
    /// How late the spool acts.
    pub lag: Lag,
    /// Middle of the dead band, in the spool's unit.
    pub zero: f64,
    /// Half of the dead band, in the spool's unit.
    pub half_band: f64,
    /// Speed for each unit of the spool above the dead band, in the opening's unit per second and unit of the spool.
    pub above_1_s: f64,
    /// The same below it.
    pub below_1_s: f64,
}

/// Where the search stands: time of the lag, zero, half width.
type SearchPlace = [f64; 3];

impl Plain {
    /// Position at each sample of a run from its first.
    #[must_use]
    pub(crate) fn simulated(&self, run: &Run) -> Vec<f64> {
        let spool = run.lagged(self.lag);
        let mut at = run.opening[0];
        let mut all = vec![at];
        for k in 1..run.time_s.len() {
            let [above, below] = self.beyond(0.5 * (spool[k - 1] + spool[k]));
            at += (run.time_s[k] - run.time_s[k - 1]) * (self.above_1_s * above + self.below_1_s * below);
            all.push(at);
        }
        all
    }

    /// How far the spool stands above and below the dead band.
    fn beyond(&self, spool: f64) -> [f64; 2] {
        beyond([self.lag.time_s(), self.zero, self.half_band], spool)
    }
}

fn beyond([_, zero, half]: SearchPlace, spool: f64) -> [f64; 2] {
    [(spool - zero - half).max(0.0), (spool - zero + half).min(0.0)]
}

/// Which parts of the law are fitted; the others are none.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Parts {
    /// The dead band.
    pub band: bool,
    /// The lag.
    pub lag: bool,
}

/// Fits the law; none where the spool stands still.
#[must_use]
pub fn plain(runs: &[Run]) -> Option<Plain> {
    plain_of(runs, Parts { band: true, lag: true })
}

/// Fits the law with some of its parts.
#[must_use]
pub(crate) fn plain_of(runs: &[Run], parts: Parts) -> Option<Plain> {
    let mut spools: Vec<f64> = runs.iter().flat_map(|run| run.spool.iter().copied()).collect();
    spools.sort_by(f64::total_cmp);
    let at = |share: f64| {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a place in the list")]
        let place = (share * spools.len().saturating_sub(1) as f64) as usize;
        spools.get(place).copied()
    };
    // A twentieth on either side may be outliers; where nothing else moves they are all there is.
    let usual = at(0.95)? - at(0.05)?;
    let travel = if usual > 0.0 { usual } else { at(1.0)? - at(0.0)? };
    if travel <= 0.0 {
        return None;
    }
    let length_s = typical_s(runs);
    let coarse: Vec<Run> = runs.iter().map(|run| run.thinned(LOOKED_AT.0)).collect();
    let mut best: Option<(f64, Lag, SearchPlace)> = None;
    for lag in Lag::tried(length_s).take(if parts.lag { usize::MAX } else { 1 }) {
        let lagged = Lagged::of(&coarse, lag);
        for zero in (0..=ZEROS).filter_map(|k| at(k as f64 / ZEROS as f64)) {
            for &half in &HALVES[..if parts.band { HALVES.len() } else { 1 }] {
                let place = [lag.time_s(), zero, half * travel];
                let missed = lagged.gains(place).2;
                if best.is_none_or(|(least, ..)| missed < least) {
                    best = Some((missed, lag, place));
                }
            }
        }
    }
    let (_, lag, mut place) = best?;
    let fine: Vec<Run> = runs.iter().map(|run| run.thinned(LOOKED_AT.1)).collect();
    let missed = |place: SearchPlace| Lagged::of(&fine, lag.with_time(place[0])).gains(place).2;
    let mut least = missed(place);
    let mut steps = [STEPS[0] * length_s, STEPS[1] * travel, STEPS[2] * travel];
    let directions: Vec<SearchPlace> = DIRECTIONS
        .into_iter()
        .filter(|[time, _, half]| (parts.lag || *time == 0.0) && (parts.band || *half == 0.0))
        .flat_map(|direction| [direction, direction.map(|one| -one)])
        .collect();
    for _ in 0..WALKS.0 {
        for _ in 0..WALKS.1 {
            let before = least;
            for direction in &directions {
                let other: SearchPlace = std::array::from_fn(|k| {
                    let moved = place[k] + direction[k] * steps[k];
                    // Neither lag nor width is below nothing.
                    if k == 1 { moved } else { moved.max(0.0) }
                });
                let now = missed(other);
                if now < least {
                    (least, place) = (now, other);
                }
            }
            if least == before {
                break;
            }
        }
        steps = steps.map(|step| 0.5 * step);
    }
    let lag = lag.with_time(place[0]);
    let (above_1_s, below_1_s, _) = Lagged::of(&fine, lag).gains(place);
    Some(Plain { lag, zero: place[1], half_band: place[2], above_1_s, below_1_s })
}

/// Runs with the spool as it stood some time ago: middle of each step, its length, and the movement since the start.
struct Lagged {
    steps: Vec<Vec<[f64; 3]>>,
}

impl Lagged {
    fn of(runs: &[Run], lag: Lag) -> Self {
        let of = |run: &Run| {
            let spool = run.lagged(lag);
            let step = |k: usize| {
                let moved = run.opening[k] - run.opening[0];
                [0.5 * (spool[k - 1] + spool[k]), run.time_s[k] - run.time_s[k - 1], moved]
            };
            (1..run.time_s.len()).map(step).collect()
        };
        Self { steps: runs.iter().map(of).collect() }
    }

    /// The best gains above and below, and the sum of squares that is missed; one gain for both where two would turn one way round.
    fn gains(&self, place: SearchPlace) -> (f64, f64, f64) {
        let (mut aa, mut ab, mut bb, mut ay, mut by, mut yy) = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0);
        for run in &self.steps {
            let (mut a, mut b) = (0.0, 0.0);
            for &[spool, step_s, moved] in run {
                let [above, below] = beyond(place, spool);
                a += step_s * above;
                b += step_s * below;
                aa += a * a;
                ab += a * b;
                bb += b * b;
                ay += a * moved;
                by += b * moved;
                yy += moved * moved;
            }
        }
        let determinant = aa * bb - ab * ab;
        if determinant > 1e-9 * aa * bb {
            let (above, below) = ((bb * ay - ab * by) / determinant, (aa * by - ab * ay) / determinant);
            if above * below >= 0.0 {
                return (above, below, yy - above * ay - below * by);
            }
        }
        let square = aa + 2.0 * ab + bb;
        if square <= 0.0 {
            return (0.0, 0.0, yy);
        }
        let both = (ay + by) / square;
        (both, both, yy - both * (ay + by))
    }
}
