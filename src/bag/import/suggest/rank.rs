//! Which column is most likely which signal: names, units, ranges, and how signals of a servo system hang together.

use super::Suggestion;
use super::column::SuggestedColumn;
use super::machines::machines;
use super::names::score;
use super::propose::{guessed_pressure, rounded, signal};
use crate::import::convert::{is_travel, pressure, share};
use crate::import::findings::CorrelationSums;
use crate::import::map::{Map, SignalMap, SignalPlace};
use crate::import::row::Target;

/// A column with less evidence is not proposed.
const ENOUGH: f64 = 2.0;
/// Columns whose relations are looked at.
const MOST_RELATED: usize = 40;
/// What a perfect relation of spool and servomotor speed counts, and of command and servomotor.
const RELATED: (f64, f64) = (5.0, 3.0);
/// A weaker correlation is none.
const WEAKEST: f64 = 0.4;
/// A correlation that is weaker by less than this is as good.
const RIVAL: f64 = 0.05;
/// Why a column was taken for a signal.
#[derive(Clone, Debug, PartialEq)]
pub struct Proposed {
    /// The signal.
    pub target: Target,
    /// Number of its column among those of the suggestion; none where nothing was found.
    pub column: Option<usize>,
    /// Evidence: 2 is some, 5 is plenty.
    pub score: f64,
    /// In words.
    pub why: String,
}

/// A column with its evidence and its reasons; none where none is good enough.
type Choice = Option<(usize, f64, Vec<String>)>;

/// How two columns hang together.
struct Relations {
    /// Correlation of the speed of the first with the second.
    drives: Vec<Vec<f64>>,
    /// Correlation of both.
    alike: Vec<Vec<f64>>,
}

/// Proposes a map; `fields` says that columns are fields of messages.
pub(super) fn rank(mut map: Map, columns: Vec<SuggestedColumn>, fields: bool) -> Suggestion {
    let own: Evidence = columns.iter().map(|column| Target::ALL.map(|target| evidence(column, target))).collect();
    let machines = machines(columns.iter().map(|column| column.name.as_str()));
    // Signals of one proposal are of one machine: of several, the one with most evidence.
    let choices = (0..machines.words.len().max(1)).map(|machine| {
        let choice = choose(&columns, &own, &|column| machines.may_be_of(column, machine));
        (machine, choice.chosen.iter().flatten().map(|(_, sum, _)| sum).sum::<f64>(), choice)
    });
    let best = choices.reduce(|best, other| if other.1 > best.1 + TIE { other } else { best });
    let Some((machine, _, Chosen { chosen, related, relations })) = best else { return Suggestion::default() };
    let mut open = vec![];
    if let Some(word) = machines.words.get(machine) {
        let all: Vec<String> = machines.words.iter().map(|word| format!("`{word}`")).collect();
        open.push(format!(
            "machines: the file holds signals that {} in their names tell apart; the map takes those of `{word}` alone; for another, name its \
             columns",
            all.join(", ")
        ));
    }
    let of = |target: Target| chosen[target.place()].as_ref().map(|(column, ..)| *column);
    let servomotor = of(Target::ServomotorPosition).and_then(|column| columns.get(column));
    let mut reasons = vec![];
    for target in Target::ALL {
        match &chosen[target.place()] {
            Some((column, sum, why)) => {
                let at = |wanted: usize| related.iter().position(|column| *column == wanted);
                let drives = of(Target::ServomotorPosition)
                    .and_then(|servomotor| Some(relations.drives[at(servomotor)?][at(*column)?]))
                    .unwrap_or(0.0);
                let turned = target == Target::SpoolPosition && drives < -WEAKEST;
                let signal = signal(target, &columns[*column], fields, turned, servomotor, &mut open);
                map.signals.push(signal);
                reasons.push(Proposed { target, column: Some(*column), score: *sum, why: why.join(", ") });
            }
            None => absent(target, &chosen, &mut map, &mut reasons, &mut open),
        }
    }
    open.extend(competing(&columns, &related, &relations, &chosen));
    Suggestion { map, columns, reasons, notes: vec![], open, rows: 0 }
}

/// What speaks for each column as each signal.
type Evidence = Vec<[(f64, Vec<String>); Target::ALL.len()]>;

/// Less evidence more does not prefer one machine to the one that stands before it in the file.
const TIE: f64 = 0.5;

/// Columns chosen for the signals, and how columns hang together.
#[expect(clippy::struct_field_names, reason = "what was chosen, and what hangs together")]
struct Chosen {
    chosen: Vec<Choice>,
    related: Vec<usize>,
    relations: Relations,
}

/// Chooses columns for the signals among those that are allowed.
fn choose(columns: &[SuggestedColumn], own: &Evidence, allowed: &dyn Fn(usize) -> bool) -> Chosen {
    let score = |column: usize, target: Target| own[column][target.place()].0;
    let mut chosen: Vec<Choice> = vec![None; Target::ALL.len()];
    let trio = [Target::ServomotorPosition, Target::SpoolPosition, Target::OpeningCommand];
    let most = |column: &usize| trio.iter().map(|target| score(*column, *target)).fold(f64::NEG_INFINITY, f64::max);
    // A command may be one step.
    let steps = |column: usize| !columns[column].is_switch() && score(column, Target::OpeningCommand) >= ENOUGH;
    let mut related: Vec<usize> = (0..columns.len())
        .filter(|&column| allowed(column) && columns[column].moves() && (!columns[column].is_binary() || steps(column)))
        .collect();
    related.sort_by(|a, b| most(b).total_cmp(&most(a)));
    related.truncate(MOST_RELATED);
    let relations = relations(columns, &related);
    let best = best_trio(&related, &relations, &score);
    for (target, found) in trio.into_iter().zip(best) {
        let Some((at, sum, words)) = found else { continue };
        let mut why = own[related[at]][target.place()].1.clone();
        why.extend(words);
        chosen[target.place()] = Some((related[at], sum, why));
    }
    for target in [Target::TankPressure, Target::ControlPressure, Target::Esv, Target::PilotValvePosition] {
        let taken = |column: usize| chosen.iter().flatten().any(|(known, ..)| *known == column);
        let free =
            (0..columns.len()).filter(|column| allowed(*column) && !taken(*column) && score(*column, target) >= ENOUGH);
        let found = free.max_by(|a, b| score(*a, target).total_cmp(&score(*b, target)).then(b.cmp(a)));
        chosen[target.place()] = found.map(|column| {
            let (sum, why) = own[column][target.place()].clone();
            (column, sum, why)
        });
    }
    Chosen { chosen, related, relations }
}

/// Columns that move with the spool as the chosen servomotor does: which of them is the piston only its reader knows.
fn competing(
    columns: &[SuggestedColumn],
    related: &[usize],
    relations: &Relations,
    chosen: &[Choice],
) -> Option<String> {
    let of = |target: Target| chosen[target.place()].as_ref().map(|(column, ..)| *column);
    let (servomotor, spool) = (of(Target::ServomotorPosition)?, of(Target::SpoolPosition)?);
    let at = |wanted: usize| related.iter().position(|column| *column == wanted);
    let spool_at = at(spool)?;
    let best = relations.drives[at(servomotor)?][spool_at].abs();
    let taken = |column: usize| chosen.iter().flatten().any(|(known, ..)| *known == column);
    let alike = |&&column: &&usize| {
        !taken(column) && at(column).is_some_and(|at| relations.drives[at][spool_at].abs() > best - RIVAL)
    };
    let names: Vec<String> =
        related.iter().filter(alike).map(|column| format!("`{}`", columns[*column].name)).collect();
    (!names.is_empty() && best >= WEAKEST).then(|| {
        format!(
            "servomotor_position: also {} moves with the spool as `{}` does; take the one that is the piston's position",
            names.join(", "),
            columns[servomotor].name
        )
    })
}

/// A signal that no column seems to hold.
fn absent(target: Target, chosen: &[Choice], map: &mut Map, reasons: &mut Vec<Proposed>, open: &mut Vec<String>) {
    let has_command = chosen[Target::OpeningCommand.place()].is_some();
    match target {
        Target::Esv if has_command => {
            map.signals.push(SignalMap { from: SignalPlace::Constant(1.0), ..SignalMap::of_column(target, "") });
            let why = "no column of trips found: taken as never tripped".to_owned();
            reasons.push(Proposed { target, column: None, score: 0.0, why });
        }
        Target::TankPressure if has_command => open.push(
            "tank_pressure: no column found; name one, or give what the manometer shows: `tank_pressure: {constant: 63, unit: bar}`".to_owned(),
        ),
        Target::OpeningCommand => open.push(
            "opening_command: no column found; without one the servomotor stage alone can be judged, driven by its spool".to_owned(),
        ),
        Target::SpoolPosition | Target::ServomotorPosition => {
            open.push(format!("{}: no column found; what only it shows stays unseen", target.id()));
        }
        _ => {}
    }
}

/// What name, unit, range and shape of a column speak for a signal.
fn evidence(column: &SuggestedColumn, target: Target) -> (f64, Vec<String>) {
    let mut why = vec![];
    let (mut sum, words) = score(&column.name, target);
    if sum > 0.0 && !words.is_empty() {
        why.push(format!("its name ({})", words.join(", ")));
    }
    if column.range.count == 0 && column.texts == 0 {
        return (f64::NEG_INFINITY, why);
    }
    let is_pressure = pressure(&column.unit).is_some();
    if is_pressure && target.is_pressure() {
        sum += 2.0;
        why.push(format!("its unit {}", column.unit));
    } else if target.is_pressure() && column.is_live_zero() {
        why.push("the current of a transmitter".to_owned());
    } else if is_pressure != target.is_pressure() && !column.unit.is_empty() {
        sum -= 5.0;
    } else if share(&column.unit).is_some() && !target.is_pressure() && target != Target::Esv {
        sum += 1.0;
        why.push(format!("its unit {}", column.unit));
    } else if is_travel(&column.unit) && !target.is_pressure() {
        sum += 0.5;
    }
    if target == Target::Esv {
        if column.is_binary() {
            why.push("two states".to_owned());
        } else {
            sum -= 6.0;
        }
    } else if column.range.count == 0
        || (column.moves() && if target == Target::OpeningCommand { column.is_switch() } else { column.is_binary() })
    {
        sum -= 6.0;
    } else if target == Target::TankPressure {
        let [least, most] = column.range.ends();
        if least > 0.0 && most < 2.0 * least && guessed_pressure(most).is_some() {
            sum += 1.0;
            why.push(format!("it stays between {} and {}", rounded(least), rounded(most)));
        }
    }
    (sum, why)
}

/// Servomotor, spool and command that go together best; numbers are places in `related`.
fn best_trio(related: &[usize], relations: &Relations, score: &dyn Fn(usize, Target) -> f64) -> [Choice; 3] {
    let count = related.len();
    let own = |at: usize, target: Target| score(related[at], target);
    let strong = |value: f64| if value.abs() >= WEAKEST { value.abs() } else { 0.0 };
    let drives = |servomotor: usize, spool: usize| RELATED.0 * strong(relations.drives[servomotor][spool]);
    let alike = |servomotor: usize, command: usize| RELATED.1 * strong(relations.alike[servomotor][command].max(0.0));
    let mut best: (f64, [Option<usize>; 3]) = (0.0, [None; 3]);
    let with_none = || (0..count).map(Some).chain([None]);
    for servomotor in with_none() {
        for spool in with_none().filter(|spool| spool.is_none() || *spool != servomotor) {
            for command in with_none().filter(|one| one.is_none() || (*one != servomotor && *one != spool)) {
                let relation = servomotor.zip(spool).map_or(0.0, |(servomotor, spool)| drives(servomotor, spool));
                let follows = servomotor.zip(command).map_or(0.0, |(servomotor, command)| alike(servomotor, command));
                let name = |at: Option<usize>, target: Target| at.map_or(0.0, |at| own(at, target));
                // Each must be worth its place: by its name, or by what it has to do with the servomotor. Nobody takes a
                // command by its shape alone: much goes with an opening.
                let worth = |at: Option<usize>, sum: f64| at.is_none() || sum >= ENOUGH;
                let sums = [
                    name(servomotor, Target::ServomotorPosition) + relation,
                    name(spool, Target::SpoolPosition) + relation,
                    name(command, Target::OpeningCommand),
                ];
                let total = sums[0] + name(spool, Target::SpoolPosition) + sums[2] + follows;
                let fits = worth(servomotor, sums[0]) && worth(spool, sums[1]) && worth(command, sums[2]);
                if fits && total > best.0 {
                    best = (total, [servomotor, spool, command]);
                }
            }
        }
    }
    let [servomotor, spool, command] = best.1;
    let relation =
        |words: &str, value: f64| (value.abs() >= WEAKEST).then(|| format!("{words} (correlation {value:.2})"));
    let driven = servomotor.zip(spool).map(|(servomotor, spool)| relations.drives[servomotor][spool]);
    let follows = servomotor.zip(command).map(|(servomotor, command)| relations.alike[servomotor][command]);
    let driven_words = driven.and_then(|value| relation("spool and speed of the servomotor go together", value));
    let follow_words = follows.and_then(|value| relation("the servomotor follows it", value));
    let choice = |at: Option<usize>, target: Target, more: f64, words: Option<String>| {
        at.map(|at| (at, own(at, target) + more, words.into_iter().collect()))
    };
    let by_drive = servomotor.zip(spool).map_or(0.0, |(servomotor, spool)| drives(servomotor, spool));
    let by_follow = servomotor.zip(command).map_or(0.0, |(servomotor, command)| alike(servomotor, command));
    [
        choice(servomotor, Target::ServomotorPosition, by_drive, driven_words.clone()),
        choice(spool, Target::SpoolPosition, by_drive, driven_words),
        choice(command, Target::OpeningCommand, by_follow, follow_words),
    ]
}

/// Correlations of all pairs over buckets of one width.
fn relations(columns: &[SuggestedColumn], related: &[usize]) -> Relations {
    let widest = related.iter().map(|column| columns[*column].envelope.width_ns()).max().unwrap_or(0);
    let envelopes: Vec<_> = related
        .iter()
        .map(|column| {
            let mut envelope = columns[*column].envelope.clone();
            while envelope.width_ns() < widest {
                envelope.widen();
            }
            envelope
        })
        .collect();
    let pairs = |first: usize, second: usize| {
        let (mut drives, mut alike) = (CorrelationSums::default(), CorrelationSums::default());
        let (from, to) = envelopes[first].span();
        for at in from..to {
            let (Some(value), Some(other)) = (envelopes[first].mean_at(at), envelopes[second].mean_at(at)) else {
                continue;
            };
            alike.take(value, other);
            // The speed over two widths is that of the bucket between.
            if let (Some(before), Some(after)) = (envelopes[first].mean_at(at - 1), envelopes[first].mean_at(at + 1)) {
                drives.take(after - before, other);
            }
        }
        (drives.correlation(), alike.correlation())
    };
    let all: Vec<Vec<(f64, f64)>> =
        (0..related.len()).map(|first| (0..related.len()).map(|second| pairs(first, second)).collect()).collect();
    Relations {
        drives: all.iter().map(|row| row.iter().map(|pair| pair.0).collect()).collect(),
        alike: all.iter().map(|row| row.iter().map(|pair| pair.1).collect()).collect(),
    }
}
