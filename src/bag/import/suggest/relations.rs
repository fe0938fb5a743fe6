//! What two signals do to each other by their courses alone: one sums up the other, settles to it, or is its speed.
//!
//! With `s` the speed of a position `y`, and `u` the other signal some time ago: `s = a u + c` sums up, `s = a u − b y + c` settles to `a/b u` with the
//! time constant `1/b`. Both are fitted by least squares over buckets of several widths, so that neither rate nor unit matters.

use super::column::{Envelope, SuggestedColumn};

/// Times by which a signal may act late, in buckets.
const DELAYS: [i64; 7] = [0, 1, 2, 3, 4, 6, 8];
/// Times that buckets are widened to twice, and fewer of them say nothing.
const WIDTHS: usize = 6;
const FEWEST: f64 = 48.0;
/// Share of buckets that must be followed by the next, so that speeds can be told.
const FILLED: f64 = 0.9;
/// Share of what a sum leaves of the speed that settling must take away, or it is a sum.
const SETTLES: f64 = 0.3;
/// A time constant beyond this share of the file is that of a sum that leaks.
const LONGEST: f64 = 0.125;
/// How much more one of two must say of the other's speed than the other way round, to lead it.
const LEADS: f64 = 0.2;
/// A sum of gain 1 within this share, by at least this correlation, is of a speed.
const SPEED: (f64, f64) = (0.05, 0.99);

/// This share of its range is the end of a position's.
const ENDS: f64 = 0.02;

/// A weaker correlation is none.
pub(super) const WEAKEST: f64 = 0.4;
/// Pairs of columns that are shown at most.
const MOST_PAIRS: usize = 6;

/// Two columns that by their courses hang together.
#[derive(Clone, Debug, PartialEq)]
pub struct RelatedPair {
    /// Number of the column of the position among those of the suggestion.
    pub position: usize,
    /// Number of the column of what moves it.
    pub other: usize,
    /// What the one does to the other, in words.
    pub what: &'static str,
    /// Correlation of the position's speed with what is to cause it.
    pub correlation: f64,
    /// Time constant with which the position settles to the other, s; none where it does not settle.
    pub settles_s: Option<f64>,
}

/// What one signal does to another.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Relation {
    /// Correlation of the position's speed with the other signal; 0 where it rather settles to that.
    pub(super) drives: f64,
    /// Correlation of the speed with the distance to where the other signal leads it; 0 where it does not lead.
    pub(super) leads: f64,
    /// Correlation of both at the same time.
    pub(super) alike: f64,
    /// Time constant of settling, s.
    pub(super) settles_s: f64,
    /// The other signal is the position's own speed.
    pub(super) is_speed: bool,
}

impl Relation {
    /// What the stronger of both says.
    fn strength(&self) -> f64 {
        self.drives.abs().max(self.leads.abs())
    }
}

/// Relations of all pairs among some columns, the position first.
pub(super) fn relations(columns: &[SuggestedColumn], related: &[usize]) -> Vec<Vec<Relation>> {
    let courses: Vec<Vec<Envelope>> = related.iter().map(|column| widths(&columns[*column].envelope)).collect();
    let mut all: Vec<Vec<Relation>> =
        courses.iter().map(|position| courses.iter().map(|other| relation(position, other)).collect()).collect();
    let pairs = (0..all.len()).flat_map(|one| (0..one).map(move |other| (one, other)));
    for (one, other) in pairs {
        let [there, back] = [all[one][other], all[other][one]];
        // Of a loop that is closed, both ways show something: what moves the other shows more.
        let weaker = if there.strength() > back.strength() { &mut all[other][one] } else { &mut all[one][other] };
        (weaker.drives, weaker.leads) = (0.0, 0.0);
        // Neither leads where both would.
        if (there.leads.powi(2) - back.leads.powi(2)).abs() < LEADS {
            (all[one][other].leads, all[other][one].leads) = (0.0, 0.0);
        }
    }
    all
}

/// The course of a signal in buckets that are filled one behind another, and in wider ones.
fn widths(envelope: &Envelope) -> Vec<Envelope> {
    let mut envelope = envelope.clone();
    let mut all = vec![];
    while all.len() < WIDTHS {
        let (from, to) = envelope.span();
        let filled = |at: &i64| envelope.mean_at(*at).is_some();
        let count = (from..to).filter(filled).count() as f64;
        if count < FEWEST {
            break;
        }
        let followed = (from..to).filter(|at| filled(at) && filled(&(at + 1))).count() as f64;
        if followed >= FILLED * (count - 1.0) {
            all.push(envelope.clone());
        }
        envelope.widen();
    }
    all
}

/// The strongest relation of a position to another signal, over the widths that both have.
fn relation(position: &[Envelope], other: &[Envelope]) -> Relation {
    let mut best = Relation::default();
    let mut most = 0.0;
    for position in position {
        let Some(other) = other.iter().find(|other| other.width_ns() == position.width_ns()) else { continue };
        if best.alike == 0.0 {
            best.alike = alike(position, other);
        }
        let width_s = position.width_ns() as f64 * 1e-9;
        for delay in DELAYS {
            let Some(sums) = Sums::of(position, other, delay) else { continue };
            let found = sums.relation(width_s);
            if found.strength() > most {
                most = found.strength();
                best = Relation { alike: best.alike, ..found };
            }
        }
    }
    best
}

/// Correlation of two signals at the same time.
fn alike(one: &Envelope, other: &Envelope) -> f64 {
    let (from, to) = one.span();
    let both = (from..to).filter_map(|at| Some([one.mean_at(at)?, other.mean_at(at)?, 0.0]));
    Sums::sum(both, (to - from) as f64).map_or(0.0, |sums| sums.correlation(0, 1))
}

/// Variances and covariances of speed, other signal and position, in units of a bucket's width.
struct Sums {
    covariances: [[f64; 3]; 3],
    length: f64,
    /// Correlation of speed and other signal where the position is not at an end of its range: a stop holds it there, whatever the other does.
    inside: f64,
}

impl Sums {
    fn of(position: &Envelope, other: &Envelope, delay: i64) -> Option<Self> {
        let (from, to) = position.span();
        let row = |at: i64| {
            let [before, after] = [position.mean_at(at - 1)?, position.mean_at(at + 1)?];
            // The speed over two widths is that of the bucket between.
            Some([0.5 * (after - before), other.mean_at(at - delay)?, position.mean_at(at)?])
        };
        let rows = || (from..to).filter_map(row);
        let (least, most) = position.points().fold((f64::INFINITY, f64::NEG_INFINITY), |(least, most), (_, bucket)| {
            (least.min(bucket.mean()), most.max(bucket.mean()))
        });
        let end = ENDS * (most - least);
        let is_inside = |row: &[f64; 3]| (least + end..=most - end).contains(&row[2]);
        let length = (to - from) as f64;
        let all = Self::sum(rows(), length)?;
        let inside = Self::sum(rows().filter(is_inside), length).map_or(all.inside, |sums| sums.inside);
        Some(Self { inside, ..all })
    }

    fn sum(rows: impl Iterator<Item = [f64; 3]>, length: f64) -> Option<Self> {
        let (mut count, mut means, mut covariances) = (0.0, [0.0; 3], [[0.0; 3]; 3]);
        for row in rows {
            count += 1.0;
            let before: [f64; 3] = std::array::from_fn(|k| row[k] - means[k]);
            (0..3).for_each(|k| means[k] += before[k] / count);
            for i in 0..3 {
                (0..3).for_each(|j| covariances[i][j] += before[i] * (row[j] - means[j]));
            }
        }
        let sums = Self { covariances, length, inside: 0.0 };
        (count >= FEWEST - 10.0).then(|| Self { inside: sums.correlation(0, 1), ..sums })
    }

    fn correlation(&self, one: usize, other: usize) -> f64 {
        let all = &self.covariances;
        let size = (all[one][one] * all[other][other]).sqrt();
        if size > 0.0 { all[one][other] / size } else { 0.0 }
    }

    fn relation(&self, width_s: f64) -> Relation {
        let [[ss, su, sy], [_, uu, uy], [_, _, yy]] = self.covariances;
        let drives = self.correlation(0, 1);
        // Of both spreads, so that noise in one does not make it less.
        let gain_1_s = if uu > 0.0 { (ss / uu).sqrt() / width_s } else { 0.0 };
        let is_speed = drives >= SPEED.1 && (gain_1_s - 1.0).abs() <= SPEED.0;
        let sum = Relation { drives: self.inside, is_speed, ..Relation::default() };
        let determinant = uu * yy - uy * uy;
        if ss <= 0.0 || determinant <= 1e-9 * uu * yy {
            return sum;
        }
        let [a, b] = [(su * yy - sy * uy) / determinant, (sy * uu - su * uy) / determinant];
        let explained = ((a * su + b * sy) / ss).clamp(0.0, 1.0);
        let settles = b < 0.0
            && -1.0 / b <= LONGEST * self.length
            && explained - drives * drives >= SETTLES * (1.0 - drives * drives);
        if !settles {
            return sum;
        }
        Relation { leads: explained.sqrt() * a.signum(), settles_s: -width_s / b, ..Relation::default() }
    }
}

/// The pairs of columns that hang together most, the strongest first; and what to ask where the spool of a stage is its servomotor's speed.
pub(super) fn pairs(
    columns: &[SuggestedColumn],
    related: &[usize],
    relations: &[Vec<Relation>],
    stage: [Option<usize>; 2],
) -> (Vec<RelatedPair>, Option<String>) {
    let (mut all, mut speed) = (vec![], None);
    for (at, row) in relations.iter().enumerate() {
        for (by, relation) in row.iter().enumerate().filter(|(by, _)| *by != at) {
            let (position, other) = (related[at], related[by]);
            let (what, correlation) = match relation {
                Relation { leads, .. } if leads.abs() >= WEAKEST => ("follows", *leads),
                Relation { is_speed: true, drives, .. } => ("has as its speed", *drives),
                Relation { drives, .. } if drives.abs() >= WEAKEST => ("sums up", *drives),
                _ => continue,
            };
            let settles_s = (what == "follows").then_some(relation.settles_s);
            if relation.is_speed && stage == [Some(position), Some(other)] {
                speed = Some(format!(
                    "spool_position: `{}` is the speed of `{}` itself by all signs (gain 1 per second, correlation {correlation:.3}), which moves \
                     nothing; take what the valve or its command does",
                    columns[other].name, columns[position].name
                ));
            }
            all.push(RelatedPair { position, other, what, correlation, settles_s });
        }
    }
    all.sort_by(|a, b| b.correlation.abs().total_cmp(&a.correlation.abs()));
    all.truncate(MOST_PAIRS);
    (all, speed)
}
