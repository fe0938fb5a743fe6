//! Where the servomotor rests, and where its command is then.

use super::impossible::Impossible;
use super::{MOVED_PU, STILL_PU, is_pressed};
use govtwin_model::units::seconds_from_nanos;

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

/// Where and when something impossible was seen.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Seen {
    time_ns: i64,
    position_pu: f64,
    command_pu: f64,
    duration_s: f64,
}

/// Values within a band.
#[derive(Clone, Copy, Debug)]
struct StillRun {
    least: f64,
    most: f64,
    /// Since when the command is elsewhere, ns.
    away_since_ns: Option<i64>,
    /// The command that stands as well, and since when, ns.
    command: f64,
    command_since_ns: i64,
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
}

/// What a servomotor's rests show.
#[derive(Clone, Debug, Default)]
pub(super) struct RestWatch {
    run: Option<StillRun>,
    longest: Option<Seen>,
    places: Places,
}

impl RestWatch {
    pub(super) fn take(&mut self, time_ns: i64, command: f64, servo: f64, normal: bool) {
        let (least, most) = self.run.map_or((servo, servo), |run| (run.least.min(servo), run.most.max(servo)));
        if most - least > STILL_PU || !normal || self.run.is_none() {
            let run = StillRun { least: servo, most: servo, away_since_ns: None, command, command_since_ns: time_ns };
            self.run = normal.then_some(run);
        }
        let Some(run) = &mut self.run else { return };
        (run.least, run.most) = (run.least.min(servo), run.most.max(servo));
        if (command - run.command).abs() > STILL_PU {
            (run.command, run.command_since_ns) = (command, time_ns);
        }
        let pressed = is_pressed(servo, command);
        let stands_s = seconds_from_nanos(time_ns.saturating_sub(run.command_since_ns));
        if stands_s > PLACE_S && !pressed && command.is_finite() {
            self.places.take(command, servo);
        }
        if (command - servo).abs() < REST_PU || command.is_nan() || pressed {
            run.away_since_ns = None;
            return;
        }
        let since_ns = *run.away_since_ns.get_or_insert(time_ns);
        let duration_s = seconds_from_nanos(time_ns.saturating_sub(since_ns));
        if duration_s > REST_S && self.longest.is_none_or(|longest| longest.duration_s < duration_s) {
            self.longest = Some(Seen { time_ns: since_ns, position_pu: servo, command_pu: command, duration_s });
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
        self.places.scaled().or(self.longest.map(elsewhere))
    }
}

impl Places {
    fn take(&mut self, command: f64, position: f64) {
        let first = self.samples == 0.0;
        (self.least, self.most) =
            if first { (command, command) } else { (self.least.min(command), self.most.max(command)) };
        self.samples += 1.0;
        self.command_squares += command * command;
        self.products += command * position;
        self.position_squares += position * position;
        self.farthest = self.farthest.max((command - position).abs());
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
