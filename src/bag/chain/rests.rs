//! Where the servomotor rests, and where its command is then.

use super::impossible::Impossible;
use super::stay::Stay;
use super::{ASKS_PU, MOVED_PU, STILL_PU, is_pressed};

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

/// Where and when something impossible was seen.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Seen {
    time_ns: i64,
    position_pu: f64,
    command_pu: f64,
    duration_s: f64,
}

/// A servomotor that stands still, and its command meanwhile.
#[derive(Clone, Copy, Debug)]
struct StillRun {
    servo: Stay,
    command: Stay,
    /// The command while it is elsewhere.
    away: Option<Stay>,
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
        let mut run = still.unwrap_or(StillRun { servo: servo_here, command: command_here, away: None });
        let pressed = is_pressed(servo, command);
        if run.command.lasted_s() > PLACE_S && !pressed && command.is_finite() {
            self.places.take(command, servo, spool);
        }
        let away = (command - servo).abs() >= REST_PU && !pressed;
        run.away = away.then(|| run.away.map_or(command_here, |away| away.with(time_ns, command)));
        self.run = Some(run);
        let Some(away) = run.away else { return };
        let duration_s = away.lasted_s();
        if duration_s > REST_S && self.longest.is_none_or(|longest| longest.duration_s < duration_s) {
            self.longest = Some(Seen { time_ns: away.since_ns, position_pu: servo, command_pu: command, duration_s });
        }
    }

    /// Rests that are elsewhere, all by one scale, or one for long.
    pub(super) fn found(&self) -> Option<Impossible> {
        let elsewhere = |Seen { time_ns, position_pu, command_pu, duration_s }| Impossible::RestsElsewhere {
            position_pu,
            command_pu,
            time_ns,
            duration_s,
        };
        self.places.open().or(self.places.scaled()).or(self.longest.map(elsewhere))
    }
}

impl Places {
    fn take(&mut self, command: f64, position: f64, spool: f64) {
        let first = self.samples == 0.0;
        (self.least, self.most) =
            if first { (command, command) } else { (self.least.min(command), self.most.max(command)) };
        self.samples += 1.0;
        self.command_squares += command * command;
        self.products += command * position;
        self.position_squares += position * position;
        self.farthest = self.farthest.max((command - position).abs());
        // One that a load or a leak holds off its command stands so with an open spool.
        let is_there = (command - position).abs() < ASKS_PU && (0.02..=0.98).contains(&position);
        if spool.is_finite() && is_there {
            (self.spools, self.spools_pu) = (self.spools + 1.0, self.spools_pu + spool);
        }
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
