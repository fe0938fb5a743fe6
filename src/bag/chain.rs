//! Whether command, ESV, spool and servomotor of a recording can be of one servo system and of one time: row by row, in memory that does not grow.
//!
//! A servomotor follows its command with a delay and comes to rest where the command is. Its spool drives it: its speed has the spool's sign. A tripped
//! ESV closes it, and nothing opens it. No servomotor runs its stroke in half a second. A recording in which one of this is otherwise is not one
//! of a machine, whatever its faults: a channel is wired to another, is stuck or held, is scaled or turned, is of another machine, or the time is
//! not that of the plant. The limits lie far outside of what faults of servo systems do; what great ones do as well is said with both.

mod copies;
mod impossible;
mod jumps;
mod lines;
mod onsets;
mod rests;
mod stay;
mod trips;
mod watches;

use govtwin_model::frame::{EsvState, Frame};
use govtwin_model::signal::Signal;
use govtwin_model::units::seconds_from_nanos;

use copies::{CopyWatch, Pair};
pub(crate) use impossible::Impossible;
use jumps::JumpWatch;
use onsets::{FOLLOWERS, OnsetWatch};
pub use rests::Followed;
use rests::RestWatch;
use trips::TripWatch;
use watches::{HeldWatch, Relation, ShiftWatch};

use super::qualification::OTHER_CLOCK_S;

/// Speeds are taken over so much time, s: noise of two samples is small then.
const SPEED_OVER_S: f64 = 0.1;
/// Over a longer pause nothing is told.
const LONGEST_STEP_S: f64 = 1.0;
/// A command that is so far from the position moves it, pu.
const ASKS_PU: f64 = 0.006;
/// Travel that goes away from the command must be so long, pu, and such a share of that towards it; of a sound system there is none, and a leak makes less.
const AWAY_PU: f64 = 0.1;
const AWAY_RATIO: f64 = 0.6;
/// A command that moves faster is followed with a delay that shows, pu/s.
const MOVES_PU_S: f64 = 0.02;
/// Steps smaller than this may be noise, pu.
const NOISE_PU: f64 = 5e-4;
/// The share of samples, and the least number of them, that make a copy.
const COPY_SHARE: f64 = 0.95;
const COPY_SAMPLES: u64 = 20;
/// Half the mean squared step of noise is its mean square, give or take one over the root of the number of samples; of what lasts it is next to nothing.
/// What is left between a moving command and its copy is noise, what a servomotor lags by lasts, and its speed does.
const LASTS: f64 = 0.5;
/// A position within this band stands still, pu.
const STILL_PU: f64 = 0.004;
/// Three samples in one direction faster than this, pu/s, over so much of the stroke, pu, are none of a servomotor.
const FASTEST_PU_S: f64 = 2.0;
const FAST_PU: f64 = 0.05;
/// Pairs of speed and spool that tell a relation, where the speed is more than noise, and the least correlation of the two: one explains a third of the
/// other, also at one sample a second. A position that moves less tells none, pu.
const PAIRS: f64 = 50.0;
const UNRELATED: f64 = 0.577;
const TURNED: f64 = -0.4;
const MOVED_PU: f64 = 0.05;
/// A spool moves the servomotor at once: its speed goes with the spool of a time later, so well and with half of what is left, only where one of the two is
/// of another time; with fewer spools in each time nothing is told. It may come after its spool by some air in its oil, and by so many steps where it
/// is recorded late.
const AHEAD: f64 = 0.9;
const LATE_STEPS: isize = 3;
const LATE: f64 = 0.8;
const SPOOLS: f64 = 3.0;
/// A spool that is so far open, pu, and moves nothing at less than this, pu/s, is no sign: a load, a leak or a stop holds the servomotor.
const OPEN_PU: f64 = 0.1;
const HELD_PU_S: f64 = 0.01;
/// A recording of so many samples in which the servomotor moves lasts longer, s.
const SHORTEST_S: f64 = 1.0;
const SHORT_SAMPLES: u64 = 200;
/// Samples that are further apart, s, show nothing of a process of seconds.
const APART_S: f64 = 5.0;

/// The last row at which a speed was taken, and sums of the spool since.
#[derive(Clone, Copy, Debug)]
struct SpeedPoint {
    time_ns: i64,
    position: f64,
    error: f64,
    normal: bool,
    spool: f64,
    spools: f64,
}

/// What the rows of a recording show.
#[derive(Clone, Debug, Default)]
pub(crate) struct ChainEvidence {
    last: Option<(i64, f64, f64)>,
    point: Option<SpeedPoint>,
    speed: f64,
    towards: f64,
    away: f64,
    /// Sums of squares of the distance to the command and of the servomotor's speed: the root of their ratio is the time between the two, s.
    distances: f64,
    speeds: f64,
    moving: u64,
    near: u64,
    last_error: Option<f64>,
    error_squares: f64,
    error_steps: f64,
    equal: u64,
    all: u64,
    command_ends: Option<[f64; 2]>,
    servo_ends: Option<[f64; 2]>,
    first_ns: Option<i64>,
    trips: TripWatch,
    rests: RestWatch,
    /// Of spool and servomotor.
    onsets: [OnsetWatch; 2],
    held: [HeldWatch; 2],
    copies: CopyWatch,
    jumps: JumpWatch,
    relation: Relation,
    /// Pairs that tell none, as something held the servomotor.
    held_pairs: f64,
    shifts: ShiftWatch,
    followed: Followed,
    fast: (u32, f64),
    fastest: Option<Impossible>,
}

fn wider(ends: Option<[f64; 2]>, value: f64) -> Option<[f64; 2]> {
    let [least, most] = ends.unwrap_or([value; 2]);
    value.is_finite().then_some([least.min(value), most.max(value)]).or(ends)
}

fn span(ends: Option<[f64; 2]>) -> f64 {
    ends.map_or(0.0, |[least, most]| most - least)
}

/// Whether the servomotor is off its stops.
fn is_inside(servo: f64) -> bool {
    (0.02..=0.98).contains(&servo)
}

/// Whether a command presses the servomotor into a stop, where it rests.
fn is_pressed(servo: f64, command: f64) -> bool {
    (servo < 0.02 && command < servo) || (servo > 0.98 && command > servo)
}

impl ChainEvidence {
    /// Takes a row.
    pub(crate) fn row(&mut self, frame: &Frame) {
        let servo = Signal::ServomotorPosition.of(&frame.measured);
        let spool = Signal::SpoolPosition.of(&frame.measured);
        let (time_ns, command) = (frame.time_ns, frame.inputs.opening_command_pu);
        let normal = frame.inputs.esv == EsvState::Normal;
        if spool.is_finite() {
            self.held[1].take(time_ns, spool);
        }
        if !servo.is_finite() {
            return;
        }
        self.first_ns.get_or_insert(time_ns);
        self.held[0].take(time_ns, servo);
        self.servo_ends = wider(self.servo_ends, servo);
        self.command_ends = wider(self.command_ends, command);
        self.speed(frame, servo, spool);
        self.followed.take(frame);
        self.copied(time_ns, command, servo, normal);
        self.copies.take(Pair { time_ns, command, position: servo, spool, normal });
        self.jumps.take(time_ns, servo);
        self.trips.take(time_ns, command - servo, servo, spool, normal);
        self.rests.take(time_ns, command, [servo, spool], normal);
        for ((watch, (_, moved_pu)), position) in self.onsets.iter_mut().zip(FOLLOWERS).zip([spool, servo]) {
            watch.take(time_ns, command, (position, moved_pu), normal);
        }
        self.last = Some((time_ns, command, servo));
    }

    fn speed(&mut self, frame: &Frame, servo: f64, spool: f64) {
        let (time_ns, command) = (frame.time_ns, frame.inputs.opening_command_pu);
        let normal = frame.inputs.esv == EsvState::Normal;
        if let Some((last_ns, _, last)) = self.last {
            let step_s = seconds_from_nanos(time_ns.saturating_sub(last_ns));
            let step = servo - last;
            let fast = step_s > 0.0 && step.abs() > FASTEST_PU_S * step_s && step.abs() > NOISE_PU;
            let (count, run) = self.fast;
            self.fast = match (fast, run * step >= 0.0) {
                (true, true) => (count + 1, run + step),
                (true, false) => (1, step),
                (false, _) => (0, 0.0),
            };
            if self.fast.0 >= 3 && self.fast.1.abs() > FAST_PU {
                self.fastest.get_or_insert(Impossible::TooFast { pu_s: step.abs() / step_s, time_ns });
            }
        }
        let point = SpeedPoint { time_ns, position: servo, error: command - servo, normal, spool: 0.0, spools: 0.0 };
        let Some(from) = &mut self.point else {
            self.point = Some(point);
            return;
        };
        if spool.is_finite() {
            (from.spool, from.spools) = (from.spool + spool, from.spools + 1.0);
        }
        let step_s = seconds_from_nanos(time_ns.saturating_sub(from.time_ns));
        if step_s < SPEED_OVER_S {
            return;
        }
        let (from, step) = (*from, servo - from.position);
        self.point = Some(point);
        if step_s > LONGEST_STEP_S {
            self.shifts.take(None);
            return;
        }
        self.speed = step / step_s;
        let asks = from.error.abs() > ASKS_PU && from.error.is_finite();
        // Noise goes to and fro where a stop holds the servomotor.
        if from.normal && normal && asks && !is_pressed(from.position, from.position + from.error) {
            self.distances += from.error * from.error;
            self.speeds += self.speed * self.speed;
            let towards = step * from.error > 0.0;
            *(if towards { &mut self.towards } else { &mut self.away }) += step.abs();
        }
        let spool = from.spool / from.spools;
        self.shifts.take(Some((spool, self.speed)).filter(|_| from.spools >= SPOOLS && is_inside(servo)));
        if from.spools < 1.0 || !is_inside(servo) {
            return;
        }
        if self.speed.abs() < HELD_PU_S && spool.abs() > OPEN_PU {
            self.held_pairs += 1.0;
        } else {
            self.relation.take(spool, self.speed);
        }
    }

    fn copied(&mut self, time_ns: i64, command: f64, servo: f64, normal: bool) {
        let Some((last_ns, last, _)) = self.last else { return };
        if !command.is_finite() || !normal {
            return;
        }
        self.all += 1;
        self.equal += u64::from(command.to_bits() == servo.to_bits());
        let step_s = seconds_from_nanos(time_ns.saturating_sub(last_ns));
        let error = servo - command;
        if step_s > 0.0 && (command - last).abs() > MOVES_PU_S * step_s {
            self.moving += 1;
            // What lies alone is no noise.
            if let Some(last) = self.last_error.filter(|last| error.abs().max(last.abs()) < STILL_PU) {
                self.near += 1;
                self.error_squares += error * error;
                self.error_steps += 0.5 * (error - last).powi(2);
            }
        }
        self.last_error = Some(error);
    }

    /// What cannot be of one machine.
    pub(crate) fn found(&self) -> Vec<Impossible> {
        let mut found = vec![];
        let moves = span(self.command_ends) > MOVED_PU;
        let is_near = self.moving >= COPY_SAMPLES && self.near as f64 > COPY_SHARE * self.moving as f64;
        let copied = is_near && self.error_steps > LASTS * self.error_squares;
        let bits = self.all >= COPY_SAMPLES && self.equal as f64 > COPY_SHARE * self.all as f64;
        if moves && (copied || bits) {
            let Self { moving, equal, all, .. } = *self;
            let apart_pu = (self.error_squares / self.near.max(1) as f64).sqrt();
            found.push(Impossible::Copy { apart_pu, moving, equal, all });
            return found;
        }
        if let Some(late) = self.copies.found().filter(|_| moves) {
            found.push(late);
            return found;
        }
        found.extend(lines::found(self.copies.rows()));
        found.extend(self.fastest.or(self.jumps.found()));
        found.extend(self.trips.found());
        // A spool that moves too early moves the servomotor too early.
        found.extend(self.onsets.iter().zip(FOLLOWERS).find_map(|(watch, (signal, _))| watch.found(signal)));
        let is_away = self.away > AWAY_PU && self.away > AWAY_RATIO * self.towards;
        let correlation = self.relation.sums.value();
        if is_away {
            let (away_pu, towards_pu) = (self.away, self.towards);
            let lead_s = (self.distances / self.speeds.max(f64::MIN_POSITIVE)).sqrt();
            found.push(if self.relation.sums.pairs >= PAIRS && correlation > UNRELATED && lead_s < OTHER_CLOCK_S {
                Impossible::Leads { away_pu, towards_pu, lead_s }
            } else {
                Impossible::Away {
                    away_pu,
                    towards_pu,
                    may_be: self.followed.gain().is_some() || self.trips.is_closed(),
                }
            });
        }
        let tell = self.relation.sums.pairs >= PAIRS.max(self.held_pairs)
            && span(self.servo_ends) > MOVED_PU
            && self.relation.speed_lasts();
        let shifted = self.shifts.best(correlation, PAIRS).filter(|_| tell);
        match shifted.map(|(steps, shifted)| (steps, steps as f64 * SPEED_OVER_S, shifted)) {
            Some((..0, by_s, ahead)) if ahead > AHEAD => {
                found.push(Impossible::SpoolLate { by_s: -by_s, ahead, correlation });
            }
            Some((LATE_STEPS.., by_s, late)) if late > LATE => {
                found.push(Impossible::ServomotorLate { by_s, late, correlation });
            }
            _ if tell && correlation < UNRELATED => found.push(Impossible::Unrelated { correlation }),
            _ => {}
        }
        found.extend(self.rests.found(self.followed.gain()));
        found.extend(self.held[0].found(Signal::ServomotorPosition));
        found.extend(self.held[1].found(Signal::SpoolPosition));
        let duration_s = self
            .first_ns
            .zip(self.last)
            .map_or(0.0, |(first_ns, (last_ns, ..))| seconds_from_nanos(last_ns.saturating_sub(first_ns)));
        if duration_s < SHORTEST_S
            && self.all > SHORT_SAMPLES
            && span(self.servo_ends) > MOVED_PU
            && self.fastest.is_none()
        {
            found.push(Impossible::TooShort { duration_s });
        }
        let apart_s = duration_s / self.all.max(1) as f64;
        if apart_s > APART_S && span(self.servo_ends) > 2.0 * MOVED_PU && self.all > 2 {
            found.push(Impossible::TooSlow { apart_s });
        }
        found
    }
}
