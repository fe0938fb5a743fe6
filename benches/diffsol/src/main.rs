//! The servo system integrated by the crate diffsol: a yardstick of `benches/chain`.
//!
//! `govtwin-diffsol TAPE OUT CLOSED RESTART METHOD RTOL ATOL REPEATS`, with files and numbers as in `benches/sundials/chain.c`
//! and METHOD `bdf`, `tr_bdf2` or `esdirk34`. The rates are the library's own; the Jacobian is taken by differences, with
//! the rates at the point itself kept from one column to the next.

use std::cell::{Cell, RefCell};
use std::error::Error;
use std::rc::Rc;

use diffsol::{
    NalgebraLU, NalgebraMat, OdeBuilder, OdeEquationsImplicit, OdeSolverMethod, OdeSolverStopReason, Vector,
};
use govtwin_model::plant::rates::{confine, rates};
use govtwin_model::plant::{Drive, Plant};
use govtwin_model::state::{DIMENSION, State, Vector as StateVector};
use rustix::time::{ClockId, clock_gettime};

type Failure = Box<dyn Error>;

/// Each state's typical size, as in the library's own linearly implicit method.
const TYPICAL: [f64; DIMENSION] = [1.0, 400.0, 1e6, 0.015, 0.1, 1e6, 1e6, 0.6, 0.1];

/// What the command line asks for.
struct Wishes {
    closed: bool,
    restart: bool,
    method: String,
    rtol: f64,
    atol: f64,
}

/// One process of the tape: the state at its start, and rows of command, ESV, tank pressure and measured servomotor.
struct Part<'a> {
    start: &'a [f64],
    rows: Vec<&'a [f64]>,
}

/// The drive in force, shared with the closures that the solver owns.
#[derive(Default)]
struct Shared {
    drive: Cell<Drive>,
    evaluations: Cell<u64>,
    /// Where the rates were last taken for a column of the Jacobian, the drive then, and the rates.
    kept: RefCell<Option<([f64; DIMENSION], Drive, [f64; DIMENSION])>>,
}

impl Shared {
    fn rates(&self, plant: &Plant, y: &[f64], f: &mut [f64]) {
        self.evaluations.set(self.evaluations.get() + 1);
        let state = State::from_vector(&StateVector::from_column_slice(y));
        f.copy_from_slice(rates(plant, &state, &self.drive.get()).to_vector().as_slice());
    }

    /// The Jacobian times `v`, by a difference.
    fn directed(&self, plant: &Plant, y: &[f64], v: &[f64], out: &mut [f64]) {
        let longest = v.iter().zip(TYPICAL).map(|(v, typical)| (v / typical).abs()).fold(0.0, f64::max);
        if longest == 0.0 {
            out.fill(0.0);
            return;
        }
        let mut kept = self.kept.borrow_mut();
        let base = match *kept {
            Some((at, drive, base)) if at == y && drive == self.drive.get() => base,
            _ => {
                let mut base = [0.0; DIMENSION];
                self.rates(plant, y, &mut base);
                let mut at = [0.0; DIMENSION];
                at.copy_from_slice(y);
                *kept = Some((at, self.drive.get(), base));
                base
            }
        };
        // A body at an upper stop is moved into it, at any other place downwards: away from a stop the rates jump.
        let upper = y[3] >= plant.spool.stroke_max_m || y[7] >= plant.servomotor.stroke_m || y[0] >= 1.0;
        let delta = if upper { 1e-7 } else { -1e-7 } / longest;
        let mut moved = [0.0; DIMENSION];
        for (moved, (y, v)) in moved.iter_mut().zip(y.iter().zip(v)) {
            *moved = y + delta * v;
        }
        self.rates(plant, &moved, out);
        for (out, base) in out.iter_mut().zip(base) {
            *out = (*out - base) / delta;
        }
    }
}

/// Runs one process; pushes spool and servomotor position at every row. Returns the number of steps.
fn run<'a, Eqn>(
    mut solver: impl OdeSolverMethod<'a, Eqn>,
    plant: &Plant,
    shared: &Shared,
    part: &Part,
    wishes: &Wishes,
    out: &mut Vec<f64>,
) -> Result<usize, Failure>
where
    Eqn: OdeEquationsImplicit<T = f64> + 'a,
{
    let position = |y: &[f64; DIMENSION]| (plant.spool.reading_pu(y[3]), y[7] / plant.servomotor.stroke_m);
    let read = |y: &Eqn::V| std::array::from_fn::<f64, DIMENSION, _>(|i| y.get_index(i));
    let mut y: [f64; DIMENSION] = read(solver.state().y);
    let mut before = Drive::default();
    for (j, row) in part.rows.iter().enumerate() {
        let (spool_pu, servomotor_pu) = position(&y);
        out.extend([spool_pu, servomotor_pu]);
        if j + 1 == part.rows.len() {
            break;
        }
        let demand_pu = plant.regulator.spool_command_pu(row[0], if wishes.closed { servomotor_pu } else { row[3] });
        for k in 1..=10 {
            let current_pu = plant.regulator.valve_current_pu(demand_pu, plant.spool.reading_pu(y[3]));
            let drive = Drive {
                valve_current_pu: current_pu,
                esv_opening_pu: row[1],
                tank_pressure_pa: row[2],
                ..Drive::default()
            };
            shared.drive.set(drive);
            if (wishes.restart && drive != before) || drive.esv_opening_pu != before.esv_opening_pu {
                let _ = solver.state_mut();
            }
            before = drive;
            // The way to a stop may have left a step of rounding size.
            if solver.state().h < 1e-7 {
                *solver.state_mut().h = 1e-4;
            }
            solver.set_stop_time(0.01 * j as f64 + 0.001 * f64::from(k))?;
            while solver.step()? != OdeSolverStopReason::TstopReached {}
            y = read(solver.state().y);
            let found = State::from_vector(&StateVector::from(y));
            let mut held = found;
            confine(plant, &mut held);
            if held != found {
                let state = solver.state_mut();
                for (i, value) in held.to_vector().iter().enumerate() {
                    state.y.set_index(i, *value);
                }
                y = held.to_vector().into();
            }
        }
    }
    Ok(solver.get_statistics().number_of_steps)
}

/// Runs the whole tape once.
fn once(parts: &[Part], plant: &Rc<Plant>, wishes: &Wishes, out: &mut Vec<f64>) -> Result<(usize, u64), Failure> {
    let (mut steps, mut evaluations) = (0, 0);
    out.clear();
    for part in parts {
        let shared = Rc::new(Shared::default());
        let first = Drive { esv_opening_pu: part.rows[0][1], tank_pressure_pa: part.rows[0][2], ..Drive::default() };
        shared.drive.set(first);
        let (of_rates, of_jacobian) = ((Rc::clone(plant), Rc::clone(&shared)), (Rc::clone(plant), Rc::clone(&shared)));
        let start = part.start.to_vec();
        let mut problem = OdeBuilder::<NalgebraMat<f64>>::new()
            .rtol(wishes.rtol)
            .atol(TYPICAL.map(|typical| wishes.atol * typical))
            .h0(1e-5)
            .rhs_implicit(
                move |y: &[f64], _: &[f64], _, f: &mut [f64]| of_rates.1.rates(&of_rates.0, y, f),
                move |y: &[f64], _: &[f64], _, v: &[f64], f: &mut [f64]| {
                    of_jacobian.1.directed(&of_jacobian.0, y, v, f)
                },
            )
            .init(move |_: &[f64], _, y: &mut [f64]| y.copy_from_slice(&start), DIMENSION)
            .build()?;
        // Counted over the whole run, which has 160,000 stops; and a stop may leave a step of rounding.
        problem.ode_options.max_nonlinear_solver_failures = usize::MAX;
        problem.ode_options.min_timestep = 0.0;
        steps += match wishes.method.as_str() {
            "bdf" => run(problem.bdf::<NalgebraLU<f64>>()?, plant, &shared, part, wishes, out)?,
            "tr_bdf2" => run(problem.tr_bdf2::<NalgebraLU<f64>>()?, plant, &shared, part, wishes, out)?,
            "esdirk34" => run(problem.esdirk34::<NalgebraLU<f64>>()?, plant, &shared, part, wishes, out)?,
            other => return Err(format!("no method {other}").into()),
        };
        evaluations += shared.evaluations.get();
    }
    Ok((steps, evaluations))
}

/// Time that this process has had on a processor, s.
fn processor_s() -> f64 {
    let time = clock_gettime(ClockId::ProcessCPUTime);
    time.tv_sec as f64 + 1e-9 * time.tv_nsec as f64
}

fn main() -> Result<(), Failure> {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let [tape, into, closed, restart, method, rtol, atol, repeats] = words.as_slice() else {
        return Err("govtwin-diffsol TAPE OUT CLOSED RESTART METHOD RTOL ATOL REPEATS".into());
    };
    let wishes = Wishes {
        closed: closed == "1",
        restart: restart == "1",
        method: method.clone(),
        rtol: rtol.parse()?,
        atol: atol.parse()?,
    };
    let bytes = std::fs::read(tape)?;
    let numbers: Vec<f64> =
        bytes.chunks_exact(8).map(|word| f64::from_le_bytes(word.try_into().unwrap_or_default())).collect();
    let mut rest = numbers.as_slice();
    let mut parts = Vec::new();
    while let [count, after @ ..] = rest {
        let (start, after) = after.split_at(DIMENSION);
        let (rows, after) = after.split_at(4 * *count as usize);
        parts.push(Part { start, rows: rows.chunks_exact(4).collect() });
        rest = after;
    }
    let plant = Rc::new(Plant::new(&govtwin_model::params::reference().parameters));
    let (mut least_s, mut out, mut counts) = (f64::INFINITY, Vec::new(), (0, 0));
    for _ in 0..repeats.parse::<u32>()?.max(1) {
        let begin_s = processor_s();
        counts = once(&parts, &plant, &wishes, &mut out)?;
        least_s = least_s.min(processor_s() - begin_s);
    }
    let bytes: Vec<u8> = out.iter().flat_map(|value| value.to_le_bytes()).collect();
    std::fs::write(into, bytes)?;
    println!("{least_s:.9} {} {}", counts.0, counts.1);
    Ok(())
}
