//! The limit of any model: the error of a twin against itself, with the noise in its regulator's readings drawn anew.
//!
//! Two runs of one unit along the same recorded inputs differ by what the noise inside the loop does to valve and spool, and by nothing else, each read by its recorder's transducer.
//! The best estimate of one of them is their mean, so that `(one − other)/√2` is an error of the size that is left to a model that knows all but the
//! noise.
//!
//! [`LimitKnowledge::Rows`] adds what a recorder of slow rows hides from every model that it feeds: the noise of the recorded opening, which replaces the
//! regulator's own reading, and the command between rows. The command is taken to wander there as it wanders from row to row, as a Brownian bridge
//! whose step is the median of the second differences around. The regulator multiplies both, and jumps over the dead band where they cross its edge.

use super::Contender;
use govtwin_correction::table::FeatureTable;
use govtwin_diagnosis::generate::noise::{Draws, Purpose, RandomStreams, Transducer, hearing};
use govtwin_model::frame::Estimate;
use govtwin_model::frame::Frame;
use govtwin_model::parameters::Unit;
use govtwin_model::recording::{Process, Recording};
use govtwin_model::replay::between::drawn;
use govtwin_model::replay::simulate;
use govtwin_model::solver::Method;
use govtwin_model::twin::{Cut, Twin};

/// Rows on each side from which the wandering of a command is estimated.
const AROUND: usize = 25;

/// What the model at the limit knows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LimitKnowledge {
    /// All but the noise in the loop.
    Inputs,
    /// The recorded rows alone.
    Rows,
}

/// An error of the size of the limit at each of some rows of a table, which was made of these recordings.
pub fn limit(
    unit: &Unit,
    cut: Cut,
    (recordings, grid_ns): (&[Recording], i64),
    (table, rows): (&FeatureTable, &[usize]),
    (known, seed): (LimitKnowledge, u64),
) -> Contender {
    let [one, other] = [2 * seed, 2 * seed + 1].map(|seed| {
        let run = |recording: &Recording| {
            let mut recording = recording.clone();
            let random = RandomStreams { seed, process: recording.process };
            if known == LimitKnowledge::Rows && cut == Cut::Servomotor {
                let mut reader = Transducer::new(unit.sensors.servomotor_position_pu, random.of(Purpose::Servomotor));
                for frame in &mut recording.frames {
                    let position_pu = &mut frame.measured.servomotor_position_pu;
                    *position_pu = reader.read(*position_pu);
                }
            }
            let (mut between, rows) = drawn(&recording, grid_ns);
            if known == LimitKnowledge::Rows {
                wander(&mut between.frames, &rows, &mut random.of(Purpose::Command));
            }
            let estimates = simulate(&mut noisy(unit, &recording, seed).with_cut(cut), &between);
            rows.iter().filter_map(|&row| estimates.get(row).copied()).collect()
        };
        recordings.iter().map(run).collect::<Vec<Vec<Estimate>>>()
    });
    let signal = table.layout.signal;
    let reader = |seed: u64| {
        let random = RandomStreams { seed, process: Process::Startup };
        Transducer::new(signal.sensor(&unit.sensors), random.of(Purpose::Spool))
    };
    let (mut reader, mut another) = (reader(2 * seed), reader(2 * seed + 1));
    let estimates = rows.iter().map(|&row| {
        let mark = &table.marks[row];
        let of = |runs: &[Vec<Estimate>]| signal.of(&runs[mark.recording][mark.frame].signals);
        mark.measured + (reader.read(of(&one)) - another.read(of(&other))) * std::f64::consts::FRAC_1_SQRT_2
    });
    let (id, title) = match known {
        LimitKnowledge::Inputs => ("limit", "limit: the noise in the loop, redrawn"),
        LimitKnowledge::Rows => {
            ("limit_rows", "limit: that, the recorded opening's noise and the command between rows")
        }
    };
    Contender { id, title, estimates: estimates.collect() }
}

/// Lets the command wander between rows, which stay as they are.
fn wander(frames: &mut [Frame], rows: &[usize], draws: &mut Draws) {
    let commands: Vec<f64> = rows.iter().map(|&row| frames[row].inputs.opening_command_pu).collect();
    for (pause, ends) in rows.windows(2).enumerate() {
        let near = &commands[pause.saturating_sub(AROUND)..(pause + AROUND + 2).min(commands.len())];
        let mut bends: Vec<f64> = near.windows(3).map(|three| (three[0] - 2.0 * three[1] + three[2]).abs()).collect();
        bends.retain(|bend| bend.is_finite());
        bends.sort_by(f64::total_cmp);
        // The second difference of a walk has √2 times its step's spread; the median of normal numbers is 0.6745 of theirs.
        let step_pu =
            bends.get(bends.len() / 2).map_or(0.0, |middle| middle / 0.6745 * std::f64::consts::FRAC_1_SQRT_2);
        let count = (ends[1] - ends[0]) as f64;
        let mut sum_pu = 0.0;
        let walk: Vec<f64> = (ends[0]..ends[1])
            .map(|_| {
                sum_pu += step_pu / count.sqrt() * draws.normal();
                sum_pu
            })
            .collect();
        for (k, frame) in frames[ends[0] + 1..ends[1]].iter_mut().enumerate() {
            frame.inputs.opening_command_pu += walk[k] - (k + 1) as f64 / count * sum_pu;
        }
    }
}

/// A twin with noise in its regulator's readings.
fn noisy(unit: &Unit, recording: &Recording, seed: u64) -> Twin {
    let random = RandomStreams { seed, process: recording.process };
    let plant = hearing(unit, &random, recording.duration_s());
    Twin::of_plant(plant, unit.parameters.oil.tank_pressure_pa, Method::default())
}

#[cfg(test)]
mod tests {
    use super::{LimitKnowledge, limit, wander};
    use crate::comparison::tests::made;
    use govtwin_model::metrics::Accumulator;
    use govtwin_model::twin::Cut;

    #[test]
    fn it_is_as_large_as_the_noise_of_the_reading_where_nothing_else_is_noisy() {
        let mut unit = govtwin_model::params::reference();
        let (recording, table) = made(300);
        let recordings = [recording];
        let rows: Vec<usize> = (0..300).collect();
        let rmse = |unit: &govtwin_model::parameters::Unit| {
            let said = limit(unit, Cut::None, (&recordings, 10_000_000), (&table, &rows), (LimitKnowledge::Inputs, 1));
            let measured = table.marks.iter().map(|mark| mark.measured);
            Accumulator::of(measured.zip(said.estimates)).figures().rmse
        };
        let real = rmse(&unit);
        unit.sensors.servomotor_position_pu.noise = 0.0;
        unit.sensors.spool_position_pu.noise = 0.0;
        let silent = rmse(&unit);
        assert!(silent == 0.0 && real > 1e-4, "{silent}, {real}");
    }

    #[test]
    fn a_command_wanders_between_rows_as_it_does_from_row_to_row_and_not_on_them() {
        use govtwin_diagnosis::generate::noise::{Purpose, RandomStreams};
        use govtwin_model::recording::Process;
        use govtwin_model::replay::between::drawn;
        let mut draws = RandomStreams { seed: 1, process: Process::Startup }.of(Purpose::Grid);
        let (mut recording, _) = made(2000);
        let (mut walk_pu, step_pu) = (0.5, 1e-4);
        for frame in &mut recording.frames {
            walk_pu += step_pu * draws.normal();
            frame.inputs.opening_command_pu = walk_pu;
        }
        let (straight, rows) = drawn(&recording, 10_000_000);
        let mut wandered = straight.frames.clone();
        wander(&mut wandered, &rows, &mut draws);
        let apart = |at: usize| wandered[at].inputs.opening_command_pu - straight.frames[at].inputs.opening_command_pu;
        assert!(rows.iter().all(|&row| apart(row) == 0.0));
        // Amid a pause a bridge is half a step off.
        let amid: f64 = rows[1..].iter().map(|&row| apart(row - 10) * apart(row - 10)).sum::<f64>() / 1999.0;
        assert!((amid.sqrt() / (0.5 * step_pu) - 1.0).abs() < 0.1, "{}", amid.sqrt());
    }
}
