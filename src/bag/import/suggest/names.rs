//! What the names of columns say of the signals behind them, in the languages of plants and manufacturers.

use crate::import::convert::{at_end_of_name, with_capital_at_end_of};
use crate::import::row::Target;

/// Words of names with what they speak for, and how much. Those of up to three letters count only as whole words.
const WORDS: &[(Target, &[(&str, f64)])] = &[
    (
        Target::OpeningCommand,
        &[
            ("opening_command", 6.0),
            ("governorcommand", 4.0),
            ("command", 3.0),
            ("cmd", 3.0),
            ("setpoint", 3.0),
            ("set_point", 3.0),
            ("sp", 2.5),
            ("soll", 3.5),
            ("demand", 3.0),
            ("reference", 2.0),
            ("ref", 2.0),
            ("desired", 2.0),
            ("target", 2.0),
            ("consigne", 3.0),
            ("consigna", 3.0),
            ("ypid", 4.0),
            ("y_pid", 4.0),
            ("leitapparat", 1.0),
            ("gate", 1.0),
            ("opening", 1.0),
        ],
    ),
    (
        Target::Esv,
        &[
            ("esv", 5.0),
            ("esd", 5.0),
            ("trip", 4.0),
            ("emergency", 4.0),
            ("shutdown", 3.0),
            ("notschluss", 5.0),
            ("schnellschluss", 5.0),
            ("not_aus", 4.0),
            ("notaus", 4.0),
            ("estop", 4.0),
            ("e_stop", 4.0),
            ("86", 3.0),
            ("urgence", 4.0),
            ("arret", 3.0),
            ("disparo", 4.0),
            ("stop", 2.0),
        ],
    ),
    (
        Target::TankPressure,
        &[
            ("tank", 3.0),
            ("accumulator", 4.0),
            ("accu", 2.0),
            ("windkessel", 5.0),
            ("speicher", 3.0),
            ("supply", 2.0),
            ("pressure", 2.0),
            ("druck", 2.0),
            ("pression", 2.0),
            ("presion", 2.0),
            ("press", 2.0),
            ("oil", 1.0),
            ("oilp", 2.0),
            ("p", 1.0),
        ],
    ),
    (
        Target::SpoolPosition,
        &[
            ("spool", 5.0),
            ("distributing", 4.0),
            ("hauptsteuer", 5.0),
            ("steuerkolben", 5.0),
            ("steuerventil", 4.0),
            ("steuerschieber", 5.0),
            ("main_valve", 4.0),
            ("mainvalve", 4.0),
            ("relay_valve", 4.0),
            ("mdv", 4.0),
            ("hsv", 4.0),
            ("tiroir", 4.0),
            ("lvdt", 2.0),
            ("slide", 2.0),
            ("schieber", 3.0),
        ],
    ),
    (
        Target::ServomotorPosition,
        &[
            ("servomotor", 5.0),
            ("servo", 2.0),
            ("wicket", 3.0),
            ("guide_vane", 4.0),
            ("guidevane", 4.0),
            ("gate", 2.0),
            ("gv", 2.0),
            ("leitapparat", 4.0),
            ("leitrad", 4.0),
            ("vannage", 4.0),
            ("distributeur", 4.0),
            ("ist", 2.5),
            ("istwert", 2.5),
            ("feedback", 2.0),
            ("actual", 2.0),
            ("measured", 1.0),
            ("opening", 2.0),
            ("displacement", 2.0),
            ("piston", 3.0),
            ("cylinder", 3.0),
            ("stroke", 1.5),
            ("hub", 1.0),
            ("position", 1.0),
            ("pos", 1.0),
            ("y", 1.0),
        ],
    ),
    (
        Target::PilotValvePosition,
        &[
            ("pilot", 4.0),
            ("proportional", 4.0),
            ("prop", 2.0),
            ("servovalve", 3.0),
            ("servo_valve", 3.0),
            ("vorsteuer", 5.0),
            ("pv", 2.0),
            ("coil", 2.0),
            ("valve_current", 3.0),
        ],
    ),
    (
        Target::ControlPressure,
        &[
            ("control_pressure", 6.0),
            ("steuerdruck", 6.0),
            ("pilot_pressure", 5.0),
            ("chamber", 3.0),
            ("p_ctrl", 5.0),
            ("p_control", 5.0),
        ],
    ),
];

/// Words of quantities that are none of the signals.
const OTHERS: [&str; 26] = [
    "speed",
    "drehzahl",
    "vitesse",
    "frequency",
    "frequenz",
    "power",
    "leistung",
    "puissance",
    "temp",
    "temperature",
    "temperatur",
    "level",
    "niveau",
    "stand",
    "head",
    "flow",
    "durchfluss",
    "force",
    "kraft",
    "voltage",
    "spannung",
    "rpm",
    "hz",
    "mw",
    "velocity",
    "effort",
];

/// Words of a quantity that has another source than the one that a position has: they speak against all positions.
const PRESSURES: [&str; 5] = ["pressure", "druck", "pression", "presion", "press"];

/// Words of pressures that are not the tank's, where nothing else says that they are.
const NOT_OF_TANK: [&str; 9] =
    ["load", "differential", "difference", "diff", "delta", "dp", "rod", "return", "cylinder"];

/// How much a name speaks for each signal, and the words by which it does.
pub(super) fn score(name: &str, target: Target) -> (f64, Vec<&'static str>) {
    let words = words(name);
    let text = words.join("_");
    let has = |word: &str| {
        if word.len() > 3 { text.contains(word) } else { words.iter().any(|known| known == word) }
    };
    let mut found: Vec<(&'static str, f64)> = vec![];
    // At the end of a tag it says that this is the process value.
    let is_value = |word: &str| word == "pv" && words.len() > 2 && words.last().is_some_and(|last| last == "pv");
    for (word, weight) in WORDS.iter().filter(|(of, _)| *of == target).flat_map(|(_, words)| words.iter()) {
        if has(word) && !is_value(word) {
            found.push((word, *weight));
        }
    }
    // `control_pressure` says what `pressure` says, and more.
    let of_words = |word: &str| found.iter().any(|(other, _)| *other != word && other.contains(word));
    let mut sum: f64 = found.iter().filter(|(word, _)| !of_words(word)).map(|(_, weight)| weight).sum();
    if words.iter().any(|word| OTHERS.contains(&word.as_str())) {
        sum -= 4.0;
    }
    let pressure = PRESSURES.iter().any(|word| has(word));
    if pressure != target.is_pressure() && (pressure || sum > 0.0 && target == Target::ControlPressure) {
        sum -= 4.0;
    }
    let elsewhere = sum < 4.0 && words.iter().any(|word| NOT_OF_TANK.contains(&word.as_str()));
    if target == Target::TankPressure && (elsewhere || score_of(Target::ControlPressure, &has) >= 5.0) {
        sum -= 4.0;
    }
    (sum, found.into_iter().map(|(word, _)| word).collect())
}

fn score_of(target: Target, has: &dyn Fn(&str) -> bool) -> f64 {
    let words = WORDS.iter().filter(|(of, _)| *of == target).flat_map(|(_, words)| words.iter());
    words.filter(|(word, _)| has(word)).map(|(_, weight)| *weight).fold(0.0, f64::max)
}

/// Words of names that say which figure of a signal a column holds, or how it was taken.
const FIGURES: [&str; 22] = [
    "min", "max", "avg", "mean", "std", "raw", "filt", "filtered", "value", "val", "pv", "quality", "status", "valid",
    "time", "date", "x", "y", "z", "t", "u", "p",
];

/// Whether a word says something of a signal, so that it tells no machine from another.
pub(super) fn is_known(word: &str) -> bool {
    let of_signal = WORDS.iter().flat_map(|(_, words)| words.iter()).any(|(known, _)| {
        // `86` is a relay, and a number all the same.
        !known.starts_with(|letter: char| letter.is_ascii_digit()) && (known.split('_').any(|part| part == word))
    });
    of_signal
        || OTHERS.contains(&word)
        || PRESSURES.contains(&word)
        || FIGURES.contains(&word)
        || !at_end_of_name(word).is_empty()
}

/// The unit that a name ends with, as `spool_pct` does; empty where it does not.
pub(super) fn unit(name: &str) -> &'static str {
    // A capital inside a unit parts no words.
    let written = with_capital_at_end_of(name);
    let words = words(name);
    let last = || words.last().filter(|_| words.len() > 1).map_or("", |last| at_end_of_name(last));
    if written.is_empty() { last() } else { written }
}

/// The words of a name in lower case: parted at signs, at capitals after small letters, and digits from letters.
pub(super) fn words(name: &str) -> Vec<String> {
    let mut words = vec![String::new()];
    let mut before = ' ';
    for letter in name.replace('ß', "ss").chars() {
        let parts =
            (before.is_lowercase() && letter.is_uppercase()) || (before.is_ascii_digit() != letter.is_ascii_digit());
        if !letter.is_alphanumeric() || parts {
            words.push(String::new());
        }
        if letter.is_alphanumeric()
            && let Some(word) = words.last_mut()
        {
            word.extend(letter.to_lowercase());
        }
        before = letter;
    }
    words.retain(|word| !word.is_empty());
    words
}

#[cfg(test)]
mod tests {
    use super::*;

    fn best(name: &str) -> Option<Target> {
        let of = |target: &Target| score(name, *target).0;
        Target::ALL.into_iter().max_by(|a, b| of(a).total_cmp(&of(b))).filter(|target| of(target) >= 2.0)
    }

    #[test]
    fn a_name_may_end_with_its_unit() {
        for (name, expected) in [
            ("spool_pct", "%"),
            ("tankPressureMPa", "MPa"),
            ("tankPressurekPa", "kPa"),
            ("P_kPa", "kPa"),
            ("AI_CMD_mA", "mA"),
            ("stroke mm", "mm"),
            ("p tank bar", "bar"),
            ("pa", ""),
            ("servo", ""),
        ] {
            assert_eq!(unit(name), expected, "{name}");
        }
    }

    #[test]
    fn names_of_many_languages_are_understood() {
        for (name, target) in [
            ("Y_soll", Target::OpeningCommand),
            ("Leitapparat Sollwert", Target::OpeningCommand),
            ("Gate setpoint", Target::OpeningCommand),
            ("SP_pct", Target::OpeningCommand),
            ("/governor/command.opening", Target::OpeningCommand),
            ("Y_ist", Target::ServomotorPosition),
            ("Leitapparatstellung", Target::ServomotorPosition),
            ("WicketGatePos", Target::ServomotorPosition),
            ("/joint_states.position[servomotor]", Target::ServomotorPosition),
            ("vannage mesure", Target::ServomotorPosition),
            ("Hauptsteuerventil", Target::SpoolPosition),
            ("MDV_LVDT", Target::SpoolPosition),
            ("/plant/servo_state.spool_position", Target::SpoolPosition),
            ("p_tank", Target::TankPressure),
            ("Öldruck Windkessel", Target::TankPressure),
            ("U3.GOV.OILP.PV", Target::TankPressure),
            ("load_rejection/tank_pressure", Target::TankPressure),
            ("/governor/tank_pressure.fluid_pressure", Target::TankPressure),
            ("Steuerdruck", Target::ControlPressure),
            ("/plant/servo_state.control_pressure", Target::ControlPressure),
            ("86E Trip", Target::Esv),
            ("Notschluss", Target::Esv),
            ("/governor/esv.state", Target::Esv),
            ("Pilot valve position", Target::PilotValvePosition),
        ] {
            assert_eq!(best(name), Some(target), "{name}: {:?}", Target::ALL.map(|target| score(name, target)));
        }
        for name in [
            "Drehzahl",
            "Power_MW",
            "Frequency",
            "Oil temperature",
            "/plant/load_pressure.fluid_pressure",
            "u",
            "status word",
            "/joint_states.velocity[servomotor]",
        ] {
            assert_eq!(best(name), None, "{name}: {:?}", Target::ALL.map(|target| score(name, target)));
        }
    }
}
