//! Whether spool or servomotor moves before the command that moves it: seen where a command leaves a rest.

use super::impossible::Impossible;
use super::stay::Stay;
use govtwin_model::signal::Signal;
use govtwin_model::units::seconds_from_nanos;

/// A command rests where it stays within this band, pu; a regulator of any usual gain makes less of it than what moves.
const RESTS_PU: f64 = 1e-4;
/// It has rested after so long, s.
const RESTED_S: f64 = 1.0;
/// What follows a command, and how far from where it stood for a while it has moved, pu.
pub(super) const FOLLOWERS: [(Signal, f64); 2] = [(Signal::SpoolPosition, 0.05), (Signal::ServomotorPosition, 0.002)];
/// So long it stood before, s.
const STOOD_S: f64 = 0.5;
/// What moved earlier than this, s, before its command did, was moved by something else.
const EARLIEST_S: f64 = 1.0;
/// One that moved no earlier than this, s, may have a stamp that is late by a cycle of its sender.
const LEAD_S: f64 = 0.02;

/// A command that has just left its rest.
#[derive(Clone, Copy, Debug)]
struct Onset {
    time_ns: i64,
    command: f64,
    /// When the follower left its own, in the command's direction, ns.
    follower_ns: Option<i64>,
    follower_pu: f64,
}

/// What is seen of a follower where commands leave their rests.
#[derive(Clone, Debug, Default)]
pub(super) struct OnsetWatch {
    command: Option<Stay>,
    follower: Option<Stay>,
    /// When it left the last place at which it stood, ns, and from where.
    left: Option<(i64, f64)>,
    onset: Option<Onset>,
    onsets: u64,
    leads: u64,
    longest: Option<(f64, f64, i64)>,
}

impl OnsetWatch {
    /// Takes a row: the command and where the follower is, which has moved when it is `moved_pu` from where it stood.
    pub(super) fn take(&mut self, time_ns: i64, command: f64, (position, moved_pu): (f64, f64), normal: bool) {
        if !normal || !command.is_finite() || !position.is_finite() {
            (self.command, self.follower, self.left, self.onset) = (None, None, None, None);
            return;
        }
        let rest = self.command.unwrap_or(Stay::new(time_ns, command));
        self.command = Some(rest.within(time_ns, command, RESTS_PU));
        if !rest.holds(command, RESTS_PU) {
            self.moved(rest, command, time_ns, position);
        }
        let place = self.follower.unwrap_or(Stay::new(time_ns, position));
        let here = place.within(time_ns, position, moved_pu);
        self.follower = Some(here);
        if here.lasted_s() > STOOD_S {
            self.left = None;
        } else if !place.holds(position, moved_pu) && place.lasted_s() > STOOD_S {
            self.left = Some((time_ns, place.first));
        }
    }

    /// The command is elsewhere than before. Only its second step says how far apart its samples are, and when the first may have begun.
    fn moved(&mut self, rest: Stay, command: f64, time_ns: i64, position: f64) {
        if let Some(Onset { time_ns: first_ns, command: from, follower_ns, follower_pu }) = self.onset.take() {
            let period_ns = time_ns.saturating_sub(first_ns);
            if seconds_from_nanos(period_ns) < EARLIEST_S && (command - from) * follower_pu >= 0.0 {
                self.onsets += 1;
                let lead_s = follower_ns.map_or(0.0, |follower_ns| {
                    seconds_from_nanos(first_ns.saturating_sub(period_ns).saturating_sub(follower_ns))
                });
                if lead_s > LEAD_S && lead_s < EARLIEST_S {
                    self.leads += 1;
                    if self.longest.is_none_or(|(longest_s, ..)| longest_s < lead_s) {
                        self.longest = Some((lead_s, follower_pu, first_ns));
                    }
                }
            }
        }
        if rest.lasted_s() > RESTED_S {
            let moved = self.left.map(|(left_ns, from)| (left_ns, position - from));
            let with = moved.filter(|(_, follower_pu)| follower_pu * (command - rest.first) > 0.0);
            self.onset = Some(Onset {
                time_ns,
                command: rest.first,
                follower_ns: with.map(|(left_ns, _)| left_ns),
                follower_pu: with.map_or(0.0, |(_, follower_pu)| follower_pu),
            });
        }
    }

    /// What moves before its command wherever that can be seen.
    pub(super) fn found(&self, signal: Signal) -> Option<Impossible> {
        let (lead_s, follower_pu, time_ns) = self.longest?;
        let Self { onsets, leads, .. } = *self;
        (2 * leads > onsets).then_some(Impossible::Precedes {
            signal,
            lead_s,
            moved_pu: follower_pu,
            time_ns,
            onsets,
            leads,
        })
    }
}
