//! Several twins in the lanes of a register or two: slightly different units under the same rows.
//!
//! Most of a diagnosis are such simulations. Laws and tick are those of a single twin, see `plant/real.rs` and `tick.rs`, and so are the results,
//! to the last bit. What is no arithmetic of many equal steps goes lane by lane: the start, terms where a lane has any, and the large loop,
//! which runs in one tick of ten. Twins that cannot go side by side run one after another.

use crate::frame::{Estimate, Frame, Inputs};
use crate::plant::lanes::{LaneWork, MOST_LANES, Wide, Width};
use crate::plant::regulator::SmallLoop;
use crate::plant::term::{POINTS, Point};
use crate::plant::{Bank, Blocks, Drive, Plant};
use crate::signal::Signal;
use crate::solver::Solver;
use crate::solver::split::Split;
use crate::state::State;

use super::now::{Acting, Demand, Now, esv_opening_pu};
use super::readings::positions_pu;
use super::tick::{Chain, Seen, TickReads, large_loop, tick};
use super::{Twin, estimate};

/// One row, and whether the estimates there are used.
#[derive(Clone, Copy, Debug)]
pub struct BatchRow {
    /// The row.
    pub frame: Frame,
    /// Whether the estimates are used.
    pub is_sample: bool,
}

/// The estimates of several twins, each started anew, at the rows whose estimates are used.
///
/// `rows` are those of each twin, or those of all; they agree in everything but command and ESV. No more twins than the width has lanes.
#[must_use]
pub fn estimates<I: Iterator<Item = BatchRow>>(width: Width, twins: &mut [Twin], rows: Vec<I>) -> Vec<Vec<Estimate>> {
    let mut watch = KeptRows { wanted: None, estimates: vec![Vec::new(); twins.len()], traces: Vec::new() };
    run(width, twins, &mut each(&mut { rows }), &mut watch);
    watch.estimates
}

/// The same of some signals alone: for each of [`Signal::ALL`] that is wanted its values, twin by twin.
#[must_use]
pub fn signals<I: Iterator<Item = BatchRow>>(
    width: Width,
    twins: &mut [Twin],
    rows: Vec<I>,
    wanted: [bool; Signal::ALL.len()],
) -> Vec<[Vec<f64>; Signal::ALL.len()]> {
    let traces = vec![Default::default(); twins.len()];
    let mut watch = KeptRows { wanted: Some(wanted), estimates: Vec::new(), traces };
    run(width, twins, &mut each(&mut { rows }), &mut watch);
    watch.traces
}

/// Rows of one twin. Not a type parameter: the lanes are compiled once, in this crate.
type Rows<'a> = &'a mut (dyn Iterator<Item = BatchRow> + 'a);

fn each<I: Iterator<Item = BatchRow>>(rows: &mut [I]) -> Vec<Rows<'_>> {
    rows.iter_mut().map(|rows| rows as Rows<'_>).collect()
}

/// What is kept of the twins at the rows whose estimates are used.
struct KeptRows {
    /// Which signals; everything where none are named.
    wanted: Option<[bool; Signal::ALL.len()]>,
    estimates: Vec<Vec<Estimate>>,
    traces: Vec<[Vec<f64>; Signal::ALL.len()]>,
}

impl KeptRows {
    #[inline(always)]
    fn look<T: Wide>(&mut self, time_ns: i64, (spool_pu, servomotor_pu): (T, T), now: &Now<T>) {
        let Some(wanted) = self.wanted else {
            for (lane, estimates) in self.estimates.iter_mut().enumerate() {
                estimates.push(estimate(time_ns, (spool_pu.lane(lane), servomotor_pu.lane(lane)), &now.lane(lane)));
            }
            return;
        };
        for signal in Signal::ALL.into_iter().filter(|&signal| wanted[signal as usize]) {
            let values = match signal {
                Signal::ServomotorPosition => servomotor_pu,
                Signal::SpoolPosition => spool_pu,
                Signal::PilotValvePosition => now.state.pilot_position_pu,
                Signal::ControlPressure => now.state.control_pressure_pa,
            };
            for (lane, traces) in self.traces.iter_mut().enumerate() {
                traces[signal as usize].push(values.lane(lane));
            }
        }
    }
}

/// Whether twins can go side by side: the default method, equal ticks, and the same cut.
pub fn fit(twins: &[Twin]) -> bool {
    let Some(first) = twins.first() else { return false };
    let Solver::Split(steps) = &first.solver else { return false };
    twins.iter().all(|twin| {
        matches!(&twin.solver, Solver::Split(other) if other.is_as_long_as(steps)) && twin.setting == first.setting
    })
}

/// Runs twins side by side.
fn run(width: Width, twins: &mut [Twin], rows: &mut [Rows<'_>], watch: &mut KeptRows) {
    debug_assert!(twins.len() <= width.lanes() && (rows.len() == 1 || rows.len() == twins.len()));
    width.run(BatchRun { twins, rows, watch });
}

struct BatchRun<'a, 'b> {
    twins: &'a mut [Twin],
    rows: &'a mut [Rows<'b>],
    watch: &'a mut KeptRows,
}

impl LaneWork for BatchRun<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn run<T: Wide>(self, zero: T) {
        let Self { twins, rows, watch } = self;
        let Some(mut row) = TwinRows::first(rows) else { return };
        for (lane, twin) in twins.iter_mut().enumerate() {
            twin.reset();
            twin.advance(&row.of(lane).frame);
        }
        let setting = twins[0].setting;
        let started: Vec<&Now> = twins.iter().map(|twin| &twin.now).collect();
        let Some(mut now) = Now::abreast(&started, zero) else { return };
        let Some(mut side) = LaneSide::new(twins, zero) else { return };
        loop {
            let BatchRow { frame, is_sample } = row.all[0];
            if is_sample {
                watch.look(frame.time_ns, positions_pu(&side.bank.blocks(), &now, setting, frame.time_ns), &now);
            }
            if !row.advance(rows) {
                break;
            }
            let frame = &row.all[0].frame;
            while frame.time_ns - now.time_ns >= setting.tick_ns {
                tick(&mut side, setting, &mut now, frame);
            }
            now.coming = row.renewed(&now.coming);
            now.take(frame);
            if now.is_placed_by(frame) {
                for (lane, twin) in side.twins.iter_mut().enumerate() {
                    twin.now = now.lane(lane);
                    twin.place(&row.of(lane).frame);
                }
                let started: Vec<&Now> = side.twins.iter().map(|twin| &twin.now).collect();
                let Some(placed) = Now::abreast(&started, zero) else { return };
                now = placed;
            }
        }
        for twin in side.twins {
            twin.reset();
        }
    }
}

/// The row at which all twins are: one for all, or one for each.
struct TwinRows {
    all: [BatchRow; MOST_LANES],
    count: usize,
}

impl TwinRows {
    fn first(rows: &mut [Rows<'_>]) -> Option<Self> {
        let all = [rows.first_mut()?.next()?; MOST_LANES];
        let mut first = Self { all, count: rows.len().min(MOST_LANES) };
        for (row, rows) in first.all.iter_mut().zip(rows).skip(1) {
            *row = rows.next()?;
        }
        Some(first)
    }

    fn advance(&mut self, rows: &mut [Rows<'_>]) -> bool {
        self.all.iter_mut().zip(rows).all(|(row, rows)| rows.next().map(|next| *row = next).is_some())
    }

    #[inline(always)]
    fn of(&self, lane: usize) -> &BatchRow {
        &self.all[lane.min(self.count - 1)]
    }

    /// Inputs updated by these rows.
    #[inline(always)]
    fn renewed<T: Wide>(&self, old: &Acting<T>) -> Acting<T> {
        if self.count == 1 {
            let Inputs { opening_command_pu, esv, tank_pressure_pa, piston_force_n } = self.all[0].frame.inputs;
            let zero = old.esv_opening_pu;
            let renewed = |old: T, new: f64| if new.is_finite() { zero.like(new) } else { old };
            return Acting {
                opening_command_pu: renewed(old.opening_command_pu, opening_command_pu),
                esv_opening_pu: zero.like(esv_opening_pu(esv)),
                tank_pressure_pa: renewed(old.tank_pressure_pa, tank_pressure_pa),
                piston_force_n: renewed(old.piston_force_n, piston_force_n),
            };
        }
        let renewed = |lane: usize| {
            let mut acting = old.lane(lane);
            acting.renew(&self.of(lane).frame.inputs);
            acting
        };
        let renewed: [Acting; MOST_LANES] = std::array::from_fn(|lane| renewed(lane.min(T::COUNT - 1)));
        let zero = old.esv_opening_pu;
        Acting {
            opening_command_pu: zero.each(|lane| renewed[lane].opening_command_pu),
            esv_opening_pu: zero.each(|lane| renewed[lane].esv_opening_pu),
            tank_pressure_pa: zero.each(|lane| renewed[lane].tank_pressure_pa),
            piston_force_n: zero.each(|lane| renewed[lane].piston_force_n),
        }
    }
}

/// Plants in lanes, with the memories of terms and large loops in each.
struct LaneSide<'a, T> {
    twins: &'a mut [Twin],
    bank: Bank<T>,
    steps: Split<T>,
    /// Where all large loops run in every so many ticks, that number.
    whole_ticks: Option<u64>,
    /// By point whether any lane has a term there.
    occupied: [bool; POINTS],
}

impl<'a, T: Wide> LaneSide<'a, T> {
    fn new(twins: &'a mut [Twin], zero: T) -> Option<Self> {
        let plants: Vec<&Plant> = twins.iter().map(|twin| &*twin.plant).collect();
        let steps: Vec<&Split> = twins.iter().filter_map(|twin| twin.solver.split()).collect();
        let whole_ticks = plants.first()?.regulator.whole_ticks();
        Some(Self {
            bank: Bank::new(&plants, zero)?,
            steps: Split::abreast(&steps, zero)?,
            whole_ticks: whole_ticks
                .filter(|_| plants.iter().all(|plant| plant.regulator.whole_ticks() == whole_ticks)),
            occupied: Point::ALL.map(|point| plants.iter().any(|plant| !plant.terms.is_empty_at(point))),
            twins,
        })
    }
}

impl<T: Wide> Chain<T> for LaneSide<'_, T> {
    #[inline(always)]
    fn blocks(&self) -> Blocks<'_, T> {
        self.bank.blocks()
    }

    #[inline(always)]
    fn small_loop(&self) -> SmallLoop<T> {
        *self.bank.small_loop()
    }

    #[inline(always)]
    fn apply(&mut self, point: Point, signal: T, seen: &Seen<T>) -> T {
        if !self.occupied[point as usize] {
            return signal;
        }
        let last = self.twins.len() - 1;
        let mut signals = [0.0; MOST_LANES];
        for (lane, (twin, passed)) in self.twins.iter_mut().zip(&mut signals).enumerate() {
            *passed = signal.lane(lane);
            if !twin.plant.terms.is_empty_at(point) {
                let seen = seen.lane(lane);
                *passed = twin.plant.terms.apply(point, *passed, &seen.view(), &mut twin.memory);
            }
        }
        signal.each(|lane| signals[lane.min(last)])
    }

    #[inline(always)]
    fn large_loop(&mut self, ticks: u64, moving_s: f64, read: &TickReads<T>, demand: &mut Demand<T>) -> T {
        if self.whole_ticks.is_some_and(|whole_ticks| !ticks.is_multiple_of(whole_ticks)) {
            return demand.spool_command_pu;
        }
        let last = self.twins.len() - 1;
        let mut commands_pu = [0.0; MOST_LANES];
        let mut demands = [Demand { spool_command_pu: 0.0, sd_pu: 0.0 }; MOST_LANES];
        for (lane, Twin { plant, hold, .. }) in self.twins.iter_mut().enumerate() {
            demands[lane] = demand.lane(lane);
            commands_pu[lane] = large_loop(plant, hold, ticks, moving_s, &read.lane(lane), &mut demands[lane]);
        }
        let zero = demand.sd_pu;
        demand.spool_command_pu = zero.each(|lane| demands[lane.min(last)].spool_command_pu);
        demand.sd_pu = zero.each(|lane| demands[lane.min(last)].sd_pu);
        zero.each(|lane| commands_pu[lane.min(last)])
    }

    #[inline(always)]
    fn advance(&self, state: &mut State<T>, drive: &Drive<T>) {
        self.steps.advance(&self.bank.blocks(), state, drive);
    }

    #[inline(always)]
    fn advance_piston(&self, state: &mut State<T>, drive: &Drive<T>) {
        self.steps.advance_piston(&self.bank.blocks(), state, drive);
    }
}
