//! Whether the spool moves before the command that moves it: seen where a command leaves a rest.

use super::impossible::Impossible;
use super::stay::Stay;
use govtwin_model::units::seconds_from_nanos;

/// A command rests where it stays within this band, pu; a regulator of any usual gain makes less of it than a spool that moves.
const RESTS_PU: f64 = 1e-4;
/// It has rested after so long, s.
const RESTED_S: f64 = 1.0;
/// A spool that is so far from where it stood, pu, for so long before, s, has moved.
const SPOOL_PU: f64 = 0.05;
const STOOD_S: f64 = 0.5;
/// A spool that moved earlier than this, s, before its command did, was moved by something else.
const EARLIEST_S: f64 = 1.0;
/// One that moved no earlier than this, s, may have a stamp that is late by a cycle of its sender.
const LEAD_S: f64 = 0.02;

/// A command that has just left its rest.
#[derive(Clone, Copy, Debug)]
struct Onset {
    time_ns: i64,
    command: f64,
    /// When the spool left its own, in the command's direction, ns.
    spool_ns: Option<i64>,
    spool_pu: f64,
}

/// What is seen where commands leave their rests.
#[derive(Clone, Debug, Default)]
pub(super) struct OnsetWatch {
    command: Option<Stay>,
    spool: Option<Stay>,
    /// When the spool left the last place at which it stood, ns, and from where.
    left: Option<(i64, f64)>,
    onset: Option<Onset>,
    onsets: u64,
    leads: u64,
    longest: Option<(f64, f64, i64)>,
}

impl OnsetWatch {
    pub(super) fn take(&mut self, time_ns: i64, command: f64, spool: f64, normal: bool) {
        if !normal || !command.is_finite() || !spool.is_finite() {
            (self.command, self.spool, self.left, self.onset) = (None, None, None, None);
            return;
        }
        let rest = self.command.unwrap_or(Stay::new(time_ns, command));
        self.command = Some(rest.within(time_ns, command, RESTS_PU));
        if !rest.holds(command, RESTS_PU) {
            self.moved(rest, command, time_ns, spool);
        }
        let place = self.spool.unwrap_or(Stay::new(time_ns, spool));
        let here = place.within(time_ns, spool, SPOOL_PU);
        self.spool = Some(here);
        if here.lasted_s() > STOOD_S {
            self.left = None;
        } else if !place.holds(spool, SPOOL_PU) && place.lasted_s() > STOOD_S {
            self.left = Some((time_ns, place.first));
        }
    }

    /// The command is elsewhere than before. Only its second step says how far apart its samples are, and when the first may have begun.
    fn moved(&mut self, rest: Stay, command: f64, time_ns: i64, spool: f64) {
        if let Some(Onset { time_ns: first_ns, command: from, spool_ns, spool_pu }) = self.onset.take() {
            let period_ns = time_ns.saturating_sub(first_ns);
            if seconds_from_nanos(period_ns) < EARLIEST_S && (command - from) * spool_pu >= 0.0 {
                self.onsets += 1;
                let lead_s = spool_ns.map_or(0.0, |spool_ns| {
                    seconds_from_nanos(first_ns.saturating_sub(period_ns).saturating_sub(spool_ns))
                });
                if lead_s > LEAD_S && lead_s < EARLIEST_S {
                    self.leads += 1;
                    if self.longest.is_none_or(|(longest_s, ..)| longest_s < lead_s) {
                        self.longest = Some((lead_s, spool_pu, first_ns));
                    }
                }
            }
        }
        if rest.lasted_s() > RESTED_S {
            let moved = self.left.map(|(left_ns, from)| (left_ns, spool - from));
            let with = moved.filter(|(_, spool_pu)| spool_pu * (command - rest.first) > 0.0);
            self.onset = Some(Onset {
                time_ns,
                command: rest.first,
                spool_ns: with.map(|(left_ns, _)| left_ns),
                spool_pu: with.map_or(0.0, |(_, spool_pu)| spool_pu),
            });
        }
    }

    /// A spool that moves before its command wherever that can be seen.
    pub(super) fn found(&self) -> Option<Impossible> {
        let (lead_s, spool_pu, time_ns) = self.longest?;
        let Self { onsets, leads, .. } = *self;
        (2 * leads > onsets).then_some(Impossible::Precedes { lead_s, spool_pu, time_ns, onsets, leads })
    }
}
