//! Bounded, prior-weighted least squares over simulations: Gauss–Newton with Levenberg's damping.

use nalgebra::{DMatrix, DVector};
use rayon::iter::{IndexedParallelIterator, IntoParallelRefMutIterator, ParallelIterator};

use crate::estimation::coordinate::{Coordinate, Judge, Residuals, prior_square, square, subject_at};
use crate::estimation::descent::{Tried, correct, step};
use crate::estimation::linear::normal;

/// Step of a forward difference where nothing is rough, in units of a coordinate.
const DIFFERENCE: f64 = 0.05;

/// A fit: positions of the coordinates, what it cost, and the local picture around it.
#[derive(Clone, Debug)]
pub struct Fit {
    /// Position of each coordinate.
    pub positions: Vec<f64>,
    /// Sum of squares of the residuals.
    pub square: f64,
    /// Sum of squares of the priors.
    pub prior: f64,
    /// Residuals at the positions.
    pub residuals: Residuals,
    /// Change of the residuals per unit of each coordinate, by recording.
    pub slopes: Vec<DMatrix<f64>>,
}

impl Fit {
    /// Squares of residuals and priors together.
    pub fn cost(&self) -> f64 {
        self.square + self.prior
    }
}

/// Two sets of slopes of one recording as one.
pub fn beside(a: &DMatrix<f64>, b: &DMatrix<f64>) -> DMatrix<f64> {
    let mut both = DMatrix::zeros(a.nrows(), a.ncols() + b.ncols());
    both.columns_mut(0, a.ncols()).copy_from(a);
    both.columns_mut(a.ncols(), b.ncols()).copy_from(b);
    both
}

/// Subjects that stand a small step of one coordinate each away from a position, by every coordinate from the `first` on, and these steps.
fn stepped<C: Coordinate>(
    base: &C::Subject,
    coordinates: &[C],
    positions: &[f64],
    first: usize,
    difference: f64,
) -> (Vec<C::Subject>, Vec<f64>) {
    let of = |k: usize| {
        let mut moved = positions.to_vec();
        let (low, high) = coordinates[k].range(base);
        let down = difference.min((positions[k] - low).max(DIFFERENCE));
        let step = if positions[k] + difference > high { -down } else { difference };
        moved[k] += step;
        (subject_at(base, coordinates, &moved), step)
    };
    (first..coordinates.len()).map(of).unzip()
}

/// Slopes by what small steps changed.
fn secants(moved: &[Residuals], steps: &[f64], at: &Residuals) -> Vec<DMatrix<f64>> {
    let of = |recording: usize| {
        let mut slope = DMatrix::zeros(at[recording].len(), steps.len());
        for (k, step) in steps.iter().enumerate() {
            slope.set_column(k, &((&moved[k][recording] - &at[recording]) / *step));
        }
        slope
    };
    (0..at.len()).map(of).collect()
}

/// Slopes of the residuals about a position, by every coordinate from the `first` on.
pub fn slopes<C: Coordinate>(
    data: &impl Judge<C::Subject>,
    base: &C::Subject,
    coordinates: &[C],
    positions: &[f64],
    first: usize,
    at: &Residuals,
) -> Vec<DMatrix<f64>> {
    let (subjects, steps) = stepped(base, coordinates, positions, first, DIFFERENCE);
    secants(&data.residuals_of(&subjects), &steps, at)
}

/// Residuals at a position, and their slopes by every coordinate.
pub fn pictured<C: Coordinate>(
    data: &impl Judge<C::Subject>,
    base: &C::Subject,
    coordinates: &[C],
    positions: &[f64],
) -> (Residuals, Vec<DMatrix<f64>>) {
    let (mut subjects, steps) = stepped(base, coordinates, positions, 0, DIFFERENCE);
    subjects.push(subject_at(base, coordinates, positions));
    let mut moved = data.residuals_of(&subjects);
    let at = moved.pop().unwrap_or_default();
    let slopes = secants(&moved, &steps, &at);
    (at, slopes)
}

/// Dampings tried side by side, as multiples of the current one.
const DAMPINGS: [f64; 4] = [1.0, 30.0, 1.0e3, 3.0e4];

/// A gain of a step that is next to none: absolute, and as a share of the cost. A hundredth of what a search may miss.
const SMALL: (f64, f64) = (1e-2, 1e-4);

/// How much work a fit may be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Effort {
    /// Steps at most.
    pub rounds: usize,
    /// All slopes are measured anew after so many steps; between, they are corrected by what the steps showed.
    pub refresh: usize,
    /// By what the squares of the residuals are divided: above 1, what is known beforehand weighs more. A fit that cools from a high
    /// temperature gives a strange parameter its due before it stretches familiar ones beyond what the sheet allows.
    pub temperature: f64,
    /// Step of a forward difference, in units of a coordinate.
    pub difference: f64,
}

impl Effort {
    /// Enough to tell whether a model is worth more.
    pub const SCOUT: Self = Self { rounds: 3, refresh: 100, ..Self::FULL };
    /// A first look, which a scout goes on from.
    pub(crate) const GLANCE: Self = Self { rounds: 1, ..Self::SCOUT };
    /// Enough for the figures of a report.
    pub(crate) const FULL: Self = Self { rounds: 9, refresh: 3, temperature: 1.0, difference: DIFFERENCE };
}

/// What is to be fitted.
#[derive(Debug)]
pub struct Start<'a, C: Coordinate> {
    /// What is turned.
    pub base: &'a C::Subject,
    /// What may move.
    pub coordinates: &'a [C],
    /// Where it begins.
    pub positions: &'a [f64],
    /// How much work it may be.
    pub effort: Effort,
    /// Slopes of the leading coordinates, good enough to begin with, which saves most of the work.
    pub known: Option<&'a [DMatrix<f64>]>,
}

/// Fits the coordinates from a start; see `fit_all`.
pub fn fit<C: Coordinate>(
    data: &impl Judge<C::Subject>,
    base: &C::Subject,
    coordinates: &[C],
    start: &[f64],
    effort: Effort,
    known: Option<&[DMatrix<f64>]>,
) -> Fit {
    let mut descent = Descent::new(&Start { base, coordinates, positions: start, effort, known });
    while !descent.subjects.is_empty() {
        let answer = data.residuals_of(&descent.subjects);
        descent.hear(answer);
    }
    descent.done()
}

/// Fits from several starts in step with each other, so that what they simulate fills the lanes of a register; each comes out as it would alone.
///
/// Between measurements the slopes follow Broyden (1965): the least change that agrees with the step just made.
pub(crate) fn fit_all<C: Coordinate>(data: &impl Judge<C::Subject>, starts: &[Start<'_, C>]) -> Vec<Fit> {
    let mut fits: Vec<Descent<'_, C>> = starts.iter().map(Descent::new).collect();
    loop {
        // What each asks for next, all in one batch.
        let counts: Vec<usize> = fits.iter().map(|fit| fit.subjects.len()).collect();
        let subjects: Vec<C::Subject> = fits.iter().flat_map(|fit| fit.subjects.iter().cloned()).collect();
        if subjects.is_empty() {
            return fits.into_iter().map(Descent::done).collect();
        }
        let mut answers = data.residuals_of(&subjects).into_iter();
        let answers: Vec<Vec<Residuals>> = counts.iter().map(|&count| answers.by_ref().take(count).collect()).collect();
        fits.par_iter_mut().zip(answers).filter(|(_, answer)| !answer.is_empty()).for_each(|(fit, answer)| {
            fit.hear(answer);
        });
    }
}

impl<C: Coordinate> Clone for Start<'_, C> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<C: Coordinate> Copy for Start<'_, C> {}

/// What a descent waits for.
#[derive(Clone, Debug)]
enum Awaited {
    /// The residuals where it starts, and slopes by the coordinates from a first on.
    Start { steps: Vec<f64>, first: usize },
    /// The residuals at candidates for the next position.
    Candidates { positions: Vec<Vec<f64>>, dampings: [f64; DAMPINGS.len()] },
    /// Slopes where it stands, by the coordinates from a first on.
    Slopes { steps: Vec<f64>, first: usize },
    /// Nothing: it has arrived.
    Nothing,
}

/// A fit on its way.
#[derive(Debug)]
struct Descent<'a, C: Coordinate> {
    start: Start<'a, C>,
    positions: Vec<f64>,
    residuals: Residuals,
    slopes: Vec<DMatrix<f64>>,
    cost: f64,
    damping: f64,
    /// Rounds so far.
    round: usize,
    /// Rounds since all slopes were measured.
    age: usize,
    /// Whether they were just now.
    fresh: bool,
    /// The subjects whose residuals it wants to know next; none once it has arrived.
    subjects: Vec<C::Subject>,
    wanted: Awaited,
}

impl<'a, C: Coordinate> Descent<'a, C> {
    fn new(start: &Start<'a, C>) -> Self {
        let first = start.known.and_then(<[_]>::first).map_or(0, DMatrix::ncols);
        let positions = start.positions.to_vec();
        let (mut subjects, steps) = stepped(start.base, start.coordinates, &positions, first, start.effort.difference);
        subjects.push(subject_at(start.base, start.coordinates, &positions));
        Self {
            start: *start,
            positions,
            residuals: Residuals::new(),
            slopes: Vec::new(),
            cost: f64::INFINITY,
            damping: 1e-3,
            round: 0,
            age: 0,
            fresh: start.known.is_none(),
            subjects,
            wanted: Awaited::Start { steps, first },
        }
    }

    /// Goes on with the residuals of what it asked for.
    fn hear(&mut self, mut answer: Vec<Residuals>) {
        match std::mem::replace(&mut self.wanted, Awaited::Nothing) {
            Awaited::Start { steps, first } => {
                self.residuals = answer.pop().unwrap_or_default();
                let fits = |(known, residuals): (&DMatrix<f64>, &DVector<f64>)| known.nrows() == residuals.len();
                if !self.start.known.is_none_or(|known| known.iter().zip(&self.residuals).all(fits)) {
                    // Noise that is laid out anew may compare limit cycles elsewhere: slopes of before are of other residuals.
                    *self = Self::new(&Start { known: None, ..self.start });
                    return;
                }
                let fresh = secants(&answer, &steps, &self.residuals);
                self.slopes = match self.start.known {
                    Some(known) if first > 0 => known.iter().zip(&fresh).map(|(a, b)| beside(a, b)).collect(),
                    _ => fresh,
                };
                self.cost = self.total(&self.residuals, &self.positions);
                self.step();
            }
            Awaited::Candidates { positions, dampings } => self.choose(&positions, &dampings, answer),
            Awaited::Slopes { steps, first } => {
                let fresh = secants(&answer, &steps, &self.residuals);
                for (slope, fresh) in self.slopes.iter_mut().zip(&fresh) {
                    slope.columns_mut(first, fresh.ncols()).copy_from(fresh);
                }
                self.step();
            }
            Awaited::Nothing => {}
        }
    }

    fn total(&self, residuals: &Residuals, positions: &[f64]) -> f64 {
        square(residuals) / self.start.effort.temperature + prior_square(self.start.coordinates, positions)
    }

    /// Asks for the next candidates, all dampings at once: subjects side by side cost little more than one.
    fn step(&mut self) {
        self.subjects.clear();
        if self.round >= self.start.effort.rounds {
            return;
        }
        let Start { base, coordinates, effort, .. } = self.start;
        let (hessian, gradient) =
            normal(coordinates, &self.positions, &self.residuals, &self.slopes, effort.temperature);
        let dampings = DAMPINGS.map(|times| times * self.damping);
        let candidates = dampings.map(|damping| step(base, coordinates, &self.positions, &hessian, &gradient, damping));
        self.subjects = candidates.iter().map(|candidate| subject_at(base, coordinates, candidate)).collect();
        self.wanted = Awaited::Candidates { positions: candidates.to_vec(), dampings };
    }

    /// Takes the best candidate, learns of all of them, and asks for what it needs next.
    fn choose(&mut self, candidates: &[Vec<f64>], dampings: &[f64; DAMPINGS.len()], mut tried: Vec<Residuals>) {
        self.subjects.clear();
        let totals: Vec<f64> =
            tried.iter().zip(candidates).map(|(residuals, candidate)| self.total(residuals, candidate)).collect();
        let best = (0..totals.len()).min_by(|&a, &b| totals[a].total_cmp(&totals[b])).unwrap_or(0);
        // The shortest step says most about the slopes here, and the one taken is learned of last.
        let in_order = (0..totals.len()).filter(|&k| k != best).chain([best]);
        let in_order: Vec<Tried<'_>> = in_order.map(|k| Tried { to: &candidates[k], after: &tried[k] }).collect();
        correct(&mut self.slopes, &self.positions, &self.residuals, &in_order);
        let mut gain = 0.0;
        if totals[best] < self.cost {
            gain = self.cost - totals[best];
            self.positions.clone_from(&candidates[best]);
            (self.residuals, self.cost) = (tried.swap_remove(best), totals[best]);
            self.damping = (0.1 * dampings[best]).max(1e-6);
        } else {
            self.damping *= 1000.0;
        }
        self.round += 1;
        self.age += 1;
        let Start { base, coordinates, effort, known, .. } = self.start;
        let small = gain <= SMALL.0 + SMALL.1 * self.cost;
        if small && (self.fresh || effort.refresh > effort.rounds) {
            return;
        }
        self.fresh = false;
        let first = if small || self.age >= effort.refresh {
            (self.fresh, self.age, self.damping) = (true, 0, 1e-3);
            0
        } else if let Some(kept) = known.and_then(<[_]>::first).map(DMatrix::ncols) {
            // An effect's own slopes bend most and are few.
            kept
        } else {
            coordinates.len()
        };
        let (subjects, steps) = stepped(base, coordinates, &self.positions, first, effort.difference);
        if subjects.is_empty() {
            return self.step();
        }
        self.subjects = subjects;
        self.wanted = Awaited::Slopes { steps, first };
    }

    fn done(self) -> Fit {
        let prior = prior_square(self.start.coordinates, &self.positions);
        Fit {
            square: square(&self.residuals),
            prior,
            positions: self.positions,
            residuals: self.residuals,
            slopes: self.slopes,
        }
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::DVector;

    use super::{Effort, Start, fit_all};
    use crate::estimation::coordinate::{Coordinate, Judge, Residuals};

    /// One number, known to about 1 beforehand.
    struct Axis;

    impl Coordinate for Axis {
        type Subject = f64;

        fn range(&self, _: &f64) -> (f64, f64) {
            (-10.0, 10.0)
        }

        fn prior_centre(&self) -> Option<f64> {
            None
        }

        fn turn(&self, _: &f64, subject: &mut f64, position: f64) {
            *subject = position;
        }
    }

    /// Many residuals that fall to nothing at 3 and are rough on the way, each in its own phase, as samples of a limit cycle are.
    struct Rough;

    impl Judge<f64> for Rough {
        fn residuals_of(&self, subjects: &[f64]) -> Vec<Residuals> {
            let of = |x: f64| {
                let rough = |k: usize| (60.0 * x + 2.4 * k as f64).sin();
                vec![DVector::from_fn(50, |k, _| x - 3.0 + rough(k))]
            };
            subjects.iter().map(|&x| of(x)).collect()
        }
    }

    #[test]
    fn wide_differences_pass_what_is_rough() {
        let reached = |difference: f64| {
            let effort = Effort { rounds: 3, difference, ..Effort::FULL };
            let start = Start { base: &0.0, coordinates: &[Axis], positions: &[-3.0], effort, known: None };
            (fit_all(&Rough, &[start])[0].positions[0] - 3.0).abs()
        };
        assert!(reached(0.5) < 0.3, "{}", reached(0.5));
        assert!(reached(0.05) > 1.0, "{}", reached(0.05));
    }
}
