//! From what a file holds to SI units: scale, offset, range, unit and sign, in this order.

use super::row::Target;
use super::words::Words;
use UnitOf::{Absolute, Gauge, Share, Travel};

/// Pressure of the standard atmosphere, Pa (ISO 2533), by which absolute pressures exceed gauge pressures.
pub const ATMOSPHERE_PA: f64 = 101_325.0;

/// A linear law with a stated order of steps, of which those that do nothing leave every bit as it was.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Conversion {
    /// Multiplies what the file holds.
    pub scale: f64,
    /// Is added then.
    pub offset: f64,
    /// What of it is [`Conversion::to`]'s first and second value.
    pub range: Option<[f64; 2]>,
    /// What the ends of the range mean, in the unit.
    pub to: [f64; 2],
    /// The unit.
    pub unit: UnitConversion,
    /// Turns the sign at the end.
    pub turned: bool,
}

impl Conversion {
    /// The law that changes nothing.
    pub const NONE: Self =
        Self { scale: 1.0, offset: 0.0, range: None, to: [0.0, 1.0], unit: UnitConversion::ONE, turned: false };

    /// The value after the import.
    pub fn apply(&self, raw: f64) -> f64 {
        let mut value = raw;
        if self.scale != 1.0 {
            value *= self.scale;
        }
        if self.offset != 0.0 {
            value += self.offset;
        }
        if let Some([low, high]) = self.range {
            value = (value - low) / (high - low);
            let [from, to] = self.to;
            if self.to != [0.0, 1.0] {
                value = from + value * (to - from);
            }
        }
        value = self.unit.apply(value);
        if self.turned { -value } else { value }
    }
}

/// A unit as multiplication, division and addition; a percentage is divided by 100, so that it reads as people write it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UnitConversion {
    times: f64,
    by: f64,
    plus: f64,
}

impl UnitConversion {
    /// The unit of the import itself.
    pub const ONE: Self = Self { times: 1.0, by: 1.0, plus: 0.0 };

    /// A value in SI units.
    pub fn apply(&self, value: f64) -> f64 {
        let mut value = value;
        if self.times != 1.0 {
            value *= self.times;
        }
        if self.by != 1.0 {
            value /= self.by;
        }
        if self.plus != 0.0 {
            value += self.plus;
        }
        value
    }

    /// Whether values of both are the same but for what is added.
    pub(super) fn is_multiple(self, other: Self) -> bool {
        Self { plus: 0.0, ..self } == Self { plus: 0.0, ..other }
    }

    fn times(times: f64) -> Self {
        Self { times, ..Self::ONE }
    }

    fn by(by: f64) -> Self {
        Self { by, ..Self::ONE }
    }
}

/// What a unit measures, with what its values are multiplied or divided by.
#[derive(Clone, Copy)]
enum UnitOf {
    Gauge(f64),
    Absolute(f64),
    Share(f64),
    /// What a position transducer gives, for which a range says what is closed and open.
    Travel,
}

/// Units in the plain form, and behind a blank as people write them where names of columns end with them.
const UNITS: [(UnitOf, Words); 17] = [
    (Gauge(1.0), Words("pa Pa")),
    (Gauge(1e2), Words("hpa|mbar")),
    (Gauge(1e3), Words("kpa kPa|kn/m2")),
    (Gauge(1e5), Words("bar bar|barg barg|bars")),
    (Gauge(1e6), Words("mpa MPa|n/mm2")),
    (Gauge(6_894.757_293_168), Words("psi psi|psig")),
    (Gauge(98_066.5), Words("kgf/cm2|kg/cm2|kp/cm2|ksc|at")),
    (Gauge(ATMOSPHERE_PA), Words("atm")),
    (Gauge(133.322_387_415), Words("mmhg|torr")),
    (Gauge(9_806.65), Words("mh2o|mws|mce")),
    (Absolute(98_066.5), Words("ata")),
    (Absolute(1e5), Words("bara bara")),
    (Absolute(6_894.757_293_168), Words("psia")),
    (Share(1.0), Words("pu pu|p.u.|1|-")),
    (Share(100.0), Words("%|percent %|pct %|prozent %")),
    (Share(1000.0), Words("‰|permille")),
    (Travel, Words("m|mm mm|cm cm|um|µm|in|inch|deg|grad|°|rad|v|mv|ma mA|a|counts|digits")),
];

/// Each unit in its plain form, with what it measures and as people write it.
fn units() -> impl Iterator<Item = (&'static str, UnitOf, &'static str)> {
    let each = |(of, words): &(UnitOf, Words)| {
        let of = *of;
        words.all().map(move |one| {
            let (plain, written) = one.split_once(' ').unwrap_or((one, ""));
            (plain, of, written)
        })
    };
    UNITS.iter().flat_map(each)
}

/// A unit of the table by its plain form.
fn known(name: &str) -> Option<UnitOf> {
    units().find(|(plain, ..)| *plain == name).map(|(_, measures, _)| measures)
}

/// The unit that a word at the end of a name states, as people write it; empty where it states none.
pub fn at_end_of_name(word: &str) -> &'static str {
    units().find(|(plain, ..)| *plain == word).map_or("", |(.., written)| written)
}

/// The unit with a capital inside, as `kPa` and `mA` have one, that stands behind everything else of a name; empty where none does.
pub fn with_capital_at_end_of(name: &str) -> &'static str {
    let inside = |written: &&str| written.starts_with(char::is_lowercase) && written.contains(char::is_uppercase);
    let mut all = units().map(|(.., written)| written).filter(inside);
    all.find(|written| name.len() > written.len() && name.ends_with(written)).unwrap_or_default()
}

/// A unit in a plain form: lower case, brackets and blanks off, `(a)` and `abs` as `a`, `(g)`, `(ü)` and `gauge` as `g`.
pub fn plain(text: &str) -> String {
    let lower = text.to_lowercase().replace([' ', '_'], "").replace("(a)", "a").replace(['²', '₂'], "2");
    let lower = ["(g)", "(ü)", "gauge"].iter().fold(lower, |text, gauge| text.replace(gauge, "g"));
    let lower = lower.trim_matches(['[', ']', '(', ')']).replace("^2", "2");
    let absolute = ["abs", "abs.", "(abs", "absolute"].iter().find_map(|end| lower.strip_suffix(end));
    match (absolute, lower.strip_suffix("barü")) {
        (Some(unit), _) if !unit.is_empty() => format!("{unit}a"),
        (_, Some("")) => "barg".to_owned(),
        _ => lower,
    }
}

/// Factors before units of pressure, of which values are so many.
const FACTORS: [f64; 6] = [1e-3, 1e-2, 0.1, 10.0, 100.0, 1e3];

/// Signs of multiplication in units.
fn is_times(letter: char) -> bool {
    "xX×*·".contains(letter)
}

/// The number at the beginning of a text, with either decimal sign, and the rest; none where a group of digits may be meant as well.
fn number_before(text: &str) -> Option<(f64, &str)> {
    let end = text.find(|letter: char| !letter.is_ascii_digit() && !".,".contains(letter)).unwrap_or(text.len());
    let digits = text[..end].replace(',', ".");
    let is_group =
        digits.split_once('.').is_some_and(|(whole, part)| part.len() == 3 && !whole.trim_matches('0').is_empty());
    let number = digits.parse::<f64>().ok().filter(|number| *number > 0.0 && number.is_finite() && !is_group)?;
    Some((number, &text[end..]))
}

/// A text without blanks and brackets round the whole of it.
fn within(text: &str) -> &str {
    let text = text.trim();
    let inside = |open: char, close: char| text.strip_prefix(open).and_then(|rest| rest.strip_suffix(close));
    inside('[', ']').or_else(|| inside('(', ')')).map_or(text, str::trim)
}

/// The factor before a unit, as in `0.1 bar` and `x10 ms`, and the unit; 1 where there is none.
pub fn with_factor(text: &str) -> (f64, &str) {
    let text = within(text);
    let Some((factor, unit)) = number_before(text.trim_start_matches(is_times).trim_start()) else {
        return (1.0, text);
    };
    let unit = unit.trim_start();
    // `10 x ms` as `10 ms`.
    let behind_sign = unit.strip_prefix(is_times).filter(|rest| rest.starts_with(' ') || !unit.starts_with('x'));
    let unit = behind_sign.map_or(unit, str::trim_start);
    if unit.starts_with(|letter: char| letter.is_alphabetic() || "%‰".contains(letter)) {
        (factor, unit)
    } else {
        (1.0, text)
    }
}

/// The unit before a factor, as in `bar x 10`, and the factor.
fn factor_behind(text: &str) -> Option<(&str, f64)> {
    let text = within(text);
    let (unit, number) = text.rsplit_once(is_times)?;
    let (factor, rest) = number_before(number.trim_start())?;
    rest.is_empty().then_some((unit.trim_end(), factor))
}

/// The two units that a unit with a factor behind it may mean: values that are multiplied by it, or that are to be.
pub fn either_factor(text: &str) -> Option<[String; 2]> {
    let (unit, factor) = factor_behind(text)?;
    let is_known = pressure(unit).is_some() || share(unit).is_some() || TIMES.has(&plain(unit));
    is_known.then(|| [format!("{} {unit}", 1.0 / factor), format!("{factor} {unit}")])
}

/// A unit of pressure, gauge or absolute, with a power of ten before it or without.
pub fn pressure(text: &str) -> Option<UnitConversion> {
    let (factor, unit) = with_factor(text);
    let found = plain_pressure(unit).filter(|_| factor == 1.0 || FACTORS.contains(&factor))?;
    Some(UnitConversion { times: found.times * factor, ..found })
}

/// Whether a text is a unit of pressure, with a factor on either side or without.
pub fn is_pressure(text: &str) -> bool {
    pressure(text).is_some() || either_factor(text).is_some_and(|[first, _]| pressure(&first).is_some())
}

fn plain_pressure(text: &str) -> Option<UnitConversion> {
    let name = plain(text);
    // `MPa` and `mPa` differ only in case, and nobody measures oil in the latter.
    let find = |name: &str| match known(name) {
        Some(Gauge(in_pa) | Absolute(in_pa)) => Some(in_pa),
        _ => None,
    };
    if let Some(in_pa) = find(&name) {
        let plus = if matches!(known(&name), Some(Absolute(_))) { -ATMOSPHERE_PA } else { 0.0 };
        return Some(UnitConversion { plus, ..UnitConversion::times(in_pa) });
    }
    if let Some(in_pa) = name.strip_suffix('a').and_then(find) {
        return Some(UnitConversion { plus: -ATMOSPHERE_PA, ..UnitConversion::times(in_pa) });
    }
    name.strip_suffix('g').and_then(find).map(UnitConversion::times)
}

/// Words of names for absolute pressures; longer ones begin with them.
const ABSOLUTE: (Words, Words) = (Words("abs|pabs|абс"), Words("absolut|absolu|assolut|абсолют"));

/// Whether the name of a pressure says that it is absolute, in a word of its own.
pub fn says_absolute(name: &str) -> bool {
    let mut parted = String::with_capacity(name.len());
    let mut before = ' ';
    for letter in name.chars() {
        // A capital behind a small letter begins a word.
        if before.is_lowercase() && letter.is_uppercase() {
            parted.push(' ');
        }
        parted.extend(letter.to_lowercase());
        before = letter;
    }
    let mut words = parted.split(|letter: char| !letter.is_alphabetic());
    name.contains("绝对")
        || name.contains("絶対")
        || words.any(|word| ABSOLUTE.0.has(word) || ABSOLUTE.1.all().any(|begin| word.starts_with(begin)))
}

/// The unit of a column with what its name says of it: a unit of pressure that says neither gauge nor absolute is absolute if the name says so.
pub fn unit_by_name(name: &str, unit: &str) -> String {
    let bare = plain(unit);
    let is_gauge = bare.ends_with('g') && bare != "mmhg";
    let says_neither = pressure(unit).is_some_and(|found| found.plus == 0.0) && !is_gauge;
    let absolute = format!("{unit} abs");
    if says_neither && says_absolute(name) && pressure(&absolute).is_some() { absolute } else { unit.to_owned() }
}

/// A unit of a share of a stroke, with a negative power of ten before it or without: `100 %` is a range.
pub fn share(text: &str) -> Option<UnitConversion> {
    let (factor, unit) = with_factor(text);
    match known(&plain(unit)) {
        Some(Share(by)) if factor == 1.0 || FACTORS[..3].contains(&factor) => {
            Some(UnitConversion { times: factor, ..UnitConversion::by(by) })
        }
        _ => None,
    }
}

/// Whether a text is a unit of what a position transducer gives.
pub fn is_travel(text: &str) -> bool {
    matches!(known(&plain(text)), Some(Travel))
}

/// Units of time, which factors may have.
const TIMES: Words = Words(
    "s|sec|secs|second|seconds|sekunden|sek|ms|msec|millis|millisecond|milliseconds|millisekunden|us|µs|\u{3bc}s|usec|micros|microsecond|\
     microseconds|ns|nsec|nanos|nanosecond|nanoseconds|min|minutes|h|hours",
);

/// Whether a text is a unit that a header may state for any signal, with a factor or without.
pub fn is_any_unit(text: &str) -> bool {
    let (factor, unit) = with_factor(text);
    let of_time = || factor != 1.0 && TIMES.has(&plain(unit));
    is_unit(text)
        || pressure(text).is_some()
        || share(text).is_some_and(|_| factor != 1.0)
        || of_time()
        || either_factor(text).is_some()
}

/// Whether a text is a unit that a header may state for any signal, without a factor.
pub fn is_unit(text: &str) -> bool {
    let name = plain(text);
    plain_pressure(text).is_some()
        || matches!(known(&name), Some(Share(_))) && name != "1"
        || is_travel(text)
        || Words("s|ms|us|µs|ns|min|h|hz|rpm|kw|mw|bool|m3/s|°c|l/min").has(&name)
}

/// The units of a signal, for messages.
pub fn units_of(target: Target) -> &'static str {
    if target.is_pressure() {
        "Pa, kPa, MPa, bar, psi, kgf/cm2, each gauge, or absolute as `bara`, `MPa(a)`, or a power of ten of one, as `0.1 bar`"
    } else {
        "pu, %, permille, or any other together with `range: [value when closed, value when open]`"
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_are_known_as_people_write_them() {
        for (text, value, pa) in [
            ("bar", 63.0, 6.3e6),
            ("[Bar]", 63.0, 6.3e6),
            ("MPa", 6.3, 6.3e6),
            ("kPa", 6300.0, 6.3e6),
            ("bar(a)", 64.013_25, 6.3e6),
            ("bar abs", 64.013_25, 6.3e6),
            ("MPa(a)", 6.401_325, 6.3e6),
            ("kgf/cm²", 10.0, 980_665.0),
            ("kp/cm2", 10.0, 980_665.0),
            ("N/mm²", 6.3, 6.3e6),
            ("bar(ü)", 63.0, 6.3e6),
            ("PSI(G)", 1000.0, 6_894_757.293_168),
            ("bar abs.", 64.013_25, 6.3e6),
            ("mH₂O", 100.0, 980_665.0),
            ("psi", 1000.0, 6_894_757.293_168),
        ] {
            let found = pressure(text).unwrap().apply(value);
            assert!((found - pa).abs() < 1e-6 * pa, "{text}: {found}");
        }
        assert!(pressure("mm").is_none() && share("bar").is_none());
        // A percentage is the number that people write: 0.07 · 100 would be off in the last digit.
        assert_eq!(share("%").unwrap().apply(7.0), 0.07);
        assert_eq!(share("pu").unwrap().apply(0.1), 0.1);
        assert!(is_unit("[mm]") && is_unit("%") && !is_unit("1") && !is_unit("valve"));
    }

    #[test]
    fn factors_before_units_count_and_those_behind_are_asked() {
        for (text, value, pa) in [
            ("0.1 bar", 632.0, 6.32e6),
            ("[0,1 bar]", 632.0, 6.32e6),
            ("10 kPa", 632.0, 6.32e6),
            ("100kPa", 63.2, 6.32e6),
            ("x 10 kPa", 632.0, 6.32e6),
            ("×10 kPa", 632.0, 6.32e6),
            ("10 * kPa", 632.0, 6.32e6),
            ("0.1 bar abs", 642.132_5, 6.32e6),
        ] {
            assert!((pressure(text).unwrap().apply(value) - pa).abs() < 1.0, "{text}");
            assert!(is_any_unit(text) && !is_unit(text), "{text}");
        }
        assert_eq!(share("0.1 %").unwrap().apply(675.0), 0.675);
        for text in ["160 bar", "0 bar", "1.000 Pa", "1e5 Pa", "10^5 Pa", "bar x 10", "10", "-10 bar"] {
            assert!(pressure(text).is_none(), "{text}");
        }
        assert!(share("100 %").is_none() && share("1").is_some());
        assert_eq!(either_factor("[bar x 10]").unwrap(), ["0.1 bar", "10 bar"]);
        assert_eq!(either_factor("ms*10").unwrap(), ["0.1 ms", "10 ms"]);
        assert!(either_factor("max").is_none() && either_factor("valve x 2").is_none() && is_any_unit("0.1 ms"));
    }

    #[test]
    fn names_may_say_that_a_pressure_is_absolute() {
        for (name, unit, expected) in [
            ("P_OIL_ABS [bar]", "bar", "bar abs"),
            ("Öldruck absolut [bar]", "bar", "bar abs"),
            ("Absolutdruck", "MPa", "MPa abs"),
            ("OilPressureAbs", "kgf/cm2", "kgf/cm2 abs"),
            ("油罐绝对压力(MPa)", "MPa", "MPa abs"),
            ("P_OIL_ABS", "barg", "barg"),
            ("P_OIL_ABS", "bara", "bara"),
            ("P_OIL_ABS", "%", "%"),
            ("Absperrventil Druck", "bar", "bar"),
            ("p absperr", "bar", "bar"),
            ("labs", "bar", "bar"),
        ] {
            assert_eq!(unit_by_name(name, unit), expected, "{name}");
        }
        assert!((pressure("bar abs").unwrap().apply(1.01325)).abs() < 1e-9);
    }

    #[test]
    fn steps_come_in_their_order_and_the_neutral_ones_change_no_bit() {
        for value in [0.1, -0.0, 1e-300, f64::MAX] {
            assert_eq!(Conversion::NONE.apply(value).to_bits(), value.to_bits());
        }
        let current = Conversion {
            range: Some([4.0, 20.0]),
            to: [0.0, 100.0],
            unit: pressure("bar").unwrap(),
            ..Conversion::NONE
        };
        assert_eq!(current.apply(12.0), 5.0e6);
        let position = Conversion { range: Some([600.0, 0.0]), turned: true, ..Conversion::NONE };
        assert_eq!(position.apply(150.0), -0.75);
        let scaled = Conversion { scale: 2.0, offset: -1.0, ..Conversion::NONE };
        assert_eq!(scaled.apply(3.0), 5.0);
    }
}
