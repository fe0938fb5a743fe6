//! Ageing: which sizes of a unit changed from period to period by more than their intervals allow.
//!
//! Each value is compared with the mean of those before it, and their distances are summed up, as [`crate::trend`] has it, whose parts these are. A
//! month's few values teach no scatter: what the intervals promise is believed, so that a change shows from the second value on. The limit is such
//! that a whole fleet in which nothing changes gives one false alarm in ten gathers. Sizes that the recordings do not determine take no part.

use std::collections::BTreeMap;

use super::result::{FoundCause, SizeInterval};
use crate::trend::{Level, NORMAL_90_EXACT, Sums, run_length};

/// The limit is never lower than this: the usual one for a single series.
const LEAST_LIMIT: f64 = 5.0;

/// False alarms that are expected in a fleet in which nothing changes.
const FALSE_ALARMS: f64 = 0.1;

/// One size of a unit over its periods.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Trend {
    /// What it is: the key of a sheet's parameter, or an effect's id and its parameter joined by a point.
    pub name: String,
    /// Its unit.
    pub unit: String,
    /// In the order of periods.
    pub points: Vec<PeriodSize>,
}

/// A size in a period.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PeriodSize {
    /// The period.
    pub period: String,
    /// The value; in the trend's unit.
    pub value: f64,
    /// Lower end of the 90 % interval; in the trend's unit.
    pub low: f64,
    /// Upper end; in the trend's unit.
    pub high: f64,
    /// The larger of both cumulative sums so far, negative where it is that downwards; no unit, 1.
    pub cumulative_sum: f64,
    /// The sum is beyond the limit.
    pub changed: bool,
}

/// The sizes of a unit that its recordings determine, each over the periods in which they do.
pub fn trends<'a>(periods: impl Iterator<Item = (&'a str, &'a FoundCause)>) -> Vec<Trend> {
    let mut all: BTreeMap<String, Trend> = BTreeMap::new();
    for (period, found) in periods {
        let parameters = found.parameters.iter().map(|size| (size.name.clone(), size));
        let named = found.causes.iter().filter(|_| found.names_causes());
        let effects =
            named.flat_map(|cause| cause.sizes.iter().map(|size| (format!("{}.{}", cause.id, size.name), size)));
        for (name, size) in parameters.chain(effects).filter(|(_, size)| size.is_determined()) {
            let SizeInterval { value: Some(value), low: Some(low), high: Some(high), .. } = *size else { continue };
            let trend =
                all.entry(name.clone()).or_insert_with(|| Trend { name, unit: size.unit.clone(), points: vec![] });
            trend.points.push(PeriodSize { period: period.to_owned(), value, low, high, ..PeriodSize::default() });
        }
    }
    all.into_values().collect()
}

/// Sums up the trends of a fleet, and marks what is beyond the limit; hands out the limit.
pub fn sum_up<'a>(trends: impl Iterator<Item = &'a mut Trend>) -> f64 {
    let all: Vec<&mut Trend> = trends.collect();
    let comparisons: usize = all.iter().map(|trend| trend.points.len().saturating_sub(1)).sum();
    let limit = limit(comparisons);
    for trend in all {
        sum_up_one(&mut trend.points, limit);
    }
    limit
}

fn sum_up_one(points: &mut [PeriodSize], limit: f64) {
    let (mut level, mut sums) = (Level::default(), Sums::default());
    for point in points {
        // The wider half of the interval represents both.
        let sd = (point.high - point.value).max(point.value - point.low) / NORMAL_90_EXACT;
        if let Some(residual) = level.residual(point.value, sd) {
            sums.take(residual);
        }
        point.cumulative_sum = if sums.is_growth() { sums.growth } else { -sums.shrinkage };
        point.changed = sums.largest() > limit;
        level.take(point.value, sd);
    }
}

/// The limit at which so many comparisons are expected to give [`FALSE_ALARMS`], by how long the sums run until their first one ([`run_length`]).
pub fn limit(comparisons: usize) -> f64 {
    let mut limit = LEAST_LIMIT;
    while comparisons as f64 / run_length(limit) > FALSE_ALARMS {
        limit += 0.1;
    }
    limit
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng as _;
    use rand_distr::{Distribution as _, Normal};

    use super::*;
    use crate::fleet::result::Cause;

    fn trend(values: impl IntoIterator<Item = f64>, sigma: f64) -> Trend {
        let half = NORMAL_90_EXACT * sigma;
        let point = |value: f64| PeriodSize { value, low: value - half, high: value + half, ..PeriodSize::default() };
        Trend { points: values.into_iter().map(point).collect(), ..Trend::default() }
    }

    #[test]
    fn a_fleet_in_which_nothing_changes_gives_few_alarms_and_a_change_gives_one() {
        let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(7);
        let noise = Normal::new(0.0, 1.0).unwrap();
        let mut alarms = 0;
        for _ in 0..20 {
            let mut fleet: Vec<Trend> =
                (0..500).map(|_| trend((0..24).map(|_| noise.sample(&mut random)), 1.0)).collect();
            sum_up(fleet.iter_mut());
            alarms += fleet.iter().filter(|one| one.points.iter().any(|point| point.changed)).count();
        }
        // Expected are two in twenty such fleets, at most.
        assert!(alarms <= 6, "{alarms} false alarms");
        let mut stepped: Vec<Trend> = (0..200)
            .map(|_| trend((0..24).map(|period| noise.sample(&mut random) + if period < 12 { 0.0 } else { 4.0 }), 1.0))
            .collect();
        sum_up(stepped.iter_mut());
        let seen = stepped.iter().filter(|one| one.points[12..].iter().any(|point| point.changed)).count();
        let early = stepped.iter().filter(|one| one.points[..12].iter().any(|point| point.changed)).count();
        assert!(seen >= 190 && early == 0, "{seen} of 200 steps of four deviations seen, {early} before they were");
    }

    #[test]
    fn a_change_has_a_direction_and_a_wide_interval_hides_it() {
        let mut one = trend([1.0, 1.0, 1.0, 0.0], 0.1);
        sum_up([&mut one].into_iter());
        assert!(one.points[3].changed && one.points[3].cumulative_sum < -5.0 && !one.points[2].changed);
        let mut wide = trend([1.0, 1.0, 1.0, 0.0], 2.0);
        sum_up([&mut wide].into_iter());
        assert!(!wide.points[3].changed);
    }

    #[test]
    fn what_the_recordings_do_not_determine_never_drifts() {
        let size = |value: f64| SizeInterval {
            name: "x_pu".into(),
            unit: "pu".into(),
            value: Some(value),
            low: Some(value - 0.01),
            high: Some(value + 0.01),
            ..SizeInterval::default()
        };
        let finding = |verdict: &str, value: f64, information: f64| FoundCause {
            verdict: verdict.into(),
            causes: vec![Cause { id: "load".into(), sizes: vec![size(value)], ..Cause::default() }],
            parameters: vec![SizeInterval { information_share: Some(information), ..size(value) }],
            ..FoundCause::default()
        };
        let of = |all: &[(&str, FoundCause)]| {
            let mut trends = trends(all.iter().map(|(period, found)| (*period, found)));
            sum_up(trends.iter_mut());
            trends
        };
        let known = of(&[("1", finding("named", 0.0, 0.9)), ("2", finding("named", 1.0, 0.9))]);
        assert_eq!(known.len(), 2);
        assert!(known.iter().all(|trend| trend.points[1].changed));
        let unknown = of(&[("1", finding("class", 0.0, 0.1)), ("2", finding("class", 1.0, 0.1))]);
        assert!(unknown.is_empty(), "{unknown:?}");
        // A period that does not determine the size gives a gap, not a zero.
        let gap = of(&[
            ("1", finding("named", 0.5, 0.9)),
            ("2", finding("class", 0.0, 0.1)),
            ("3", finding("named", 0.5, 0.9)),
        ]);
        assert!(gap.iter().all(|trend| trend.points.len() == 2 && !trend.points[1].changed));
    }

    #[test]
    fn the_limit_rises_with_the_size_of_the_fleet() {
        assert_eq!(limit(0), LEAST_LIMIT);
        assert!(limit(100_000) > limit(1000) && limit(100_000_000) < 25.0);
    }
}
