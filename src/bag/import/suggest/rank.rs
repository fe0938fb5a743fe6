//! Which column is most likely which signal: names, units, ranges, and how signals of a servo system hang together.

use super::Suggestion;
use super::column::SuggestedColumn;
use super::machines::{machines, two_machines};
use super::names::{Figure, score, tag};
use super::propose::{may_count_closing, of_several_units, rounded, signal};
use super::relations::{Relation, WEAKEST, pairs, relations};
use super::trio::best_trio;
use super::trip::{TripSign, sign_of_trip};
use crate::import::convert::{is_pressure, is_travel, share};
use crate::import::map::{Map, SignalMap, SignalPlace};
use crate::import::row::Target;
use crate::qualification::unit_of_pressure;

/// A column with less evidence is not proposed.
pub(super) const ENOUGH: f64 = 2.0;
/// Columns whose relations are looked at.
const MOST_RELATED: usize = 40;
/// A correlation that is weaker by less than this is as good.
const RIVAL: f64 = 0.05;
/// A column of two states drives a position from this correlation on, and where it changes so often.
const TWO_STATES: (f64, u64) = (0.8, 4);
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
pub(super) type Choice = Option<(usize, f64, Vec<String>)>;

/// Proposes a map; `fields` says that columns are fields of messages.
pub(super) fn rank(mut map: Map, columns: Vec<SuggestedColumn>, fields: bool) -> Suggestion {
    let own: Evidence = columns.iter().map(|column| Target::ALL.map(|target| evidence(column, target))).collect();
    let machines = machines(columns.iter().map(|column| column.name.as_str()));
    let lesser = lesser_figures(&columns);
    // Signals of one proposal are of one machine: of several, the one with most evidence.
    let choices = (0..machines.words.len().max(1)).map(|machine| {
        let choice = choose(&columns, &own, &|column| !lesser[column] && machines.may_be_of(column, machine));
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
                    .and_then(|servomotor| Some(relations[at(servomotor)?][at(*column)?].drives))
                    .unwrap_or(0.0);
                let turned = target == Target::SpoolPosition && drives < -WEAKEST;
                let asked = open.len();
                let signal = signal(target, &columns[*column], fields, turned, servomotor, &mut open);
                if open.len() == asked {
                    open.extend(of_several_units(&signal, &columns[*column]));
                }
                open.extend(may_count_closing(&signal, &columns[*column]));
                map.signals.push(signal);
                reasons.push(Proposed { target, column: Some(*column), score: *sum, why: why.join(", ") });
            }
            None => absent(target, &chosen, &mut map, &mut reasons, &mut open),
        }
    }
    open.extend(statistics(&columns, &chosen));
    open.extend(may_be_trip(&columns, &chosen));
    open.extend(several_machines(&columns, &chosen));
    open.extend(competing(&columns, &related, &relations, &chosen));
    open.extend(by_course_alone(&columns, &chosen));
    let (pairs, speed) =
        pairs(&columns, &related, &relations, [of(Target::ServomotorPosition), of(Target::SpoolPosition)]);
    open.extend(speed);
    Suggestion { map, columns, reasons, pairs, notes: vec![], open, rows: 0 }
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
    relations: Vec<Vec<Relation>>,
}

/// Chooses columns for the signals among those that are allowed.
fn choose(columns: &[SuggestedColumn], own: &Evidence, allowed: &dyn Fn(usize) -> bool) -> Chosen {
    let score = |column: usize, target: Target| own[column][target.place()].0;
    let mut chosen: Vec<Choice> = vec![None; Target::ALL.len()];
    let trio = [Target::ServomotorPosition, Target::SpoolPosition, Target::OpeningCommand];
    let most = |column: &usize| trio.iter().map(|target| score(*column, *target)).fold(f64::NEG_INFINITY, f64::max);
    // A command may be one step.
    let steps = |column: usize| {
        let one = &columns[column];
        one.changes >= TWO_STATES.1 || (!one.is_switch() && score(column, Target::OpeningCommand) >= ENOUGH)
    };
    let mut related: Vec<usize> = (0..columns.len())
        .filter(|&column| allowed(column) && columns[column].moves() && (!columns[column].is_binary() || steps(column)))
        .collect();
    related.sort_by(|a, b| most(b).total_cmp(&most(a)));
    related.truncate(MOST_RELATED);
    let relations = relations(columns, &related);
    // What a column of two states is called says nothing for a spool, and nothing against one.
    let of_trio = |column: usize, target: Target| match target {
        Target::SpoolPosition if columns[column].is_binary() => 0.0,
        _ => score(column, target),
    };
    let may_drive = |column: usize, by: f64| !columns[column].is_binary() || by.abs() >= TWO_STATES.0;
    let best = best_trio(&related, &relations, &of_trio, &may_drive);
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
        // Of several columns of trips the one that shows trips counts before the one with the better name.
        let servomotor = chosen[Target::ServomotorPosition.place()].as_ref().map(|(column, ..)| *column);
        let shown = |column: usize| match servomotor.filter(|_| target == Target::Esv) {
            Some(servomotor) => match sign_of_trip(&columns[column], &columns[servomotor]) {
                TripSign::Trips | TripSign::Pulses => 2,
                TripSign::Nothing => 1,
                TripSign::Runs => 0,
            },
            None => 0,
        };
        let found = free.max_by(|a, b| {
            (shown(*a).cmp(&shown(*b))).then(score(*a, target).total_cmp(&score(*b, target))).then(b.cmp(a))
        });
        chosen[target.place()] = found.map(|column| {
            let (sum, why) = own[column][target.place()].clone();
            (column, sum, why)
        });
    }
    Chosen { chosen, related, relations }
}

/// Which columns are no signals because they hold a lesser figure of a tag than another does, or how it scatters.
fn lesser_figures(columns: &[SuggestedColumn]) -> Vec<bool> {
    let tags: Vec<Vec<String>> = columns.iter().map(|column| tag(&column.name)).collect();
    let rank = |at: usize| {
        let column = &columns[at];
        // A mean of states is no state.
        let of_states = column.figure == Figure::Extreme && column.is_switch() && column.distinct.len() > 1;
        (if of_states { Figure::Value } else { column.figure }, at)
    };
    let holds = |at: usize| columns[at].range.count > 0 || columns[at].texts > 0;
    let better = |at: usize, other: usize| tags[other] == tags[at] && holds(other) && rank(other) < rank(at);
    let is_lesser = |at: usize| match columns[at].figure {
        Figure::Value => false,
        Figure::Spread => true,
        Figure::Mean | Figure::Extreme => (0..columns.len()).any(|other| better(at, other)),
    };
    (0..columns.len()).map(is_lesser).collect()
}

/// Signals that by their names are figures of a historian's intervals.
fn statistics(columns: &[SuggestedColumn], chosen: &[Choice]) -> Option<String> {
    let taken: Vec<&SuggestedColumn> = chosen.iter().flatten().map(|(column, ..)| &columns[*column]).collect();
    let of: Vec<&&SuggestedColumn> = taken.iter().filter(|column| column.figure != Figure::Value).collect();
    let has = |figure: Figure| of.iter().any(|column| column.figure == figure);
    let what = match [Figure::Mean, Figure::Extreme].map(has) {
        [false, false] => return None,
        [true, false] => "means",
        [false, true] => "minima or maxima",
        [true, true] => "means, minima or maxima",
    };
    let names: Vec<String> = of.iter().map(|column| format!("`{}`", column.name)).collect();
    Some(format!(
        "statistics: by their names {} are {what} over an interval, of which fast faults cannot be judged; export raw values",
        names.join(", ")
    ))
}

/// Columns that move with the spool as the chosen servomotor does: which of them is the piston only its reader knows.
fn competing(
    columns: &[SuggestedColumn],
    related: &[usize],
    relations: &[Vec<Relation>],
    chosen: &[Choice],
) -> Option<String> {
    let of = |target: Target| chosen[target.place()].as_ref().map(|(column, ..)| *column);
    let (servomotor, spool) = (of(Target::ServomotorPosition)?, of(Target::SpoolPosition)?);
    let at = |wanted: usize| related.iter().position(|column| *column == wanted);
    let spool_at = at(spool)?;
    let best = relations[at(servomotor)?][spool_at].drives.abs();
    let taken = |column: usize| chosen.iter().flatten().any(|(known, ..)| *known == column);
    let alike = |&&column: &&usize| {
        !taken(column) && at(column).is_some_and(|at| relations[at][spool_at].drives.abs() > best - RIVAL)
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

/// Columns of two states that by what the servomotor does in them may be that of trips, where none is called so.
fn may_be_trip(columns: &[SuggestedColumn], chosen: &[Choice]) -> Option<String> {
    let of = |target: Target| chosen[target.place()].as_ref().map(|(column, ..)| *column);
    let servomotor = &columns[of(Target::ServomotorPosition)?];
    of(Target::OpeningCommand)?;
    let taken = |column: usize| chosen.iter().flatten().any(|(known, ..)| *known == column);
    let shows = |column: &usize| {
        let sign = sign_of_trip(&columns[*column], servomotor);
        !taken(*column) && matches!(sign, TripSign::Trips | TripSign::Pulses)
    };
    let names: Vec<String> =
        (0..columns.len()).filter(shows).map(|column| format!("`{}`", columns[column].name)).collect();
    (of(Target::Esv).is_none() && !names.is_empty()).then(|| {
        format!(
            "esv: no column is called so, and the map says that it never tripped; {} changes its state, in one of which the servomotor does not \
             open; if that is the trip, give `esv: {{column: …, shutdown: …}}`",
            names.join(", ")
        )
    })
}

/// Signals whose names say that they are of two machines, as `U3_Y` and `U5_Y_CMD` do, where no machine has all of them.
fn several_machines(columns: &[SuggestedColumn], chosen: &[Choice]) -> Option<String> {
    let names: Vec<&str> = chosen.iter().flatten().map(|(column, ..)| columns[*column].name.as_str()).collect();
    let (one, other) = two_machines(&names)?;
    Some(format!(
        "machines: by their names the signals of the map are of two machines, {one} and {other}; take those of one, or make sure that they are"
    ))
}

/// A command and its servomotor that no name and no unit speak for.
fn by_course_alone(columns: &[SuggestedColumn], chosen: &[Choice]) -> Option<String> {
    let of = |target: Target| chosen[target.place()].as_ref().map(|(column, ..)| *column);
    let command =
        of(Target::OpeningCommand).filter(|column| evidence(&columns[*column], Target::OpeningCommand).0 < ENOUGH)?;
    Some(format!(
        "opening_command: `{}` was chosen by its course alone, as `{}` comes after it; make sure that it is a command",
        columns[command].name,
        columns[of(Target::ServomotorPosition)?].name
    ))
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
    let is_pressure = is_pressure(&column.unit);
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
        if least > 0.0 && most < 2.0 * least && unit_of_pressure(most).is_some() {
            sum += 1.0;
            why.push(format!("it stays between {} and {}", rounded(least), rounded(most)));
        }
    }
    (sum, why)
}
