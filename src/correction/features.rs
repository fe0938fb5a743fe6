//! The features of a row (Liu et al. 2025, Table 1's groups): one list, causal, the same code in training and live.
//!
//! | group | what |
//! |---|---|
//! | original | command, opening, tank pressure, ESV state |
//! | interaction | command − opening, and products of originals |
//! | lag | originals and their difference a few periods ago, and their rates |
//! | rolling | mean, spread, lowest and highest of the last periods |
//! | model | the twin's estimate, its derivatives, its lags and its inner signals |
//! | trend | slope over the last periods, and how much of the motion it explains |
//!
//! No feature holds the measured signal that is to be corrected, so that a free run needs none.

use super::history::{PAST, Taps};
use super::row::RowChannel;
use govtwin_model::stored::with_words;
use govtwin_model::units::seconds_from_nanos;

with_words! {
    /// Table 1's groups.
    #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
    pub enum FeatureGroup: title {
        /// The inputs as they are.
        Original = "original",
        /// Combinations of inputs.
        Interaction = "interaction",
        /// Inputs some periods ago.
        Lag = "lag",
        /// Statistics of a window that ends now.
        Rolling = "rolling",
        /// The twin's output, its derivatives and inner signals.
        Model = "model",
        /// Persistence of a trend.
        Trend = "trend strength",
    }
}

/// How a feature is made of the taps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum FeatureKind {
    Now,
    Times(RowChannel),
    Lag(usize),
    Rate,
    Bend,
    Mean(usize),
    Spread(usize),
    Lowest(usize),
    Highest(usize),
    Slope(usize),
    Strength(usize),
}

/// One feature.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Feature {
    group: FeatureGroup,
    channel: RowChannel,
    kind: FeatureKind,
}

const LAGS: [usize; 4] = [1, 2, 3, 5];
const WINDOWS: [usize; 2] = [5, PAST];

/// All features, in the order of a model's list.
pub fn all() -> Vec<Feature> {
    use FeatureKind::{Bend, Highest, Lag, Lowest, Mean, Now, Rate, Slope, Spread, Strength, Times};
    use RowChannel::{Command, Error, Esv, Model, Opening, TankPressure};
    let mut list = vec![];
    let mut add = |group, channel, kind| list.push(Feature { group, channel, kind });
    for channel in [Command, Opening, TankPressure, Esv] {
        add(FeatureGroup::Original, channel, Now);
    }
    add(FeatureGroup::Interaction, Error, Now);
    for (one, other) in
        [(Error, TankPressure), (Error, Esv), (Error, Opening), (Command, TankPressure), (Opening, TankPressure)]
    {
        add(FeatureGroup::Interaction, one, Times(other));
    }
    for channel in [Command, Opening, Error] {
        for lag in LAGS {
            add(FeatureGroup::Lag, channel, Lag(lag));
        }
    }
    for channel in [Command, Opening, Error] {
        add(FeatureGroup::Lag, channel, Rate);
        add(FeatureGroup::Lag, channel, Bend);
    }
    for (channel, lag) in [(TankPressure, 1), (TankPressure, 5), (Esv, 1), (Esv, 2), (Esv, 5)] {
        add(FeatureGroup::Lag, channel, Lag(lag));
    }
    for channel in [Command, Opening, Error, TankPressure] {
        for window in WINDOWS {
            add(FeatureGroup::Rolling, channel, Mean(window));
            add(FeatureGroup::Rolling, channel, Spread(window));
        }
    }
    for window in WINDOWS {
        add(FeatureGroup::Rolling, Error, Lowest(window));
        add(FeatureGroup::Rolling, Error, Highest(window));
    }
    for channel in RowChannel::ALL.into_iter().filter(|channel| channel.is_model()) {
        add(FeatureGroup::Model, channel, Now);
    }
    for kind in [Rate, Bend, Lag(1), Lag(2), Lag(3), Mean(5), Spread(5)] {
        add(FeatureGroup::Model, Model, kind);
    }
    for channel in [Command, Opening, Error] {
        add(FeatureGroup::Trend, channel, Slope(5));
        add(FeatureGroup::Trend, channel, Strength(PAST));
    }
    add(FeatureGroup::Trend, Model, Slope(5));
    add(FeatureGroup::Trend, Model, Strength(PAST));
    list
}

/// The feature with this name.
pub fn named(name: &str) -> Option<Feature> {
    all().into_iter().find(|feature| feature.name() == name)
}

impl Feature {
    /// Its group in Table 1.
    pub fn group(&self) -> FeatureGroup {
        self.group
    }

    /// The channel that it is made of.
    pub fn channel(&self) -> RowChannel {
        self.channel
    }

    /// Whether it is the present value of a channel.
    pub fn is_now(&self) -> bool {
        self.kind == FeatureKind::Now
    }

    /// Whether it is the rate or the bend of an input, which the paper's list lacks.
    pub fn is_rate_of_input(&self) -> bool {
        !self.channel.is_model() && matches!(self.kind, FeatureKind::Rate | FeatureKind::Bend)
    }

    /// The name in model files: channel, then what is made of it, with periods as the unit of lags and windows.
    pub fn name(&self) -> String {
        let channel = self.channel.id();
        match self.kind {
            FeatureKind::Now => channel.to_owned(),
            FeatureKind::Times(other) => format!("{channel}*{}", other.id()),
            FeatureKind::Lag(lag) => format!("{channel}.lag{lag}"),
            FeatureKind::Rate => format!("{channel}.rate"),
            FeatureKind::Bend => format!("{channel}.bend"),
            FeatureKind::Mean(window) => format!("{channel}.mean{window}"),
            FeatureKind::Spread(window) => format!("{channel}.spread{window}"),
            FeatureKind::Lowest(window) => format!("{channel}.lowest{window}"),
            FeatureKind::Highest(window) => format!("{channel}.highest{window}"),
            FeatureKind::Slope(window) => format!("{channel}.slope{window}"),
            FeatureKind::Strength(window) => format!("{channel}.strength{window}"),
        }
    }

    /// Its value; derivatives and slopes are per second.
    pub fn value(&self, taps: &Taps, period_s: f64) -> f64 {
        let at = |k: usize| taps[k][self.channel as usize];
        let window = |len: usize| taps[..len].iter().map(|tap| tap[self.channel as usize]);
        match self.kind {
            FeatureKind::Now => at(0),
            FeatureKind::Times(other) => at(0) * taps[0][other as usize],
            FeatureKind::Lag(lag) => at(lag),
            FeatureKind::Rate => (at(0) - at(1)) / period_s,
            FeatureKind::Bend => (at(0) - 2.0 * at(1) + at(2)) / (period_s * period_s),
            FeatureKind::Mean(len) => mean(window(len), len),
            FeatureKind::Spread(len) => {
                let mean = mean(window(len), len);
                (window(len).map(|value| (value - mean) * (value - mean)).sum::<f64>() / len as f64).sqrt()
            }
            FeatureKind::Lowest(len) => window(len).fold(f64::INFINITY, f64::min),
            FeatureKind::Highest(len) => window(len).fold(f64::NEG_INFINITY, f64::max),
            FeatureKind::Slope(len) => slope(window(len), len) / period_s,
            FeatureKind::Strength(len) => strength(window(len), len),
        }
    }
}

/// All values of a row, into `values`, which is as long as `features`. Allocates nothing.
pub fn fill(features: &[Feature], taps: &Taps, period_ns: i64, values: &mut [f64]) {
    let period_s = seconds_from_nanos(period_ns);
    for (feature, value) in features.iter().zip(values) {
        *value = feature.value(taps, period_s);
    }
}

fn mean(values: impl Iterator<Item = f64>, len: usize) -> f64 {
    values.sum::<f64>() / len as f64
}

/// Least-squares slope per row of a window whose first value is the newest.
fn slope(values: impl Iterator<Item = f64> + Clone, len: usize) -> f64 {
    let (n, mean) = (len as f64, mean(values.clone(), len));
    let middle = 0.5 * (n - 1.0);
    let along: f64 = values.enumerate().map(|(k, value)| (middle - k as f64) * (value - mean)).sum();
    along / (n * (n * n - 1.0) / 12.0)
}

/// Share of a window's spread that a straight line explains, with the sign of its slope; 0 where nothing moves.
fn strength(values: impl Iterator<Item = f64> + Clone, len: usize) -> f64 {
    let (n, mean) = (len as f64, mean(values.clone(), len));
    let spread: f64 = values.clone().map(|value| (value - mean) * (value - mean)).sum();
    let slope = slope(values, len);
    let explained = slope * slope * n * (n * n - 1.0) / 12.0;
    // Rounding alone moves a constant by less than this.
    if spread <= 1e-18 * (1.0 + mean * mean) { 0.0 * spread } else { (explained / spread).min(1.0).copysign(slope) }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use approx::assert_relative_eq;
    use proptest::prelude::{Strategy, prop};
    use proptest::{prop_assert_eq, proptest};

    use super::{all, fill, named};
    use crate::history::History;
    use crate::row::{ChannelRow, RowChannel};

    const PERIOD_NS: i64 = 200_000_000;

    fn rows(len: usize) -> impl Strategy<Value = Vec<ChannelRow>> {
        prop::collection::vec(prop::array::uniform12(-2.0..2.0), len)
    }

    fn stream(rows: &[ChannelRow], step_ns: i64) -> Vec<Vec<u64>> {
        let features = all();
        let mut history = History::new(PERIOD_NS);
        let mut values = vec![0.0; features.len()];
        (0_i64..)
            .zip(rows)
            .map(|(k, row)| {
                fill(&features, history.push(k * step_ns, row), PERIOD_NS, &mut values);
                values.iter().map(|value| value.to_bits()).collect()
            })
            .collect()
    }

    #[test]
    fn names_are_unique_and_lead_back() {
        let names: BTreeSet<String> = all().iter().map(super::Feature::name).collect();
        assert_eq!(names.len(), all().len());
        assert!(all().iter().all(|feature| named(&feature.name()) == Some(*feature)));
        assert_eq!(named("tomorrow_pu"), None);
    }

    #[test]
    fn a_ramp_in_closed_form() {
        let mut history = History::new(PERIOD_NS);
        let mut values = vec![0.0; all().len()];
        for k in 0_u32..40 {
            let row = [0.01 * f64::from(k); RowChannel::ALL.len()];
            fill(&all(), history.push(i64::from(k) * PERIOD_NS, &row), PERIOD_NS, &mut values);
        }
        let value = |name: &str| values[all().iter().position(|feature| feature.name() == name).unwrap()];
        assert_relative_eq!(value("command_pu"), 0.39);
        assert_relative_eq!(value("command_pu.lag5"), 0.34);
        assert_relative_eq!(value("command_pu.mean5"), 0.37, epsilon = 1e-12);
        assert_relative_eq!(value("command_pu.spread5"), 0.01 * 2.0_f64.sqrt(), epsilon = 1e-12);
        assert_relative_eq!(value("error_pu.lowest5"), 0.35);
        assert_relative_eq!(value("error_pu.highest10"), 0.39);
        assert_relative_eq!(value("model.rate"), 0.05, epsilon = 1e-12);
        assert_relative_eq!(value("model.bend"), 0.0, epsilon = 1e-12);
        assert_relative_eq!(value("command_pu.slope5"), 0.05, epsilon = 1e-12);
        assert_relative_eq!(value("command_pu.strength10"), 1.0, epsilon = 1e-9);
        assert_relative_eq!(value("error_pu*tank_pressure_pa"), 0.39 * 0.39);
    }

    proptest! {
        /// The same list written the other way round: whole columns, indices into the past, no ring, no cursors.
        #[test]
        fn a_stream_equals_the_batch_bit_for_bit(rows in rows(60)) {
            let features = all();
            let streamed = stream(&rows, PERIOD_NS);
            for (at, row) in streamed.iter().enumerate() {
                let taps = std::array::from_fn(|back| rows[at.saturating_sub(back)]);
                let batch: Vec<u64> = features.iter().map(|feature| feature.value(&taps, 0.2).to_bits()).collect();
                prop_assert_eq!(row, &batch);
            }
        }

        /// A model trained on slow rows meets the very same numbers in a fast node.
        #[test]
        fn a_fast_stream_shows_the_slow_ones_features(rows in rows(30)) {
            let slow = stream(&rows, PERIOD_NS);
            let fast_rows: Vec<ChannelRow> = (0..29 * 200 + 1).map(|k| rows[k / 200]).collect();
            let fast = stream(&fast_rows, 1_000_000);
            for (k, row) in slow.iter().enumerate() {
                prop_assert_eq!(row, &fast[k * 200]);
            }
        }

        #[test]
        fn the_future_changes_nothing(rows in rows(40), other in rows(40), cut in 1_usize..40) {
            let mut changed = rows.clone();
            changed[cut..].clone_from_slice(&other[cut..]);
            prop_assert_eq!(&stream(&rows, PERIOD_NS)[..cut], &stream(&changed, PERIOD_NS)[..cut]);
        }
    }
}
