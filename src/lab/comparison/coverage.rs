//! What the band of a guarded residual holds of rows that it never saw, by process and by distance from what taught it.

use serde::Serialize;

use govtwin_correction::band::Band;
use govtwin_correction::forest::Forest;
use govtwin_correction::guard::{Guard, GuardCounts};
use govtwin_correction::table::FeatureTable;
use govtwin_model::recording::Process;

/// What the band of a guarded model holds at one distance from what taught it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct CoveredAt {
    /// Id of the process.
    pub process: &'static str,
    /// `near`: full correction; `far`: shrunk inside the support; `outside`: outside the support, where there is no band.
    pub distance: &'static str,
    /// Rows there.
    pub rows: u64,
    /// Share of them inside the band, `null` where there is none.
    pub coverage_share: f64,
    /// Mean half width, in the signal's unit.
    pub mean_half_width: f64,
}

impl CoveredAt {
    /// Rows, coverage and half width in words; `unit` is the signal's.
    pub fn words(&self, unit: &str) -> String {
        if self.coverage_share.is_nan() {
            return format!("{} rows, no band", self.rows);
        }
        let (covered, half) = (100.0 * self.coverage_share, self.mean_half_width);
        format!("{} rows, {covered:.1} % inside, half width {half:.4} {unit}", self.rows)
    }
}

/// How much of the rows the band of a guarded residual holds, by process and by distance.
pub fn covered_by_distance(
    table: &FeatureTable,
    rows: &[usize],
    forest: &Forest,
    (guard, band): (&Guard, &Band),
) -> Vec<CoveredAt> {
    let mut counts = GuardCounts::default();
    let of = |&row: &usize| {
        let (mark, values) = (&table.marks[row], table.row(row));
        let passed = guard.apply(forest.value(values), values, &mut counts);
        let distance = match (passed.widening.is_nan(), passed.weight_share < 1.0) {
            (true, _) => "outside",
            (false, true) => "far",
            (false, false) => "near",
        };
        let half_width = band.half_width(mark.motion) * passed.widening;
        (mark.process, distance, (mark.residual() - passed.value).abs() <= half_width, half_width)
    };
    let said: Vec<_> = rows.iter().map(of).collect();
    let places =
        Process::ALL.iter().flat_map(|process| ["near", "far", "outside"].map(|distance| (*process, distance)));
    let at = |(process, distance): (Process, &'static str)| {
        let own = || said.iter().filter(|one| (one.0, one.1) == (process, distance));
        let count = own().count();
        let mean = |sum: f64| if distance == "outside" { f64::NAN } else { sum / count as f64 };
        (count > 0).then(|| CoveredAt {
            process: process.id(),
            distance,
            rows: count as u64,
            coverage_share: mean(own().filter(|one| one.2).count() as f64),
            mean_half_width: mean(own().map(|one| one.3).sum()),
        })
    };
    places.filter_map(at).collect()
}

#[cfg(test)]
mod tests {
    use super::covered_by_distance;
    use crate::comparison::tests::made;
    use govtwin_correction::band::Band;
    use govtwin_correction::features::Feature;
    use govtwin_correction::forest::{Forest, Tree};
    use govtwin_correction::guard::Guard;
    use govtwin_correction::reach::Reach;

    #[test]
    fn rows_are_near_far_or_outside_and_a_wider_band_holds_more() {
        let table = made(400).1;
        let (taught, rows): (Vec<usize>, Vec<usize>) = ((0..10).collect(), (0..400).collect());
        let width = table.layout.features.len();
        let forest = Forest::new(&[Tree { leaf: vec![0.0], ..Tree::default() }], width).unwrap();
        let mut guard = Guard::of(&table.select(&rows), width, &[-0.1, 0.1]);
        let names: Vec<String> = table.layout.features.iter().map(Feature::name).collect();
        let near: Vec<&[f64]> = taught.iter().map(|&row| table.row(row)).collect();
        let mut reach = Reach::of(&names, &near, &near).unwrap();
        (reach.edges, reach.weight_shares, reach.widenings) = (vec![0.5], vec![1.0, 0.5], vec![1.0, 3.0]);
        guard.reach = Some(reach);
        // The recording is the twin's own, so that a band of any width holds it.
        let band = Band { coverage_share: 0.9, moving_above: 0.0, at_rest: 0.01, in_motion: 0.01 };
        let covered = covered_by_distance(&table, &rows, &forest, (&guard, &band));
        assert_eq!(covered.iter().map(|at| at.rows).sum::<u64>(), 400);
        let widths: Vec<_> = covered.iter().map(|at| (at.distance, at.mean_half_width)).collect();
        assert!(widths.iter().any(|(at, half)| *at == "near" && (half - 0.01).abs() < 1e-12), "{widths:?}");
        assert!(widths.iter().any(|(at, half)| *at == "far" && (half - 0.03).abs() < 1e-12), "{widths:?}");
        assert!(covered.iter().all(|at| at.coverage_share == 1.0));
        guard.support = Guard::of(&table.select(&taught[..5]), width, &[0.0]).support;
        let covered = covered_by_distance(&table, &rows, &forest, (&guard, &band));
        assert!(covered.iter().any(|at| at.distance == "outside" && at.coverage_share.is_nan()));
    }
}
