//! Which columns are servomotor, spool and command: by their names, and by what they do to each other.

use super::propose::rounded;
use super::rank::{Choice, ENOUGH};
use super::relations::{Relation, WEAKEST};
use crate::import::row::Target;

/// What a perfect relation of spool and servomotor speed counts, and of command and servomotor.
const RELATED: (f64, f64) = (5.0, 3.0);
/// Share of the evidence of a name that alone is not enough.
const LITTLE: f64 = 0.02;

/// Servomotor, spool and command that go together best; numbers are places in `related`.
pub(super) fn best_trio(
    related: &[usize],
    relations: &[Vec<Relation>],
    score: &dyn Fn(usize, Target) -> f64,
    may_drive: &dyn Fn(usize, f64) -> bool,
) -> [Choice; 3] {
    let count = related.len();
    let own = |at: usize, target: Target| score(related[at], target);
    let strong = |value: f64| if value.abs() >= WEAKEST { value.abs() } else { 0.0 };
    let drives = |servomotor: usize, spool: usize| RELATED.0 * strong(relations[servomotor][spool].drives);
    let leads = |servomotor: usize, command: usize| RELATED.1 * strong(relations[servomotor][command].leads);
    let follows = |servomotor: usize, command: usize| match leads(servomotor, command) {
        // What comes at the same time says less than what comes before.
        0.0 => RELATED.1 * strong(relations[servomotor][command].alike.max(0.0)),
        led => led,
    };
    let mut best: (f64, [Option<usize>; 3]) = (0.0, [None; 3]);
    let with_none = || (0..count).map(Some).chain([None]);
    for servomotor in with_none() {
        for spool in with_none().filter(|spool| spool.is_none() || *spool != servomotor) {
            let relation = servomotor.zip(spool).map_or(0.0, |(servomotor, spool)| drives(servomotor, spool));
            let by = servomotor.zip(spool).map_or(0.0, |(servomotor, spool)| relations[servomotor][spool].drives);
            if spool.is_some_and(|spool| !may_drive(related[spool], by)) {
                continue;
            }
            for command in with_none().filter(|one| one.is_none() || (*one != servomotor && *one != spool)) {
                let pair = servomotor.zip(command);
                let by_follow = pair.map_or(0.0, |(servomotor, command)| follows(servomotor, command));
                let led = pair.map_or(0.0, |(servomotor, command)| leads(servomotor, command));
                let name = |at: Option<usize>, target: Target| at.map_or(0.0, |at| own(at, target));
                // Each must be worth its place: by its name, or by what it has to do with the servomotor. Nobody takes a
                // command because it is like an opening, which much is, but because the servomotor comes after it.
                let worth = |at: Option<usize>, sum: f64| at.is_none() || sum >= ENOUGH;
                let sums = [
                    name(servomotor, Target::ServomotorPosition) + relation.max(led),
                    name(spool, Target::SpoolPosition) + relation,
                    name(command, Target::OpeningCommand),
                ];
                // A name that says little, as `y` does, decides between equals alone.
                let called = name(servomotor, Target::ServomotorPosition);
                let called = if (0.0..ENOUGH).contains(&called) { LITTLE * called } else { called };
                let total = called + relation + name(spool, Target::SpoolPosition) + sums[2] + by_follow;
                let fits = worth(servomotor, sums[0]) && worth(spool, sums[1]) && worth(command, sums[2] + led);
                if fits && total > best.0 {
                    best = (total, [servomotor, spool, command]);
                }
            }
        }
    }
    let [servomotor, spool, command] = best.1;
    let driven = servomotor
        .zip(spool)
        .map(|(servomotor, spool)| (relations[servomotor][spool].drives, drives(servomotor, spool)));
    let followed = servomotor
        .zip(command)
        .map(|(servomotor, command)| (relations[servomotor][command], follows(servomotor, command)));
    let driven_words = driven
        .filter(|(value, _)| value.abs() >= WEAKEST)
        .map(|(value, _)| format!("spool and speed of the servomotor go together (correlation {value:.2})"));
    let follow_words = followed.and_then(|(relation, _)| match relation {
        Relation { leads, settles_s, .. } if leads.abs() >= WEAKEST => Some(format!(
            "the servomotor follows it with a time constant of {} s (correlation {leads:.2})",
            rounded(settles_s)
        )),
        Relation { alike, .. } if alike >= WEAKEST => {
            Some(format!("the servomotor follows it (correlation {alike:.2})"))
        }
        _ => None,
    });
    let choice = |at: Option<usize>, target: Target, more: f64, words: [Option<String>; 2]| {
        at.map(|at| (at, own(at, target) + more, words.into_iter().flatten().collect()))
    };
    let (by_drive, by_follow) = (driven.map_or(0.0, |one| one.1), followed.map_or(0.0, |one| one.1));
    let of_servomotor = follow_words.clone().filter(|_| driven_words.is_none());
    [
        choice(servomotor, Target::ServomotorPosition, by_drive, [driven_words.clone(), of_servomotor]),
        choice(spool, Target::SpoolPosition, by_drive, [driven_words, None]),
        choice(command, Target::OpeningCommand, by_follow, [follow_words, None]),
    ]
}
