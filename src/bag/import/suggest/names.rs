//! What the names of columns say of the signals behind them, in the languages of plants and manufacturers.

use crate::import::convert::{at_end_of_name, with_capital_at_end_of};
use crate::import::dialect::bracketed;
use crate::import::row::Target;
use crate::import::words::Words;

use super::signal_words::WORDS;

/// Words of quantities that are none of the signals.
const OTHERS: Words = Words(
    "id|numericid|speed|drehzahl|vitesse|frequency|frequenz|power|leistung|puissance|temp|temperature|temperatur|level|niveau|stand|head|flow|\
     durchfluss|force|kraft|voltage|spannung|rpm|hz|mw|velocity|effort|runner|laufrad|laufschaufel|limit|deviation|abweichung|regelabweichung|ecart|error|转速|频率|转轮|桨叶",
);

/// Words of a quantity that has another source than the one that a position has: they speak against all positions.
const PRESSURES: Words = Words("pres|pressure|druck|pression|presion|press|trykk|tryck|давлен|压力|油压");

/// Words of pressures that are not the tank's, where nothing else says that they are.
const NOT_OF_TANK: Words = Words("load|differential|difference|diff|delta|dp|rod|return|cylinder");

/// Words of other places that have a pressure, in any part of a name where they are long; they speak against both pressures.
const ELSEWHERE: Words = Words(
    "penstock|spiral|draft|sump|bearing|cooler|druckrohr|saugrohr|conduite|head|headrace|headwater|tail|tailrace|tailwater|water|wasser|lager",
);

/// Words that say that a column is what is asked for, whatever else it says.
const ASKED_FOR: Words = Words(
    "setpoint|sp|set_point|command|cmd|demand|dmd|soll|sollwert|consigne|consigna|referanse|riferimento|settpunkt|borvarde|给定|指令|设定|задан|уставк",
);
/// And that it was measured nevertheless.
const MEASURED: Words = Words("ist|istwert|feedback|actual|measured|mesure|反馈");

/// Words beside which `pv` is the process value, and no pilot valve.
const OF_VALUES: Words =
    Words("y|gate|gv|wicket|vane|servo|servomotor|opening|leitapparat|hsv|mdv|spool|oil|tank|p|pressure");

/// How much a name speaks for each signal, and the words by which it does.
pub(super) fn score(name: &str, target: Target) -> (f64, Vec<&'static str>) {
    let words = words(name);
    let text = words.join("_");
    let has = |word: &str| {
        if word.len() > 3 { text.contains(word) } else { words.iter().any(|known| known == word) }
    };
    let mut found: Vec<(&'static str, f64)> = vec![];
    // At the end of a tag it says that this is the process value.
    let attribute = name.rsplit(['.', ':', '/']).next().unwrap_or_default();
    let is_attribute = attribute.len() < name.len() && attribute.trim().eq_ignore_ascii_case("pv");
    let is_value = |word: &str| {
        word == "pv"
            && (is_attribute
                || words.len() > 2 && words.last().is_some_and(|last| last == "pv")
                || words.iter().any(|word| OF_VALUES.has(word)))
    };
    for (word, weight) in words_of(target) {
        if has(word) && !is_value(word) {
            found.push((word, weight));
        }
    }
    // `control_pressure` says what `pressure` says, and more.
    let of_words = |word: &str| found.iter().any(|(other, _)| *other != word && other.contains(word));
    let mut sum: f64 = found.iter().filter(|(word, _)| !of_words(word)).map(|(_, weight)| weight).sum();
    let elsewhere = |one: &str| if one.len() > 4 { text.contains(one) } else { words.iter().any(|word| word == one) };
    let asked_for = ASKED_FOR.all().any(has) && !MEASURED.all().any(has);
    if target.is_pressure() && ELSEWHERE.all().any(elsewhere)
        || target == Target::ServomotorPosition && asked_for
        || matches!(target, Target::PilotValvePosition | Target::ControlPressure) && found.is_empty()
    {
        return (f64::NEG_INFINITY, vec![]);
    }
    if words.iter().any(|word| OTHERS.has(word)) {
        sum -= 4.0;
    }
    let pressure = PRESSURES.all().any(has);
    if pressure != target.is_pressure() && (pressure || sum > 0.0 && target == Target::ControlPressure) {
        sum -= 4.0;
    }
    let elsewhere = sum < 4.0 && words.iter().any(|word| NOT_OF_TANK.has(word));
    if target == Target::TankPressure && (elsewhere || score_of(Target::ControlPressure, &has) >= 5.0) {
        sum -= 4.0;
    }
    (sum, found.into_iter().map(|(word, _)| word).collect())
}

fn score_of(target: Target, has: &dyn Fn(&str) -> bool) -> f64 {
    words_of(target).filter(|(word, _)| has(word)).map(|(_, weight)| weight).fold(0.0, f64::max)
}

/// The words that speak for a signal, and how much.
fn words_of(target: Target) -> impl Iterator<Item = (&'static str, f64)> {
    WORDS.iter().filter(move |(of, _)| *of == target).flat_map(|(_, words)| words.weighed())
}

/// Words of the figures that historians make of an interval, by what they are.
const STATISTICS: [(Figure, Words); 3] = [
    (Figure::Mean, Words("avg|average|mean|mittel|mittelwert|moyenne|promedio|media")),
    (Figure::Extreme, Words("min|max|minimum|maximum")),
    (Figure::Spread, Words("std|stddev|stdev|count")),
];
/// Rates, whose `min` is a minute.
const PER_MINUTE: Words = Words("l/min|u/min|m/min|mm/min|m3/min|m³/min|rev/min|r/min|1/min|%/min");
/// Words that say no more than that a column is its tag's value.
const VALUES: Words = Words("value|val|wert|raw|last|snapshot");

/// Which figure of a signal a column holds by its name, the better first.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Figure {
    /// The value.
    #[default]
    Value,
    /// Its mean over an interval.
    Mean,
    /// Its minimum or maximum over an interval.
    Extreme,
    /// How far it scatters, or how many values there were.
    Spread,
}

fn statistic(word: &str) -> Option<Figure> {
    STATISTICS.iter().find(|(_, words)| words.has(word)).map(|(figure, _)| *figure)
}

/// Which figure of a signal a name or a unit says.
pub(super) fn figure(name: &str) -> Figure {
    let mut text = name.to_owned();
    for rate in PER_MINUTE.all() {
        // Not behind more letters: `ctrl/min` is a path.
        if let Some(at) = text.to_ascii_lowercase().find(rate)
            && (at == 0 || rate.starts_with('%') || text[..at].ends_with([' ', '[', '(', ',']))
        {
            text.replace_range(at..at + rate.len(), "");
        }
    }
    words(&text).iter().filter_map(|word| statistic(word)).max().unwrap_or_default()
}

/// The words of a name that say of what its column is a figure.
pub(super) fn tag(name: &str) -> Vec<String> {
    let mut tag = words(bracketed(name).map_or(name, |(bare, _)| bare));
    if tag.len() > 1 && tag.last().is_some_and(|last| !at_end_of_name(last).is_empty()) {
        tag.pop();
    }
    tag.retain(|word| statistic(word).is_none() && !VALUES.has(word));
    tag
}

/// Words of names that say which figure of a signal a column holds, or how it was taken.
const FIGURES: Words = Words("raw|filt|filtered|value|val|pv|quality|status|valid|time|date|x|y|z|t|u|p|timestamp");

/// Whether a word says something of a signal, so that it tells no machine from another.
pub(super) fn is_known(word: &str) -> bool {
    let of_signal = WORDS.iter().flat_map(|(_, words)| words.weighed()).any(|(known, _)| {
        // `86` is a relay, and a number all the same.
        !known.starts_with(|letter: char| letter.is_ascii_digit()) && (known.split('_').any(|part| part == word))
    });
    of_signal
        || OTHERS.has(word)
        || PRESSURES.has(word)
        || FIGURES.has(word)
        || statistic(word).is_some()
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
    for letter in name.replace('ß', "ss").chars().map(without_accent) {
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

/// A Latin letter without its accent, as other spellings of a word have it.
fn without_accent(letter: char) -> char {
    match letter {
        'à'..='å' | 'À'..='Å' => 'a',
        'ç' | 'Ç' => 'c',
        'è'..='ë' | 'È'..='Ë' => 'e',
        'ì'..='ï' | 'Ì'..='Ï' => 'i',
        'ñ' | 'Ñ' => 'n',
        'ò'..='ö' | 'ø' | 'Ò'..='Ö' | 'Ø' => 'o',
        'ù'..='ü' | 'Ù'..='Ü' => 'u',
        other => other,
    }
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
    fn what_is_left_over_is_no_other_signal() {
        let never =
            |name: &str, target: Target| assert!(score(name, target).0 <= 0.0, "{name}: {:?}", score(name, target));
        for name in ["Y_PV2", "Y_PV A", "Y_PV B", "Opening", "Power"] {
            never(name, Target::PilotValvePosition);
        }
        for name in ["Penstock pressure", "Sump pressure", "Oil pressure", "P2"] {
            never(name, Target::ControlPressure);
        }
        for name in ["Y setpoint", "Gate position command", "Y Sollwert", "servo cmd"] {
            never(name, Target::ServomotorPosition);
        }
        for (name, target) in [
            ("u_pv", Target::PilotValvePosition),
            ("PV position", Target::PilotValvePosition),
            ("Steuerdruck", Target::ControlPressure),
            ("Y feedback of command", Target::ServomotorPosition),
        ] {
            assert!(score(name, target).0 >= 2.0, "{name}");
        }
    }

    #[test]
    fn figures_of_historians_are_told_from_values() {
        for (name, expected) in [
            ("GV_CMD.Min", Figure::Extreme),
            ("Y_SP max [%]", Figure::Extreme),
            ("U3/Y/Min", Figure::Extreme),
            ("HSV (min)", Figure::Extreme),
            ("Y_PV (Average)", Figure::Mean),
            ("Wert_MITTEL", Figure::Mean),
            ("MEAN(P_OIL)", Figure::Mean),
            ("STDDEV(Y_SP)", Figure::Spread),
            ("Y_SP [%]", Figure::Value),
            ("Speed [1/min]", Figure::Value),
            ("flow l/min", Figure::Value),
            ("Y [mm/min]", Figure::Value),
            ("Kolben [mm]", Figure::Value),
            ("minor loop", Figure::Value),
            ("PT1/Min", Figure::Extreme),
            ("ctrl/min", Figure::Extreme),
        ] {
            assert_eq!(figure(name), expected, "{name}");
        }
        for name in ["Y_SP (Average) %", "Y_SP.Value", "MEAN(Y_SP)", "y_sp_max_pct", "Y_SP [%]", "Y_SP (min)"] {
            assert_eq!(tag(name), ["y", "sp"], "{name}");
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
            ("Consigne ouverture", Target::OpeningCommand),
            ("Ledeapparat referanse", Target::OpeningCommand),
            ("Riferimento apertura", Target::OpeningCommand),
            ("导叶开度给定", Target::OpeningCommand),
            ("导叶开度反馈", Target::ServomotorPosition),
            ("接力器行程", Target::ServomotorPosition),
            ("Ledeapparat posisjon", Target::ServomotorPosition),
            ("Abertura distribuidor", Target::ServomotorPosition),
            ("Válvula distribuidora", Target::SpoolPosition),
            ("主配压阀位移", Target::SpoolPosition),
            ("Hovedventil", Target::SpoolPosition),
            ("Oljetrykk", Target::TankPressure),
            ("压油罐油压", Target::TankPressure),
            ("Presión aceite", Target::TankPressure),
            ("Déclenchement", Target::Esv),
            ("Arrêt urgence", Target::Esv),
            ("紧急停机", Target::Esv),
            ("Parada de emergência", Target::Esv),
            ("SS ausgelöst", Target::Esv),
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
            "Runner blade",
            "转速",
            "Y deviation",
            "Penstock pressure",
            "Sump pressure",
            "Druck Druckrohrleitung",
        ] {
            assert_eq!(best(name), None, "{name}: {:?}", Target::ALL.map(|target| score(name, target)));
        }
    }
}
