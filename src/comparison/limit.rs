//! What no model can know: the error of a twin against itself, the noise that its regulator hears drawn anew.
//!
//! Two runs of one unit along the same recorded inputs differ by what the noise inside the loop does to valve and spool, and by nothing else, each read by its recorder's transducer.
//! The best estimate of one of them is their mean, so that `(one − other)/√2` is an error of the size that is left to a model that knows all but the
//! noise. What the inputs do between slow rows is not in it: the limit of a real unit lies above.

use super::Contender;
use crate::effects;
use crate::frame::Estimate;
use crate::generate::noise::{Dice, Purpose, READINGS, Transducer, in_loop};
use crate::parameters::Unit;
use crate::plant::Plant;
use crate::plant::term::Point;
use crate::recording::{Process, Recording};
use crate::replay::between::simulate_between;
use crate::residual::table::Table;
use crate::solver::Method;
use crate::twin::{Cut, Twin};
use crate::units::seconds_from_nanos;

/// An error of the size of the limit at each of some rows of a table, which was made of these recordings.
#[must_use]
pub fn limit(
    unit: &Unit,
    cut: Cut,
    (recordings, grid_ns): (&[Recording], i64),
    (table, rows): (&Table, &[usize]),
    seed: u64,
) -> Contender {
    let [one, other] = [2 * seed, 2 * seed + 1].map(|seed| {
        let run = |recording: &Recording| {
            simulate_between(&mut noisy(unit, recording, seed).with_cut(cut), recording, grid_ns)
        };
        recordings.iter().map(run).collect::<Vec<Vec<Estimate>>>()
    });
    let signal = table.layout.signal;
    let reader = |seed: u64| {
        let dice = Dice { seed, process: Process::Startup };
        Transducer::new(signal.sensor(&unit.sensors), dice.of(Purpose::Spool))
    };
    let (mut reader, mut another) = (reader(2 * seed), reader(2 * seed + 1));
    let estimates = rows.iter().map(|&row| {
        let mark = &table.marks[row];
        let of = |runs: &[Vec<Estimate>]| signal.of(&runs[mark.recording][mark.frame].signals);
        mark.measured + (reader.read(of(&one)) - another.read(of(&other))) * std::f64::consts::FRAC_1_SQRT_2
    });
    Contender { id: "limit", title: "limit: the noise in the loop, redrawn", estimates: estimates.collect() }
}

/// A twin whose regulator hears noise.
fn noisy(unit: &Unit, recording: &Recording, seed: u64) -> Twin {
    let mut plant = Plant::new(&unit.parameters);
    effects::apply(unit, &mut plant);
    let sensors = &unit.sensors;
    let dice = Dice { seed, process: recording.process };
    let [begin_ns, end_ns] =
        [recording.frames.first(), recording.frames.last()].map(|one| one.map_or(0, |one| one.time_ns));
    let ticks = seconds_from_nanos(end_ns - begin_ns) / plant.regulator.small_loop_period_s();
    for (point, sensor, readings, purpose) in [
        (Point::RegulatorServomotor, sensors.servomotor_position_pu, READINGS, Purpose::RegulatorServomotor),
        (Point::RegulatorSpool, sensors.spool_position_pu, 1, Purpose::RegulatorSpool),
    ] {
        plant.terms.push(in_loop(point, sensor, readings, dice.of(purpose), ticks));
    }
    Twin::of_plant(plant, unit.parameters.oil.tank_pressure_pa, Method::default())
}

#[cfg(test)]
mod tests {
    use super::limit;
    use crate::comparison::tests::made;
    use crate::metrics::Accumulator;
    use crate::twin::Cut;

    #[test]
    fn it_is_as_large_as_the_noise_of_the_reading_where_nothing_else_is_noisy() {
        let mut unit = crate::params::reference();
        let (recording, table) = made(300);
        let recordings = [recording];
        let rows: Vec<usize> = (0..300).collect();
        let rmse = |unit: &crate::parameters::Unit| {
            let said = limit(unit, Cut::None, (&recordings, 10_000_000), (&table, &rows), 1);
            let measured = table.marks.iter().map(|mark| mark.measured);
            Accumulator::of(measured.zip(said.estimates)).figures().rmse
        };
        let real = rmse(&unit);
        unit.sensors.servomotor_position_pu.noise = 0.0;
        unit.sensors.spool_position_pu.noise = 0.0;
        let silent = rmse(&unit);
        assert!(silent == 0.0 && real > 1e-4, "{silent}, {real}");
    }
}
