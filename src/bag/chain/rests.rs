//! Where the servomotor rests, and where its command is then.

use govtwin_model::frame::{EsvState, Frame};
use govtwin_model::signal::Signal;

use super::impossible::{Impossible, Meant};
use super::stay::Stay;
use super::{ASKS_PU, MOVED_PU, OPEN_PU, STILL_PU, is_inside, is_pressed};

/// At rest so far from its command, pu, for so long, s.
const REST_PU: f64 = 0.04;
const REST_S: f64 = 6.0;
/// Command and servomotor that both stand for so long, s, have come to rest: delays of a command are shorter. Rests are of several places where their
/// commands are so far apart, pu, in so many samples.
const PLACE_S: f64 = 1.0;
const PLACES_PU: f64 = 2.0 * MOVED_PU;
const PLACES_SAMPLES: f64 = 20.0;
/// Rests that lie on a straight line through the closed stop, give or take so much, pu, are those of a scaled channel.
const ON_LINE_PU: f64 = 0.006;

/// Inside of its stops a servomotor rests at its command with a spool that stands near neutral, pu: ports overlap by some per cent, and transducers are off by 30 % at most.
const NEUTRAL_PU: f64 = 0.4;

/// A spool that is open for such a share of a rest holds the servomotor against something.
const HELD_SHARE: f64 = 0.9;
/// A command is taken so many times by a governor (the catalogue's `command_gain`), give or take this share; by more, a channel is another's.
const GAINS: std::ops::RangeInclusive<f64> = 0.5..=2.0;
const ALIKE: f64 = 0.2;
/// Of the position's variance so much is left by a multiple of the command, at most: what it lags by.
const LEFT: f64 = 0.3;

/// Whether so many times its command a servomotor goes where a governor takes it so.
pub(super) fn may_be_gain(ratio: f64) -> bool {
    (GAINS.start() * (1.0 - ALIKE)..=GAINS.end() * (1.0 + ALIKE)).contains(&ratio)
}

/// Where a servomotor is, off its stops and not tripped, against its command.
#[derive(Clone, Copy, Debug, Default)]
pub struct Followed {
    count: f64,
    commands: [f64; 2],
    positions: [f64; 2],
    products: f64,
}

impl Followed {
    /// Takes a row.
    pub fn take(&mut self, frame: &Frame) {
        let (command, position) = (frame.inputs.opening_command_pu, Signal::ServomotorPosition.of(&frame.measured));
        if frame.inputs.esv != EsvState::Normal || !is_inside(position) || !command.is_finite() {
            return;
        }
        self.count += 1.0;
        self.commands = [self.commands[0] + command, self.commands[1] + command * command];
        self.positions = [self.positions[0] + position, self.positions[1] + position * position];
        self.products += command * position;
    }

    fn variance(&self) -> f64 {
        self.positions[1] - self.positions[0].powi(2) / self.count
    }

    /// How many times its command the servomotor goes, where such a multiple tells where it is.
    pub fn multiple(&self) -> Option<f64> {
        let multiple = self.products / self.commands[1];
        (self.positions[1] - multiple * self.products < LEFT * self.variance()).then_some(multiple)
    }

    /// The same where no offset tells it better, and a governor can have that gain.
    pub(super) fn gain(&self) -> Option<f64> {
        let gain = self.multiple()?;
        let errors = self.positions[1] - 2.0 * self.products + self.commands[1];
        let left_by_offset = errors - (self.positions[0] - self.commands[0]).powi(2) / self.count;
        let tells = self.positions[1] - gain * self.products < left_by_offset
            && self.variance() > self.count * MOVED_PU.powi(2);
        (tells && may_be_gain(gain) && (gain - 1.0).abs() > 0.5 * ALIKE).then_some(gain)
    }
}

/// Where and when something impossible was seen.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Seen {
    time_ns: i64,
    position_pu: f64,
    command_pu: f64,
    duration_s: f64,
    /// The mean of the spool, where it stood open nearly all the time, pu.
    spool_pu: Option<f64>,
}

/// A servomotor that stands still, and its command meanwhile.
#[derive(Clone, Copy, Debug)]
struct StillRun {
    servo: Stay,
    command: Stay,
    /// The command while it is elsewhere.
    away: Option<Stay>,
    /// Sum of the spools meanwhile, and how many of them are open to one side less those to the other.
    spools_pu: f64,
    open: f64,
}

/// Sums over the samples at rest.
#[derive(Clone, Copy, Debug, Default)]
struct Places {
    samples: f64,
    command_squares: f64,
    products: f64,
    position_squares: f64,
    least: f64,
    most: f64,
    farthest: f64,
    /// Spools that were measured inside of the stops, and their sum, pu.
    spools: f64,
    spools_pu: f64,
}

/// What a servomotor's rests show.
#[derive(Clone, Debug, Default)]
pub(super) struct RestWatch {
    run: Option<StillRun>,
    longest: Option<Seen>,
    places: Places,
}

impl RestWatch {
    pub(super) fn take(&mut self, time_ns: i64, command: f64, [servo, spool]: [f64; 2], normal: bool) {
        if !normal {
            self.run = None;
            return;
        }
        let still = self.run.map(|run| StillRun {
            servo: run.servo.with(time_ns, servo),
            command: run.command.within(time_ns, command, STILL_PU),
            ..run
        });
        let (servo_here, command_here) = (Stay::new(time_ns, servo), Stay::new(time_ns, command));
        let still = still.filter(|run| run.servo.span() <= STILL_PU);
        let mut run = still.unwrap_or(StillRun {
            servo: servo_here,
            command: command_here,
            away: None,
            spools_pu: 0.0,
            open: 0.0,
        });
        let pressed = is_pressed(servo, command);
        if run.command.lasted_s() > PLACE_S && !pressed && command.is_finite() {
            self.places.take(command, servo, spool);
        }
        let away = (command - servo).abs() >= REST_PU && !pressed;
        if run.away.is_none() {
            (run.spools_pu, run.open) = (0.0, 0.0);
        }
        run.away = away.then(|| run.away.map_or(command_here, |away| away.with(time_ns, command)));
        run.spools_pu += spool;
        run.open += if spool.abs() > OPEN_PU { spool.signum() } else { 0.0 };
        self.run = Some(run);
        let Some(away) = run.away else { return };
        let duration_s = away.lasted_s();
        if duration_s > REST_S && self.longest.is_none_or(|longest| longest.duration_s < duration_s) {
            let samples = away.samples as f64;
            let spool_pu = Some(run.spools_pu / samples).filter(|_| run.open.abs() > HELD_SHARE * samples);
            let time_ns = away.since_ns;
            self.longest = Some(Seen { time_ns, position_pu: servo, command_pu: command, duration_s, spool_pu });
        }
    }

    /// Rests that are elsewhere, all by one scale, or one for long.
    pub(super) fn found(&self, followed: Option<f64>) -> Option<Impossible> {
        let elsewhere = |Seen { time_ns, position_pu, command_pu, duration_s, spool_pu }| {
            let ratio = position_pu / command_pu;
            let is_scaled = followed.is_some_and(|followed| (followed / ratio - 1.0).abs() < ALIKE);
            let meant = match spool_pu {
                Some(spool_pu) => Meant::Held { spool_pu },
                None if is_scaled => Meant::Scaled,
                None => Meant::Nothing,
            };
            Impossible::RestsElsewhere { position_pu, command_pu, time_ns, duration_s, meant }
        };
        self.places.open().or(self.places.scaled()).or(self.longest.map(elsewhere))
    }
}

impl Places {
    fn take(&mut self, command: f64, position: f64, spool: f64) {
        // One that a load or a leak holds off its command, or a stop, stands so with an open spool.
        let is_there = (command - position).abs() < ASKS_PU && is_inside(position);
        if spool.is_finite() && is_there {
            (self.spools, self.spools_pu) = (self.spools + 1.0, self.spools_pu + spool);
        }
        if spool.abs() > OPEN_PU && !is_there {
            return;
        }
        let first = self.samples == 0.0;
        (self.least, self.most) =
            if first { (command, command) } else { (self.least.min(command), self.most.max(command)) };
        self.samples += 1.0;
        self.command_squares += command * command;
        self.products += command * position;
        self.position_squares += position * position;
        self.farthest = self.farthest.max((command - position).abs());
    }

    /// A spool that does not stand near neutral meanwhile.
    fn open(&self) -> Option<Impossible> {
        let spool_pu = self.spools_pu / self.spools;
        (self.spools > PLACES_SAMPLES && spool_pu.abs() > NEUTRAL_PU).then_some(Impossible::RestsOpen { spool_pu })
    }

    fn scaled(&self) -> Option<Impossible> {
        let ratio = self.products / self.command_squares.max(f64::MIN_POSITIVE);
        let left = (self.position_squares - ratio * self.products).max(0.0) / self.samples.max(1.0);
        let places_pu = self.most - self.least;
        let is_scaled = self.samples > PLACES_SAMPLES
            && places_pu > PLACES_PU
            && self.farthest > REST_PU
            && left.sqrt() < ON_LINE_PU
            && ratio > 0.0;
        // Two rests of which one is right are on no line through the closed stop, unless that one is the closed stop.
        (is_scaled && (ratio - 1.0).abs() * self.most > REST_PU).then_some(Impossible::Scaled {
            ratio,
            least_pu: self.least,
            most_pu: self.most,
            left_pu: left.sqrt(),
        })
    }
}
