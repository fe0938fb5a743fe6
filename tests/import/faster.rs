//! The measured fatigue rig: imported by its map, and plain models of it on the half that they have not seen.

use std::path::Path;

use govtwin_bag::import::{Import, ImportError, ImportedRow, Map, Target};
use nalgebra::{DMatrix, DVector};

use super::shipped;

/// Rows of a free run: 2 s.
const RUN: usize = 258;
/// Stroke that the map assumes, mm.
const STROKE_MM: f64 = 12.0;
/// Control input that counts as 1, V.
const FULL_V: f64 = 3.0;

/// Control input, V, and displacement, mm, of each row, and the time between rows, s.
fn rig() -> (Vec<f64>, Vec<f64>, f64) {
    let map = Map::load(&shipped("real/faster/map.yaml")).unwrap();
    let import = Import::open(&[shipped("real/faster/faster.csv")], &map).unwrap();
    let mut rows: Vec<ImportedRow> = vec![];
    let outcome = import.run(
        &mut |row| {
            rows.push(*row);
            Ok::<(), ImportError>(())
        },
        &mut |_| (),
    );
    assert_eq!(outcome.unwrap().warnings, Vec::<String>::new());
    let of = |target: Target| rows.iter().map(|row| row.value(target).unwrap()).collect::<Vec<f64>>();
    let period_s = (rows.last().unwrap().time_ns - rows[0].time_ns) as f64 * 1e-9 / (rows.len() - 1) as f64;
    let input = of(Target::SpoolPosition).iter().map(|value| value * FULL_V).collect();
    let displacement = of(Target::ServomotorPosition).iter().map(|value| value * STROKE_MM - 0.5 * STROKE_MM).collect();
    (input, displacement, period_s)
}

/// Simulates a free run: input and measured displacement, of which only the start may be used, to displacement.
type FreeRun<'a> = dyn Fn(&[f64], &[f64]) -> Vec<f64> + 'a;

/// A half of the recording in free runs.
struct Half<'a> {
    input: &'a [f64],
    displacement: &'a [f64],
}

impl Half<'_> {
    fn runs(&self) -> impl Iterator<Item = (&[f64; RUN], &[f64; RUN])> {
        self.input.as_chunks::<RUN>().0.iter().zip(self.displacement.as_chunks::<RUN>().0)
    }

    /// Root mean square of the errors of all free runs, mm.
    fn rmse(&self, simulate: &FreeRun<'_>) -> f64 {
        let (mut sum, mut count) = (0.0, 0.0);
        for (input, displacement) in self.runs() {
            for (said, measured) in simulate(input, displacement).iter().zip(displacement) {
                sum += (said - measured).powi(2);
                count += 1.0;
            }
        }
        (sum / count).sqrt()
    }

    /// Coefficients of shapes of the input whose integrals explain the free runs best.
    fn integrals(&self, shapes: &dyn Fn(f64) -> Vec<f64>, period_s: f64) -> Vec<f64> {
        let width = shapes(0.0).len();
        let (mut hessian, mut gradient) = (DMatrix::<f64>::zeros(width, width), DVector::<f64>::zeros(width));
        for (input, displacement) in self.runs() {
            let mut sum = DVector::zeros(width);
            for (u, d) in input.iter().zip(&displacement[1..]) {
                sum += DVector::from_vec(shapes(*u)) * period_s;
                gradient += &sum * (d - displacement[0]);
                hessian += &sum * sum.transpose();
            }
        }
        hessian.cholesky().unwrap().solve(&gradient).iter().copied().collect()
    }
}

/// The free run of integrated shapes.
fn integrated(
    shapes: &dyn Fn(f64) -> Vec<f64>,
    gains: &[f64],
    period_s: f64,
    input: &[f64],
    displacement: &[f64],
) -> Vec<f64> {
    let mut at = displacement[0];
    let step = |u: &f64| {
        let now = at;
        at += period_s * shapes(*u).iter().zip(gains).map(|(shape, gain)| shape * gain).sum::<f64>();
        now
    };
    input.iter().map(step).collect()
}

/// Beyond a dead zone of this half width round a null, each way for itself.
fn dead_zone(null: f64, half: f64) -> impl Fn(f64) -> Vec<f64> {
    move |u: f64| vec![(u - null - half).max(0.0), (u - null + half).min(0.0)]
}

/// Coefficients of `d[k] = a1 d[k-1] + a2 d[k-2] + b1 u[k-1] + b2 u[k-2] + c` by least squares of one step, and its free run.
fn arx(half: &Half<'_>) -> impl Fn(&[f64], &[f64]) -> Vec<f64> + use<> {
    let (mut hessian, mut gradient) = (DMatrix::<f64>::zeros(5, 5), DVector::<f64>::zeros(5));
    let regressor = |d: &[f64], u: &[f64]| DVector::from_vec(vec![d[1], d[0], u[1], u[0], 1.0]);
    for k in 2..half.input.len() {
        let row = regressor(&half.displacement[k - 2..k], &half.input[k - 2..k]);
        gradient += &row * half.displacement[k];
        hessian += &row * row.transpose();
    }
    let theta = hessian.cholesky().unwrap().solve(&gradient);
    move |input: &[f64], displacement: &[f64]| {
        let mut said = displacement[..2].to_vec();
        for k in 2..input.len() {
            let row = regressor(&said[k - 2..k], &input[k - 2..k]);
            said.push(row.dot(&theta));
        }
        said
    }
}

#[test]
fn the_table_of_plain_models_on_the_faster_rig_is_as_the_document_says() {
    let (input, displacement, period_s) = rig();
    let middle = input.len() / 2;
    let halves = [
        Half { input: &input[..middle], displacement: &displacement[..middle] },
        Half { input: &input[middle..], displacement: &displacement[middle..] },
    ];
    let fitted = |shapes: &dyn Fn(f64) -> Vec<f64>| {
        let gains = halves[0].integrals(shapes, period_s);
        [0, 1].map(|half| halves[half].rmse(&|u, d| integrated(shapes, &gains, period_s, u, d)))
    };
    let mut rows = vec![
        ("stands still", [0, 1].map(|half| halves[half].rmse(&|_, d| vec![d[0]; d.len()]))),
        ("integrator", fitted(&|u| vec![u])),
        ("integrator with null", fitted(&|u| vec![u, 1.0])),
    ];
    // Null and dead zone by a grid on the fitted half alone.
    let mut best = (f64::INFINITY, 0.0, 0.0);
    for null in -8..=4 {
        for half in 0..=8 {
            let (null, half) = (f64::from(null) * 0.025, f64::from(half) * 0.0125);
            let said = fitted(&dead_zone(null, half))[0];
            if said < best.0 {
                best = (said, null, half);
            }
        }
    }
    rows.push(("gain per direction, dead zone and null", fitted(&dead_zone(best.1, best.2))));
    let model = arx(&halves[0]);
    rows.push(("ARX of second order", [0, 1].map(|half| halves[half].rmse(&model))));
    let document = std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/import.md")).unwrap();
    println!("null {} V, dead zone {} V", best.1, best.2);
    let lines: Vec<String> =
        rows.iter().map(|(name, [one, other])| format!("| {name} | {one:.3} | {other:.3} |")).collect();
    println!("{}", lines.join("\n"));
    for line in &lines {
        assert!(document.contains(line.as_str()), "docs/import.md lacks `{line}` of\n{}", lines.join("\n"));
    }
}
