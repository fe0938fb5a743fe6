//! The plain law of a servomotor stage: a zero of the spool, a dead band about it, one gain each way, saturation, and a lag. It needs no sheet and no unit.
//!
//! `dY/dt = k_o sat(u − z − h) + k_c sat(u − z + h)`, each on its own side of the dead band and no farther than `f` from it, with `u` the spool some time
//! ago, or settling to it, or both (a valve with dead zone and saturation before an integrator: Jelali & Kroll 2003, *Hydraulic Servo-systems*, section 4.3). The
//! gains are linear in free runs; zero, half width and lag are searched on a grid that scales with the recording, then by a pattern that halves its
//! steps (Hooke & Jeeves 1961), and last a dead time beside a lag, and where the speed saturates, each if that pays.

use crate::stage_alone::run::{Lag, Run, typical_s};
use crate::stage_alone::spread::is_gain;
use govtwin_model::parameters::ChannelReading;

/// Samples of a run that the grid looks at, and the pattern.
const LOOKED_AT: (usize, usize) = (800, 5000);
/// Zeros on the grid lie at even shares of the spool's samples, so many.
const ZEROS: usize = 25;
/// Half widths on the grid, as shares of the spool's usual travel.
const HALVES: [f64; 6] = [0.0, 0.02, 0.05, 0.1, 0.2, 0.35];
/// First steps of the pattern, as shares: of the run's length, and of the spool's travel.
const STEPS: SearchPlace = [0.005, 0.005, 0.02, 0.02, 0.02];
/// Where the pattern walks, either way: along each axis, from dead time to lag, and along each edge of the dead band alone, on which one direction of
/// movement depends.
const DIRECTIONS: [SearchPlace; 8] = [
    [1.0, 0.0, 0.0, 0.0, 0.0],
    [0.0, 1.0, 0.0, 0.0, 0.0],
    [1.0, -1.0, 0.0, 0.0, 0.0],
    [0.0, 0.0, 1.0, 0.0, 0.0],
    [0.0, 0.0, 0.0, 1.0, 0.0],
    [0.0, 0.0, 1.0, 1.0, 0.0],
    [0.0, 0.0, 1.0, -1.0, 0.0],
    [0.0, 0.0, 0.0, 0.0, 1.0],
];
/// Shares of a lag that may be dead time beside one.
const DEAD: [f64; 3] = [0.2, 0.5, 0.8];
/// Where the speed may begin to saturate, as shares of the way from the dead band to the spool's farthest position.
const SATURATIONS: [f64; 4] = [0.2, 0.4, 0.6, 0.8];
/// Share of the squared error that saturation, or a dead time beside a lag, must close to be there.
const LEAST_WORTH: f64 = 0.02;
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
    /// How far beyond the dead band the speed grows, in the spool's unit; infinite where it never saturates.
    pub saturates: f64,
    /// Speed for each unit of the spool above the dead band, in the opening's unit per second and unit of the spool.
    pub above_1_s: f64,
    /// The same below it.
    pub below_1_s: f64,
}

/// Where the search stands: dead time, lag, zero, half width, saturation.
type SearchPlace = [f64; 5];

fn lag_at([delay_s, constant_s, ..]: SearchPlace) -> Lag {
    Lag { delay_s, constant_s }
}

impl Plain {
    /// Position at each sample of a run from its first.
    pub(crate) fn simulated(&self, run: &Run) -> Vec<f64> {
        let spool = run.lagged(self.lag);
        let mut at = run.opening[0];
        let mut all = vec![at];
        for k in 1..run.time_s.len() {
            at += (run.time_s[k] - run.time_s[k - 1]) * self.speed(0.5 * (spool[k - 1] + spool[k]));
            all.push(at);
        }
        all
    }

    fn place(&self) -> SearchPlace {
        [self.lag.delay_s, self.lag.constant_s, self.zero, self.half_band, self.saturates]
    }

    /// The same law of channels that are read in pu.
    pub(crate) fn in_pu(self, spool: ChannelReading, opening: ChannelReading) -> Self {
        let [mut above_1_s, mut below_1_s] =
            [self.above_1_s, self.below_1_s].map(|gain| gain * opening.scale_pu / spool.scale_pu);
        if spool.scale_pu < 0.0 {
            std::mem::swap(&mut above_1_s, &mut below_1_s);
        }
        let [half_band, saturates] = [self.half_band, self.saturates].map(|width| width * spool.scale_pu.abs());
        Self { zero: spool.position_pu(self.zero), half_band, saturates, above_1_s, below_1_s, ..self }
    }

    /// Speed at a spool position, in the opening's unit per second.
    pub(crate) fn speed(&self, spool: f64) -> f64 {
        let [above, below] = beyond(self.place(), spool);
        self.above_1_s * above + self.below_1_s * below
    }
}

/// How far the spool stands above and below the dead band, as far as that makes the stage faster.
fn beyond([_, _, zero, half, saturates]: SearchPlace, spool: f64) -> [f64; 2] {
    [(spool - zero - half).clamp(0.0, saturates), (spool - zero + half).clamp(-saturates, 0.0)]
}

/// Which parts of the law are fitted; the others are none.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Parts {
    /// The dead band.
    pub band: bool,
    /// The lag, and saturation.
    pub lag: bool,
}

/// Fits the law; none where the spool stands still.
pub fn plain(runs: &[Run]) -> Option<Plain> {
    plain_of(runs, Parts { band: true, lag: true })
}

/// Fits the law with some of its parts.
pub(crate) fn plain_of(runs: &[Run], parts: Parts) -> Option<Plain> {
    let mut spools: Vec<f64> = runs.iter().flat_map(|run| run.spool.iter().copied()).collect();
    spools.sort_by(f64::total_cmp);
    let at = |share: f64| {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a place in the list")]
        // Rounded, so that a spool that is turned round has the same places.
        let place = (share * spools.len().saturating_sub(1) as f64).round() as usize;
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
    let mut best: Option<(f64, SearchPlace)> = None;
    for lag in Lag::tried(length_s).take(if parts.lag { usize::MAX } else { 1 }) {
        let lagged = Lagged::of(&coarse, lag);
        for zero in (0..=ZEROS).filter_map(|k| at(k as f64 / ZEROS as f64)) {
            for &half in &HALVES[..if parts.band { HALVES.len() } else { 1 }] {
                let place = [lag.delay_s, lag.constant_s, zero, half * travel, f64::INFINITY];
                let missed = lagged.gains(place).2;
                if best.is_none_or(|(least, _)| missed < least) {
                    best = Some((missed, place));
                }
            }
        }
    }
    let (_, place) = best?;
    let fine: Vec<Run> = runs.iter().map(|run| run.thinned(LOOKED_AT.1)).collect();
    let search = Search { runs: &fine, parts, steps: [length_s, length_s, travel, travel, travel] };
    let mut place = search.pattern(place);
    if parts.lag {
        place = search.dead_beside_lag(place).unwrap_or(place);
        let [.., zero, half, _] = place;
        let farthest = (at(1.0)? - zero).max(zero - at(0.0)?) - half;
        place = search.saturated(place, farthest).unwrap_or(place);
    }
    let lag = lag_at(place);
    let (above_1_s, below_1_s, _) = Lagged::of(&fine, lag).gains(place);
    let [.., zero, half_band, saturates] = place;
    Some(Plain { lag, zero, half_band, saturates, above_1_s, below_1_s })
}

/// The search about a place on the grid.
struct Search<'a> {
    runs: &'a [Run],
    parts: Parts,
    /// What the first steps are shares of.
    steps: SearchPlace,
}

impl Search<'_> {
    fn missed(&self, place: SearchPlace) -> f64 {
        Lagged::of(self.runs, lag_at(place)).gains(place).2
    }

    /// The best that a pattern finds from a place.
    fn pattern(&self, mut place: SearchPlace) -> SearchPlace {
        let mut least = self.missed(place);
        let mut steps: SearchPlace = std::array::from_fn(|k| STEPS[k] * self.steps[k]);
        // Without a lag it walks along the dead time.
        let is_open = [
            self.parts.lag && (place[0] > 0.0 || place[1] == 0.0),
            self.parts.lag && place[1] > 0.0,
            true,
            self.parts.band,
            place[4].is_finite(),
        ];
        let directions: Vec<SearchPlace> = DIRECTIONS
            .into_iter()
            .filter(|direction| direction.iter().zip(is_open).all(|(along, is_open)| is_open || *along == 0.0))
            .flat_map(|direction| [direction, direction.map(|one| -one)])
            .collect();
        for _ in 0..WALKS.0 {
            for _ in 0..WALKS.1 {
                let before = least;
                for direction in &directions {
                    let other: SearchPlace = std::array::from_fn(|k| {
                        let moved = place[k] + direction[k] * steps[k];
                        // Neither lag nor width is below nothing.
                        if k == 2 { moved } else { moved.max(0.0) }
                    });
                    let now = self.missed(other);
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
        place
    }

    /// The same where part of the lag is dead time; none where that does not pay.
    fn dead_beside_lag(&self, plain: SearchPlace) -> Option<SearchPlace> {
        let [delay_s, constant_s, zero, half, saturates] = plain;
        let late_s = delay_s + constant_s;
        let of = |share: f64| [share * late_s, (1.0 - share) * late_s, zero, half, saturates];
        let found = self.best_of(DEAD.map(of))?;
        (found[0].min(found[1]) > 0.0 && self.pays(plain, found)).then_some(found)
    }

    /// The same where the speed saturates short of the spool's farthest position; none where that does not pay.
    fn saturated(&self, plain: SearchPlace, farthest: f64) -> Option<SearchPlace> {
        let [delay_s, constant_s, zero, half, _] = plain;
        let found = self.best_of(SATURATIONS.map(|share| [delay_s, constant_s, zero, half, share * farthest]))?;
        (found[4] > 0.0 && self.pays(plain, found)).then_some(found)
    }

    /// What the pattern finds from the best of some places.
    fn best_of<const N: usize>(&self, starts: [SearchPlace; N]) -> Option<SearchPlace> {
        let missed = starts.map(|start| (self.missed(start), start));
        let best = missed.into_iter().min_by(|a, b| a.0.total_cmp(&b.0));
        best.map(|(_, start)| self.pattern(start))
    }

    /// Whether a place closes enough of what another leaves, over all and between runs.
    fn pays(&self, plain: SearchPlace, found: SearchPlace) -> bool {
        let [before, after] = [plain, found].map(|place| {
            let lagged = Lagged::of(self.runs, lag_at(place));
            let gains = lagged.gains(place);
            lagged.missed(place, [gains.0, gains.1])
        });
        let gained: Vec<f64> = before
            .iter()
            .zip(&after)
            .map(|(a, b)| (a.max(f64::MIN_POSITIVE) / b.max(f64::MIN_POSITIVE)).ln())
            .collect();
        let closes = after.iter().sum::<f64>() < (1.0 - LEAST_WORTH) * before.iter().sum::<f64>();
        closes && is_gain(&gained)
    }
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

    /// Sum of squares that each run misses with these gains above and below.
    fn missed(&self, place: SearchPlace, gains: [f64; 2]) -> Vec<f64> {
        let of = |run: &Vec<[f64; 3]>| {
            let mut at = 0.0;
            let square = |&[spool, step_s, moved]: &[f64; 3]| {
                let [above, below] = beyond(place, spool);
                at += step_s * (gains[0] * above + gains[1] * below);
                (moved - at).powi(2)
            };
            run.iter().map(square).sum()
        };
        self.steps.iter().map(of).collect()
    }
}
