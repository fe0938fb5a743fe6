//! Whether units and signs can be meant: ranges that no governor has, and signals that go against each other.

use crate::correlation::Correlation;
use crate::import::convert::pressure;
use crate::import::row::{ImportedRow, Target};
use crate::qualification::{TANK_PA, unit_of_pressure};
use govtwin_model::units::seconds_from_nanos;

/// The least correlation between spool and servomotor speed that decides on a sign.
const DECIDES: f64 = 0.4;
/// Time over which a speed is taken, ns.
const SPEED_OVER_NS: i64 = 100_000_000;
/// And the least number of pairs.
const FEWEST_PAIRS: f64 = 100.0;

/// Count and extremes of a signal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Range {
    /// Values.
    pub count: u64,
    least: f64,
    most: f64,
}

impl Default for Range {
    fn default() -> Self {
        Self { count: 0, least: f64::INFINITY, most: f64::NEG_INFINITY }
    }
}

impl Range {
    /// One more value.
    pub fn take(&mut self, value: f64) {
        self.count += 1;
        self.least = self.least.min(value);
        self.most = self.most.max(value);
    }

    /// Least and greatest value, in the signal's unit.
    pub fn ends(&self) -> [f64; 2] {
        [self.least, self.most]
    }

    /// Greatest less least, in the signal's unit; 0 where there is none.
    pub fn span(&self) -> f64 {
        if self.count == 0 { 0.0 } else { self.most - self.least }
    }
}

/// What is to be said of the range of a signal, with the likely way out.
pub(super) fn unit(target: Target, range: &Range, mapped: &str, ranged: bool) -> Option<String> {
    let [least, most] = range.ends();
    let stated =
        if mapped.is_empty() { format!("no unit, which means {}", target.unit()) } else { format!("`{mapped}`") };
    match target {
        Target::Esv => None,
        Target::TankPressure => {
            if TANK_PA.contains(&most) {
                return None;
            }
            // What the file holds.
            let factor = pressure(mapped).map_or(1.0, |unit| unit.apply(1.0) - unit.apply(0.0));
            let hint = unit_of_pressure(most / factor).filter(|_| !ranged);
            let hint = hint.map_or(String::new(), |name| format!("; is it in {name}? then give `unit: {name}`"));
            Some(format!(
                "reaches {most:.4} Pa, expected {:.1e} to {:.1e} Pa of a governor's oil supply; the map says {stated}{hint}",
                TANK_PA.start(),
                TANK_PA.end()
            ))
        }
        Target::ControlPressure => {
            let odd = !(-2e5..=1e8).contains(&least) || most > 1e8 || (most.abs() < 1e3 && range.span() > 0.0);
            let name = if most.abs() < 40.0 { "MPa or bar" } else { "bar" };
            odd.then(|| format!("runs from {least:.4} to {most:.4} Pa, which no control chamber does; the map says {stated}; is it in {name}?"))
        }
        _ => {
            let farthest = least.abs().max(most.abs());
            let percent = mapped == "%";
            if percent && farthest <= 0.0125 && range.span() > 0.0 {
                let raw = farthest * 100.0;
                return Some(format!(
                    "moves by {:.3} % of its stroke at most ({raw:.3} in the file); is it in pu? then give `unit: pu`",
                    range.span() * 100.0
                ));
            }
            let reaches = format!(
                "runs from {least:.4} to {most:.4} pu, expected about {}; the map says {stated}",
                usual(target)
            );
            match farthest {
                ..=1.6 => None,
                ..=160.0 if !percent && !ranged => Some(format!(
                    "{reaches}; is it in percent? then give `unit: \"%\"`, and for mm or volts `range: [value when closed, value when open]`"
                )),
                _ => Some(format!(
                    "{reaches}; give `range: [value when closed, value when open]` in the file's own unit"
                )),
            }
        }
    }
}

fn usual(target: Target) -> &'static str {
    match target {
        Target::OpeningCommand | Target::ServomotorPosition => "0 to 1",
        _ => "-1 to 1",
    }
}

/// −1 to 1; 0 where too few pairs say it.
fn decided(sums: &Correlation) -> f64 {
    if sums.pairs >= FEWEST_PAIRS { sums.value() } else { 0.0 }
}

/// Which signals should go together.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Meant {
    last: Option<(i64, f64)>,
    /// Sum and number of spool positions since then.
    between: (f64, f64),
    /// Spool against the servomotor's speed.
    spool: Correlation,
    /// Command against servomotor.
    command: Correlation,
    newest_command: Option<f64>,
}

impl Meant {
    pub(super) fn take(&mut self, row: &ImportedRow) {
        let (spool, opening) = (row.value(Target::SpoolPosition), row.value(Target::ServomotorPosition));
        if let (Some(spool), Some(opening)) = (spool, opening) {
            self.between = (self.between.0 + spool, self.between.1 + 1.0);
            match self.last {
                // Over less time a speed is the noise of two samples.
                Some((time_ns, _)) if (0..SPEED_OVER_NS).contains(&(row.time_ns - time_ns)) => {}
                last => {
                    if let Some((time_ns, before)) = last
                        && row.time_ns > time_ns
                    {
                        let step_s = seconds_from_nanos(row.time_ns - time_ns);
                        self.spool.take(self.between.0 / self.between.1, (opening - before) / step_s);
                    }
                    self.last = Some((row.time_ns, opening));
                    self.between = (0.0, 0.0);
                }
            }
        }
        self.newest_command = row.value(Target::OpeningCommand).or(self.newest_command);
        if let (Some(command), Some(opening)) = (self.newest_command, opening) {
            self.command.take(command, opening);
        }
    }

    pub(super) fn warnings(&self) -> Vec<String> {
        let mut found = vec![];
        if decided(&self.spool) < -DECIDES {
            found.push(format!(
                "spool_position: the servomotor moves against it (correlation of its speed with the spool {:.2}); a positive spool position \
                 opens: turn it with `sign: -1`, or swap the ends of `range`",
                decided(&self.spool)
            ));
        }
        if decided(&self.command) < -DECIDES {
            found.push(format!(
                "servomotor_position: it moves against the command (correlation {:.2}); 1 is open: swap the ends of `range`",
                decided(&self.command)
            ));
        }
        found
    }
}
