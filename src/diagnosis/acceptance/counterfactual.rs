//! What a unit would measure without one of its faults: its twin as found, and again with that fault taken out.
//!
//! Both twins run along the recordings and through the standard tests (`standard_tests.rs`). Where a measure shows in the recordings, the unit
//! without the fault is expected at *measured + (twin without − twin as found)*: what both twins have wrong alike drops out. Elsewhere the twin's
//! standard tests speak alone. The interval is made of that of the measurement, of the sizes of the faults (each moved to the ends of its own
//! interval, deviations added in squares), and of the twin's error: if it misses the measured value by a share of its own value, the
//! difference is uncertain by as much of itself.

use rayon::prelude::{IntoParallelIterator, IntoParallelRefIterator, ParallelIterator};

use super::series::Series;
use super::{Measure, Measures, measure, standard_tests};
use crate::result::Interval;
use govtwin_model::parameters::Unit;
use govtwin_model::recording::Recording;
use govtwin_model::replay::simulate;
use govtwin_model::twin::Twin;

/// How far the size of a fault is known.
#[derive(Clone, Debug, PartialEq)]
pub struct SizeKnowledge {
    /// The effect's id.
    pub effect: String,
    /// Which of its parameters, in the order of its specification.
    pub parameter: usize,
    /// The ends of its interval, in the parameter's unit.
    pub ends: [f64; 2],
}

/// Measures of one twin, along the recordings and through the standard tests.
#[derive(Clone, Debug, PartialEq)]
pub struct TwinMeasures {
    /// Along the recordings.
    pub recorded: Measures,
    /// Through the standard tests.
    pub tested: Measures,
}

/// A value with the kind of evidence that it rests on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ExpectedValue {
    /// The value, in the measure's unit.
    pub value: Interval,
    /// True where no recording shows the measure, so that the twin's standard test speaks alone.
    pub simulated: bool,
}

/// The twin without some of its faults.
#[derive(Clone, Debug, PartialEq)]
pub struct Without {
    /// Ids of the faults that were taken out.
    pub removed: Vec<String>,
    /// The twin's own measures.
    pub twin: TwinMeasures,
    /// What the unit is expected to measure, one for each of [`Measure::ALL`].
    pub expected: Vec<Option<ExpectedValue>>,
}

/// All that was measured and simulated of a unit.
#[derive(Clone, Debug, PartialEq)]
pub struct Compared {
    /// As measured.
    pub measured: Measures,
    /// The twin as found, with the intervals that the sizes of its faults leave.
    pub found: TwinMeasures,
    /// What the unit measures as it is: the recordings, or where they show nothing the twin's standard test.
    pub as_found: Vec<Option<ExpectedValue>>,
    /// Without each of the faults, and where there are several, without all of them.
    pub without: Vec<Without>,
}

/// One twin to simulate.
struct TwinVariant {
    unit: Unit,
    /// Index of the case, 0 being the twin as found.
    case: usize,
    /// Index of the size that was moved, and to which end.
    moved: Option<(usize, usize)>,
}

/// Measures the recordings, the twin and the twin without each of the faults.
///
/// `progress` is called after each of the [`simulations`].
pub fn compare(
    recordings: &[Recording],
    found: &Unit,
    faults: &[String],
    sizes: &[SizeKnowledge],
    progress: &(dyn Fn() + Sync),
) -> Compared {
    let measured = measure(&recordings.iter().filter_map(Series::measured).collect::<Vec<_>>());
    let cases = cases(faults);
    let variants = variants(found, &cases, sizes);
    let results: Vec<TwinMeasures> = variants
        .par_iter()
        .map(|variant| {
            let measures = twin_measures(recordings, &variant.unit);
            progress();
            measures
        })
        .collect();
    let of = |case: usize, moved: Option<(usize, usize)>| {
        let place = variants.iter().position(|variant| variant.case == case && variant.moved == moved);
        // A size of a fault that was taken out moves nothing.
        place.or_else(|| variants.iter().position(|variant| variant.case == case && variant.moved.is_none()))
    };
    let moved = |case: usize| -> Vec<[&TwinMeasures; 2]> {
        let ends = |k: usize| [0, 1].map(|end| of(case, Some((k, end))).map_or(&results[0], |place| &results[place]));
        (0..sizes.len()).map(ends).collect()
    };
    let base = moved(0);
    let own = |case: usize| of(case, None).map_or(&results[0], |place| &results[place]);
    let widened = |case: usize| TwinMeasures {
        recorded: widen(&own(case).recorded, &moved(case), |twin| &twin.recorded),
        tested: widen(&own(case).tested, &moved(case), |twin| &twin.tested),
    };
    let found = widened(0);
    let as_found = Measure::ALL.map(|one| match measured.value(one) {
        Some(value) => Some(ExpectedValue { value, simulated: false }),
        None => found.tested.value(one).map(|value| ExpectedValue { value, simulated: true }),
    });
    let without = (1..cases.len())
        .map(|case| {
            let twin = widened(case);
            let expected = Measure::ALL.map(|one| {
                let alone = || twin.tested.value(one).map(|value| ExpectedValue { value, simulated: true });
                let pair = |a: &Measures, b: &Measures| Some(b.value(one)?.value - a.value(one)?.value);
                let Some(unit) = measured.value(one) else { return alone() };
                let Some(change) = pair(&own(0).recorded, &own(case).recorded) else { return alone() };
                let ends = base.iter().zip(moved(case)).map(|(before, after)| {
                    [0, 1].map(|end| pair(&before[end].recorded, &after[end].recorded).unwrap_or(change))
                });
                let sizes: f64 = ends.map(|[low, high]| (0.5 * (high - low)).powi(2)).sum();
                let twin_value = own(0).recorded.value(one).map_or(unit.value, |twin| twin.value);
                let half = 0.5 * (unit.high - unit.low);
                let missed = ((unit.value - twin_value).abs() - half).max(0.0) / twin_value.abs().max(1e-9);
                let half = (half * half + sizes + (change * missed.min(1.0)).powi(2)).sqrt();
                let value = (unit.value + change).max(0.0);
                let value = Interval { value, low: (unit.value + change - half).max(0.0), high: value + half };
                Some(ExpectedValue { value, simulated: false })
            });
            Without { removed: cases[case].clone(), twin, expected: expected.to_vec() }
        })
        .collect();
    Compared { measured, found, as_found: as_found.to_vec(), without }
}

/// Measures of the recordings alone.
pub fn measured_alone(recordings: &[Recording]) -> Compared {
    let measured = measure(&recordings.iter().filter_map(Series::measured).collect::<Vec<_>>());
    let of = |one: Measure| measured.value(one).map(|value| ExpectedValue { value, simulated: false });
    let nothing = TwinMeasures { recorded: measure(&[]), tested: measure(&[]) };
    Compared { as_found: Measure::ALL.map(of).to_vec(), measured, found: nothing, without: vec![] }
}

/// How many twins [`compare`] simulates.
pub fn simulations(found: &Unit, faults: &[String], sizes: &[SizeKnowledge]) -> usize {
    variants(found, &cases(faults), sizes).len()
}

/// What is taken out: nothing, each fault, and where there are several, all of them.
fn cases(faults: &[String]) -> Vec<Vec<String>> {
    let mut cases: Vec<Vec<String>> = vec![vec![]];
    cases.extend(faults.iter().map(|fault| vec![fault.clone()]));
    if faults.len() > 1 {
        cases.push(faults.to_vec());
    }
    cases
}

fn variants(found: &Unit, cases: &[Vec<String>], sizes: &[SizeKnowledge]) -> Vec<TwinVariant> {
    let mut all = vec![];
    for (case, removed) in cases.iter().enumerate() {
        let unit = without(found, removed);
        for (k, size) in sizes.iter().enumerate() {
            let place = unit.effects.iter().position(|setting| setting.id == size.effect);
            let Some(place) = place.filter(|&place| size.parameter < unit.effects[place].values.len()) else {
                continue;
            };
            for (end, value) in size.ends.into_iter().enumerate() {
                let mut unit = unit.clone();
                unit.effects[place].values[size.parameter] = value;
                all.push(TwinVariant { unit, case, moved: Some((k, end)) });
            }
        }
        all.push(TwinVariant { unit, case, moved: None });
    }
    all
}

/// The same unit without some effects.
pub fn without(unit: &Unit, removed: &[String]) -> Unit {
    let mut unit = unit.clone();
    unit.effects.retain(|setting| !removed.contains(&setting.id));
    unit
}

fn twin_measures(recordings: &[Recording], unit: &Unit) -> TwinMeasures {
    let series: Vec<Series> = recordings
        .into_par_iter()
        .filter_map(|recording| Series::simulated(recording, &simulate(&mut Twin::new(unit), recording)))
        .collect();
    TwinMeasures { recorded: measure(&series), tested: measure(&standard_tests::run(unit)) }
}

/// Measures whose intervals hold what the sizes of faults leave open too.
fn widen(own: &Measures, moved: &[[&TwinMeasures; 2]], of: impl Fn(&TwinMeasures) -> &Measures) -> Measures {
    let mut widened = own.clone();
    for found in &mut widened.found {
        let Some(value) = &mut found.value else { continue };
        let ends = moved
            .iter()
            .filter_map(|[low, high]| Some(of(high).value(found.measure)?.value - of(low).value(found.measure)?.value));
        let square: f64 = ends.map(|apart| (0.5 * apart).powi(2)).sum();
        let (below, above) = (value.value - value.low, value.high - value.value);
        value.low = (value.value - (below * below + square).sqrt()).max(0.0);
        value.high = value.value + (above * above + square).sqrt();
    }
    widened
}
