//! The paper's models with memory, LSTM and TCN, on the same rows and features: the only file that knows candle.
//!
//! Both read the last few rows of features, scaled by the training rows, and estimate the residual; loss and target are the trees':
//! mean absolute error of measured − twin. A sequence never leaves its recording, nor the part of the split that its last row is in.
//! Weights and order of rows are drawn from a seed. LSTM: Hochreiter and Schmidhuber 1997; TCN: Bai, Kolter and Koltun 2018.

use candle_core::{DType, Device, IndexOp, Result, Tensor};
use candle_nn::{AdamW, Linear, Module, Optimizer, ParamsAdamW, RNN, VarBuilder, VarMap, linear};
use rand::seq::SliceRandom;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::search::Hyperparameter;
use super::split::RowSplit;
use super::table::FeatureTable;

/// Rows that one step of the optimiser sees.
const BATCH: usize = 256;

/// Scaled features are cut here, in standard deviations.
const FARTHEST: f64 = 6.0;

/// Which network.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NetworkKind {
    /// Long short-term memory.
    Lstm,
    /// Temporal convolutional network: causal, dilated.
    Tcn,
}

/// The space of the search for both networks.
pub const SPACE: [Hyperparameter; 5] = [
    Hyperparameter { name: "width", group: "complexity", range: [8.0, 48.0], logarithmic: true, whole: true },
    Hyperparameter { name: "layers", group: "complexity", range: [1.0, 3.0], logarithmic: false, whole: true },
    Hyperparameter { name: "length", group: "complexity", range: [3.0, 10.0], logarithmic: false, whole: true },
    Hyperparameter { name: "epochs", group: "regularisation", range: [3.0, 12.0], logarithmic: false, whole: true },
    Hyperparameter {
        name: "learning_rate",
        group: "regularisation",
        range: [5e-4, 1e-2],
        logarithmic: true,
        whole: false,
    },
];

struct NetShape {
    width: usize,
    layers: usize,
    length: usize,
    epochs: usize,
    rate_coefficient: f64,
}

impl NetShape {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "whole numbers from 1 to 48, by the space"
    )]
    fn at(point: &[f64]) -> Self {
        let value = |index: usize| point.get(index).copied().unwrap_or_else(|| SPACE[index].value(0.5));
        let whole = |index: usize| value(index).round().max(1.0) as usize;
        Self { width: whole(0), layers: whole(1), length: whole(2), epochs: whole(3), rate_coefficient: value(4) }
    }
}

enum Layers {
    Lstm(Vec<candle_nn::LSTM>),
    /// Per layer three taps, newest first, and their dilation.
    Tcn(Vec<([Linear; 3], usize)>),
}

struct Network {
    entry: Linear,
    layers: Layers,
    head: Linear,
}

impl Network {
    fn new(kind: NetworkKind, shape: &NetShape, features: usize, vars: &VarBuilder) -> Result<Self> {
        let width = shape.width;
        let layers = match kind {
            NetworkKind::Lstm => {
                let layer =
                    |k| candle_nn::lstm(width, width, candle_nn::LSTMConfig::default(), vars.pp(format!("lstm{k}")));
                Layers::Lstm((0..shape.layers).map(layer).collect::<Result<_>>()?)
            }
            NetworkKind::Tcn => {
                let tap = |k, tap| linear(width, width, vars.pp(format!("tcn{k}tap{tap}")));
                let layer = |k: usize| -> Result<_> { Ok(([tap(k, 0)?, tap(k, 1)?, tap(k, 2)?], 1_usize << k)) };
                Layers::Tcn((0..shape.layers).map(layer).collect::<Result<_>>()?)
            }
        };
        Ok(Self { entry: linear(features, width, vars.pp("entry"))?, layers, head: linear(width, 1, vars.pp("head"))? })
    }

    /// Sequences as (rows, length, features), oldest first; one value for each row.
    fn forward(&self, sequences: &Tensor) -> Result<Tensor> {
        let mut values = self.entry.forward(sequences)?;
        let length = values.dim(1)?;
        match &self.layers {
            Layers::Lstm(layers) => {
                for layer in layers {
                    let states = layer.seq(&values)?;
                    let hidden: Vec<Tensor> = states.iter().map(|state| state.h().clone()).collect();
                    values = Tensor::stack(&hidden, 1)?;
                }
            }
            Layers::Tcn(layers) => {
                for (taps, dilation) in layers {
                    let padded = values.pad_with_zeros(1, 2 * dilation, 0)?;
                    let mut sum = taps[0].forward(&values)?;
                    for (back, tap) in taps.iter().enumerate().skip(1) {
                        let shifted = padded.narrow(1, (2 - back) * dilation, length)?.contiguous()?;
                        sum = (sum + tap.forward(&shifted)?)?;
                    }
                    values = (values + sum.relu()?)?;
                }
            }
        }
        let last = values.i((.., length - 1, ..))?.contiguous()?;
        self.head.forward(&last)?.squeeze(1)
    }
}

/// Rows as a network sees them.
struct Scaled<'a> {
    table: &'a FeatureTable,
    middles: Vec<f64>,
    spreads: Vec<f64>,
    /// The part of the split that each row is in.
    part: Vec<u8>,
}

impl Scaled<'_> {
    /// The sequences that end at `rows`; where one would leave its recording or part, its oldest row repeats.
    #[expect(clippy::cast_possible_truncation, reason = "networks run in single precision")]
    fn sequences(&self, rows: &[usize], length: usize) -> Result<Tensor> {
        let width = self.middles.len();
        let mut values = Vec::with_capacity(rows.len() * length * width);
        for &row in rows {
            let mut oldest = row;
            let marks = &self.table.marks;
            while oldest > 0
                && row - oldest + 1 < length
                && marks[oldest - 1].recording == marks[row].recording
                && self.part[oldest - 1] == self.part[row]
            {
                oldest -= 1;
            }
            let missing = length - (row - oldest + 1);
            for at in std::iter::repeat_n(oldest, missing).chain(oldest..=row) {
                let scales = self.middles.iter().zip(&self.spreads);
                let scaled = self.table.row(at).iter().zip(scales);
                values
                    .extend(scaled.map(|(value, (middle, spread))| {
                        ((value - middle) / spread).clamp(-FARTHEST, FARTHEST) as f32
                    }));
            }
        }
        Tensor::from_vec(values, (rows.len(), length, width), &Device::Cpu)
    }
}

fn middle_and_spread(values: impl Iterator<Item = f64> + Clone) -> (f64, f64) {
    let count = values.clone().count().max(1) as f64;
    let middle = values.clone().sum::<f64>() / count;
    let spread = (values.map(|value| (value - middle).powi(2)).sum::<f64>() / count).sqrt();
    (middle, if spread > 1e-12 * (1.0 + middle.abs()) { spread } else { 1.0 })
}

/// Trains a network on the residuals of the training rows and returns its output for the test rows. Of each, only every
/// `every`-th row ends a sequence; the rows between still stand in it.
///
/// # Errors
/// Where the library refuses, or where there is nothing to learn from.
#[expect(clippy::cast_possible_truncation, reason = "networks run in single precision")]
pub fn residuals(
    kind: NetworkKind,
    table: &FeatureTable,
    split: &RowSplit,
    every: usize,
    point: &[f64],
    seed: u64,
) -> Result<Vec<f64>> {
    let sparse = |rows: &[usize]| -> Vec<usize> { rows.iter().copied().step_by(every.max(1)).collect() };
    let (train, test) = (sparse(&split.train), sparse(&split.test));
    if train.is_empty() || test.is_empty() {
        candle_core::bail!("{} rows teach and {} judge: too little data", train.len(), test.len());
    }
    let shape = NetShape::at(point);
    let features = table.layout.features.len();
    let column = |index: usize| train.iter().map(move |&row| table.row(row)[index]);
    let (middles, spreads) = (0..features).map(|index| middle_and_spread(column(index))).unzip();
    let mut part = vec![0; table.marks.len()];
    split.train.iter().for_each(|&row| part[row] = 1);
    split.test.iter().for_each(|&row| part[row] = 2);
    let scaled = Scaled { table, middles, spreads, part };
    let (middle, spread) = middle_and_spread(train.iter().map(|&row| table.marks[row].residual()));

    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let vars = VarMap::new();
    let network = Network::new(kind, &shape, features, &VarBuilder::from_varmap(&vars, DType::F32, &Device::Cpu))?;
    draw_weights(&vars, &mut random)?;
    let decay = ParamsAdamW { lr: shape.rate_coefficient, weight_decay: 1e-4, ..ParamsAdamW::default() };
    let mut parameters = named(&vars)?;
    let mut optimiser = AdamW::new(parameters.drain(..).map(|(_, var)| var).collect(), decay)?;
    let mut order = train.clone();
    let epochs = u32::try_from(shape.epochs).unwrap_or(1);
    for epoch in 0..epochs {
        // The rate falls to a tenth over the epochs.
        optimiser.set_learning_rate(shape.rate_coefficient * (1.0 - 0.9 * f64::from(epoch) / f64::from(epochs)));
        order.shuffle(&mut random);
        for rows in order.chunks(BATCH) {
            let target = |&row: &usize| ((table.marks[row].residual() - middle) / spread) as f32;
            let targets = Tensor::from_vec(rows.iter().map(target).collect::<Vec<_>>(), rows.len(), &Device::Cpu)?;
            let said = network.forward(&scaled.sequences(rows, shape.length)?)?;
            optimiser.backward_step(&(said - targets)?.abs()?.mean_all()?)?;
        }
    }
    let mut all = Vec::with_capacity(test.len());
    for rows in test.chunks(4 * BATCH) {
        let said: Vec<f32> = network.forward(&scaled.sequences(rows, shape.length)?)?.to_vec1()?;
        all.extend(said.into_iter().map(|value| middle + spread * f64::from(value)));
    }
    Ok(all)
}

/// All weights by name, in the order of their names.
fn named(vars: &VarMap) -> Result<Vec<(String, candle_core::Var)>> {
    let Ok(data) = vars.data().lock() else { candle_core::bail!("the weights are locked") };
    let mut named: Vec<_> = data.iter().map(|(name, var)| (name.clone(), var.clone())).collect();
    named.sort_by(|a, b| a.0.cmp(&b.0));
    Ok(named)
}

/// Weights from a seed, since the library draws its own without one.
fn draw_weights(vars: &VarMap, random: &mut ChaCha8Rng) -> Result<()> {
    for (_, var) in named(vars)? {
        let dims = var.dims().to_vec();
        let inputs = dims.last().copied().unwrap_or(1).max(1);
        let reach = 1.0 / (inputs as f32).sqrt();
        let count = dims.iter().product();
        let values: Vec<f32> = (0..count).map(|_| random.random_range(-reach..reach)).collect();
        var.set(&Tensor::from_vec(values, dims, &Device::Cpu)?)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use candle_core::IndexOp;

    use super::{NetworkKind, SPACE, Scaled, residuals};
    use crate::split::{RowSplit, seven_to_three};
    use crate::table::tests::{of, recording};

    #[test]
    fn both_networks_learn_and_repeat_by_seed() {
        let gap = |frame: &govtwin_model::frame::Frame, _| 0.2 * (frame.inputs.opening_command_pu - 0.4);
        let recordings: Vec<_> = (0..3).map(|k| recording(&format!("{k}"), 500 * k, 300, gap)).collect();
        let table = of(&recordings);
        let split = seven_to_three(&table);
        let point = SPACE.map(|dimension| dimension.value(0.6));
        for kind in [NetworkKind::Lstm, NetworkKind::Tcn] {
            let said = residuals(kind, &table, &split, 1, &point, 1).unwrap();
            assert_eq!(said, residuals(kind, &table, &split, 1, &point, 1).unwrap());
            let (mut before, mut after) = (0.0, 0.0);
            for (&row, said) in split.test.iter().zip(&said) {
                before += table.marks[row].residual().abs();
                after += (table.marks[row].residual() - said).abs();
            }
            assert!(after < 0.6 * before, "{kind:?}: {after} against {before}");
        }
        let untaught = RowSplit { train: vec![], ..split };
        assert!(residuals(NetworkKind::Tcn, &table, &untaught, 1, &point, 1).is_err());
    }

    #[test]
    fn a_sequence_stays_in_its_recording_and_its_part_also_where_rows_are_sparse() {
        let recordings: Vec<_> = (0..2).map(|k| recording(&format!("{k}"), 100 * k, 40, |_, _| 0.0)).collect();
        let table = of(&recordings);
        let width = table.layout.features.len();
        let part = (0..80).map(|row| u8::from(row % 40 >= 20)).collect();
        let scaled = Scaled { table: &table, middles: vec![0.0; width], spreads: vec![1.0; width], part };
        let commands =
            |row: usize| -> Vec<f32> { scaled.sequences(&[row], 4).unwrap().i((0, .., 0)).unwrap().to_vec1().unwrap() };
        let command = |row: usize| table.row(row)[0] as f32;
        assert_eq!(commands(30), [27, 28, 29, 30].map(command));
        assert_eq!(commands(21), [20, 20, 20, 21].map(command));
        assert_eq!(commands(40), [40; 4].map(command));
    }
}
