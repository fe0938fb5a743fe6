//! The line of a map for a column: unit, range, sign and states as the file shows them, with what its reader must settle.

use super::column::SuggestedColumn;
use super::names::{Figure, figure, tag, words};
use super::trip::{TripSign, running_states, sign_of_trip};
use crate::import::convert::{either_factor, plain, pressure, share, unit_by_name};
use crate::import::map::{SignalMap, SignalPlace, TripRule};
use crate::import::row::Target;
use crate::import::stated::SeveralUnits;
use crate::import::words::Words;
use crate::qualification::unit_of_pressure;

/// The signal with unit, range and sign as the column shows them.
pub(super) fn signal(
    target: Target,
    column: &SuggestedColumn,
    fields: bool,
    turned: bool,
    servomotor: Option<&SuggestedColumn>,
    open: &mut Vec<String>,
) -> SignalMap {
    let mut signal = SignalMap::of_column(target, &column.name);
    if fields {
        signal.from = SignalPlace::Field(column.name.clone());
    }
    let [least, most] = column.range.ends();
    let id = target.id();
    match target {
        Target::Esv => {
            let by_data = servomotor.and_then(|servomotor| trip_by_data(column, servomotor));
            if servomotor.is_some_and(|servomotor| sign_of_trip(column, servomotor) == TripSign::Pulses) {
                signal.latch = true;
                open.push(
                    "esv: the trip is a pulse, after which the servomotor closes and stays closed: the map keeps it (`latch: true`)".to_owned(),
                );
            }
            signal.shutdown = vec![TripRule::Is(by_data.unwrap_or_else(|| {
                let (state, told) = trip_state(column);
                open.push(told);
                state
            }))];
        }
        Target::TankPressure | Target::ControlPressure => {
            if column.is_live_zero() {
                (signal.conversion.range, signal.conversion.to) = (Some(live_zero(column, 4.0)), [0.0, 100.0]);
                "bar".clone_into(&mut signal.unit);
                open.push(format!(
                    "{id}: the current of a transmitter; replace `to` and `unit` by what it shows at 4 and 20 mA, as its name plate says"
                ));
            } else if pressure(&column.unit).is_some() {
                signal.unit.clone_from(&column.unit);
            } else {
                let (unit, told) = guessed_pressure(column, most);
                signal.unit = unit;
                open.push(format!("{id}: {told}"));
            }
        }
        _ => {
            signal.conversion.turned = turned;
            if turned {
                open.push(turned_round(id, servomotor));
            }
            let one_sided = matches!(target, Target::OpeningCommand | Target::ServomotorPosition);
            let farthest = least.abs().max(most.abs());
            if let Some(share) = share(&column.unit) {
                signal.unit.clone_from(&column.unit);
                let full = 1.0 / share.apply(1.0);
                if target == Target::SpoolPosition && stands_half_way(column, full) {
                    signal.conversion.range = Some([full / 2.0, full]);
                    open.push(format!(
                        "{id}: it stands at {} most of the time, which is taken for neutral; replace `range` by the values at neutral and at full stroke",
                        rounded(full / 2.0)
                    ));
                }
            } else if column.unit.is_empty() && farthest <= 1.2 && (!one_sided || least > -0.1) && farthest > 0.05 {
                "pu".clone_into(&mut signal.unit);
                open.push(format!(
                    "{id}: the file states no unit; {} to {} looks like pu",
                    rounded(least),
                    rounded(most)
                ));
            } else if column.unit.is_empty() && (!one_sided || least >= -5.0) && (20.0..=110.0).contains(&farthest) {
                "%".clone_into(&mut signal.unit);
                open.push(format!(
                    "{id}: the file states no unit; {} to {} looks like %",
                    rounded(least),
                    rounded(most)
                ));
            } else if column.is_live_zero() {
                signal.unit.clone_from(&column.unit);
                signal.conversion.range = Some(live_zero(column, if one_sided { 4.0 } else { 12.0 }));
                let meant = if one_sided { "closed and open" } else { "at neutral and at full stroke" };
                open.push(format!(
                    "{id}: the current of a transmitter, with the usual ends of its range; replace them where it gives others {meant}"
                ));
            } else {
                signal.unit.clone_from(&column.unit);
                signal.conversion.range = Some(if one_sided { [least, most] } else { [0.0, farthest] });
                let meant = if one_sided { "closed and open" } else { "at neutral and at full stroke" };
                open.push(format!(
                    "{id}: `range` holds what the file shows; replace it by the values {meant}, in the file's own unit{}",
                    if column.unit.is_empty() { String::new() } else { format!(" ({})", column.unit) }
                ));
            }
        }
    }
    let unit = if target.is_pressure() { pressure(&signal.unit) } else { share(&signal.unit) };
    if let (true, Some(unit)) = (signal.conversion.range.is_none() || target.is_pressure(), unit) {
        signal.conversion.unit = unit;
    }
    signal
}

/// The question about a column whose header names several units, of which its values do not tell the one that they are in.
pub(super) fn of_several_units(signal: &SignalMap, column: &SuggestedColumn) -> Option<String> {
    if signal.target == Target::Esv {
        return None;
    }
    let mut units = SeveralUnits::of(&column.name, &signal.unit)?;
    column.envelope.points().for_each(|(_, bucket)| units.take(bucket.mean()));
    let id = signal.target.id();
    let way = if signal.target.is_pressure() { "`unit`, or `range`, `to` and `unit`," } else { "`unit` or `range`" };
    let taken = &signal.unit;
    units.doubt().map(|doubt| format!("{id}: {doubt}; taken as `{taken}`: replace it by {way} where it is another"))
}

/// That a spool is turned round; of a servomotor that may count closing, that the servomotor may be what is turned.
fn turned_round(id: &str, servomotor: Option<&SuggestedColumn>) -> String {
    let said = format!("{id}: the servomotor moves against it, so that it is turned round (`sign: -1`)");
    match servomotor.filter(|servomotor| counts_closing(servomotor)) {
        Some(servomotor) => format!(
            "{said}; but by its name it may be `{}` that is turned, as it counts closing: then swap the ends of its `range`, and drop this `sign`",
            servomotor.name
        ),
        None => said,
    }
}

/// Words of positions that count closing.
const CLOSING: Words = Words("closing|closed|closure|close|zu|fermeture|fermee|cierre|cerrado|chiusura|chiuso");

/// Whether a name says that a position counts closing.
fn counts_closing(column: &SuggestedColumn) -> bool {
    let words = words(&column.name);
    let of_loop = |at: usize| words[at] == "closed" && words.get(at + 1).is_some_and(|next| next == "loop");
    (0..words.len()).any(|at| (CLOSING.has(&words[at]) || words[at].starts_with("schliess")) && !of_loop(at))
}

/// The question about a position that by its name may count closing, with what would turn it.
pub(super) fn may_count_closing(signal: &SignalMap, column: &SuggestedColumn) -> Option<String> {
    if !counts_closing(column) || column.is_binary() {
        return None;
    }
    let way = match signal.target {
        Target::OpeningCommand | Target::ServomotorPosition => {
            let full = share(&signal.unit).map_or(1.0, |unit| 1.0 / unit.apply(1.0));
            let [closed, open] = signal.conversion.range.unwrap_or([0.0, full]);
            format!("range: [{}, {}]", rounded(open), rounded(closed))
        }
        Target::SpoolPosition | Target::PilotValvePosition if !signal.conversion.turned => "sign: -1".to_owned(),
        _ => return None,
    };
    Some(format!("{}: by its name `{}` may count closing; if so, give it `{way}`", signal.target.id(), column.name))
}

/// Whether a spool's values count from fully closed, so that neutral, where it is most of the time, is half of all.
fn stands_half_way(column: &SuggestedColumn, full: f64) -> bool {
    let mut means: Vec<f64> = column.envelope.points().map(|(_, bucket)| bucket.mean() / full).collect();
    let middle = means.len() / 2;
    column.range.ends()[0] > -0.05 * full
        && !means.is_empty()
        && (0.4..=0.6).contains(means.select_nth_unstable_by(middle, f64::total_cmp).1)
}

/// What stands in brackets behind a name, or behind its last stroke, and has a letter.
fn unknown_unit(name: &str) -> Option<&str> {
    let name = name.trim();
    let inside = name.strip_suffix([']', ')']).and_then(|rest| rest.split_once(['[', '(']));
    // `P (Max)` and `MEAN(P)` state none.
    let is_unit =
        |one: &(&str, &str)| [one.0, one.1].iter().all(|part| !tag(part).is_empty()) && figure(one.1) == Figure::Value;
    inside.filter(is_unit).map(|(_, unit)| unit.trim()).filter(|unit| unit.contains(char::is_alphabetic))
}

/// The unit of a pressure that its file does not state in a known way, by the greatest number, and what to say of it.
fn guessed_pressure(column: &SuggestedColumn, most: f64) -> (String, String) {
    let stated = unknown_unit(&column.name)
        .map_or("the file states no unit".to_owned(), |unit| format!("its unit `{unit}` is not known"));
    let likely = match either_factor(&column.unit) {
        Some(either) => usual_of(&either, most),
        None => unit_of_pressure(most).map(str::to_owned),
    };
    let likely = likely.map(|unit| unit_by_name(&column.name, &unit));
    let none = || "is none of a governor's oil in any; give it".to_owned();
    let looks = likely.as_ref().map_or_else(none, |unit| format!("looks like {unit}"));
    (likely.unwrap_or_else(|| "Pa".to_owned()), format!("{stated}; up to {} {looks}", rounded(most)))
}

/// The first of two units in which a number is a usual tank pressure.
fn usual_of(units: &[String; 2], number: f64) -> Option<String> {
    let is_usual = |unit: &&String| {
        let pa = pressure(unit).map(|unit| unit.apply(number));
        pa.is_some_and(|pa| unit_of_pressure(pa) == Some("Pa"))
    };
    units.iter().find(is_usual).cloned()
}

/// The range of a current up to 20 mA, in the unit of the column.
fn live_zero(column: &SuggestedColumn, from_ma: f64) -> [f64; 2] {
    let by = if plain(&column.unit) == "a" { 1e3 } else { 1.0 };
    [from_ma / by, 20.0 / by]
}

/// The state that means a trip, where the servomotor shows it: it runs in the other.
fn trip_by_data(column: &SuggestedColumn, servomotor: &SuggestedColumn) -> Option<String> {
    let running = running_states(column, servomotor);
    let [normal] = running[..] else { return None };
    if column.range.count == 0 {
        let words = &column.words;
        let other = (0..words.len()).find(|k| *k as f64 != normal);
        // A column of words that never trips does not say what a trip is called.
        return match words.len() {
            1 => Some("TRIP".to_owned()),
            2 => other.and_then(|other| words.get(other)).cloned(),
            _ => None,
        };
    }
    match column.distinct[..] {
        [one] if one == normal => Some(if normal == 0.0 { "1".to_owned() } else { "0".to_owned() }),
        [one, other] => Some(if one == normal { other } else { one }.to_string()),
        _ => None,
    }
}

/// Words of names by which the greater of two states is a trip.
const TRIPS: Words = Words(
    "trip|tripped|closed|shutdown|emergency|esd|alarm|active|notschluss|schnellschluss|notaus|aus|stop|urgence|disparo|86",
);
/// And by which it is none, whatever else a name says.
const RUNS: Words = Words("energised|energized|normal|healthy|ok|open|opened|reset|running");

/// The state that means a trip by names and words alone, and what to say of the choice.
fn trip_state(column: &SuggestedColumn) -> (String, String) {
    let bad = Words("trip|tripped|aus|shutdown|alarm|true|on|active|1");
    if let Some(word) = column.words.iter().find(|word| bad.has(&word.to_lowercase())) {
        return (word.clone(), format!("esv: `{word}` is taken as shutdown"));
    }
    let words = words(&column.name);
    let says = |known: Words| words.iter().any(|word| known.has(word));
    // This project's own message says 1 for normal; so does a valve that is held by its coil.
    let lowest = says(RUNS) || (!says(TRIPS) && says(Words("esv|valve|solenoid")));
    let [least, most] = column.range.ends();
    let state = if lowest { least.min(0.0) } else { most.max(1.0) };
    let other = if lowest { "0" } else { "the greater value" };
    (
        state.to_string(),
        format!(
            "esv: {other} ({state}) is taken as shutdown by the column's name; the servomotor does not show it; turn it round if the column says \
             the contrary"
        ),
    )
}

pub(super) fn rounded(value: f64) -> String {
    let text = format!("{value:.4}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::import::source::channel::ChannelValue;

    #[test]
    fn a_position_that_counts_closing_is_asked_about() {
        for (name, target, way) in [
            ("closing position [%]", Target::ServomotorPosition, Some("range: [100, 0]")),
            ("Sollwert Schliessung [%]", Target::OpeningCommand, Some("range: [100, 0]")),
            ("Schließgrad Ist", Target::ServomotorPosition, Some("range: [100, 0]")),
            ("Leitapparat zu [pu]", Target::ServomotorPosition, Some("range: [1, 0]")),
            ("spool closing [%]", Target::SpoolPosition, Some("sign: -1")),
            ("valve closed", Target::Esv, None),
            ("/closed_loop/servo", Target::ServomotorPosition, None),
            ("Gate position [%]", Target::ServomotorPosition, None),
        ] {
            let mut column = SuggestedColumn::new(name, "");
            for k in 0..=50_u8 {
                let value = f64::from(k) * if column.unit == "pu" { 0.02 } else { 2.0 };
                column.take(i64::from(k) * 1_000_000_000, ChannelValue::Number(value));
            }
            let signal = signal(target, &column, false, false, None, &mut vec![]);
            let asked = may_count_closing(&signal, &column);
            assert_eq!(asked.is_some(), way.is_some(), "{name}: {asked:?}");
            assert!(asked.unwrap_or_default().contains(way.unwrap_or_default()), "{name}");
        }
        let servomotor = SuggestedColumn::new("Y closing position [%]", "");
        assert!(
            turned_round("spool_position", Some(&servomotor))
                .contains("it may be `Y closing position [%]` that is turned")
        );
    }

    #[test]
    fn a_figure_is_no_unit() {
        for (name, unit) in [
            ("P_OIL (Max)", None),
            ("MEAN(P_OIL)", None),
            ("P [Torrs]", Some("Torrs")),
            ("P max [Torrs]", Some("Torrs")),
        ] {
            assert_eq!(unknown_unit(name), unit, "{name}");
        }
    }
}
