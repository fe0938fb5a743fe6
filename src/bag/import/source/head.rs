//! What is known of a table before its records: names and units of its columns, and what they say.

use std::path::PathBuf;

use crate::import::clock::says_of_day;
use crate::import::convert::{UnitConversion, either_factor, plain, pressure, share};
use crate::import::dialect::bracketed;
use crate::import::map::{AS_RECORDED, SignalMap};
use crate::import::number::Numbers;
use crate::import::row::Target;
use crate::import::words::Words;
use govtwin_model::params::nearest;

/// Names that columns of time have, in lower case, without what stands in brackets; the surest first.
const TIMES: Words = Words(
    "timestamp|__time|_time|x_value|time|t|time stamp|datetime|date_time|date/time|date time|datum/zeit|zeitstempel|zeit|uhrzeit|horodatage|\
     heure|temps|fecha|tiempo|ora|time_s|t_s|time_ns|#time|timestring|data/hora|data e hora|fecha/hora|fecha y hora|tempo|hora|tid|tidspunkt|\
     tidpunkt|czas|aika|время|дата/время|дата и время|时间|日期时间|時刻|date|datum|tick|ticks|index",
);
/// Names of columns that hold a date beside a column of the time of day.
const DATES: Words = Words("date|datum|fecha|dato|дата|日期");
/// Names of the latter.
const TIMES_OF_DAY: Words = Words("time|zeit|uhrzeit|heure|ora|hora|tid|время|时间");
/// The date and the time of day where the first is a word for data as well.
const DATA: (&str, [&str; 3]) = ("data", ["hora", "ora", "czas"]);
/// Words by which a column may hold the times of another beside it: `t_servo`, `servo time`, `Time.1`.
const TIME_WORDS: Words =
    Words("time|t|timestamp|zeit|zeitstempel|horodatage|temps|fecha|tiempo|ora|hora|tempo|tid|时间|время|date");

/// Names of columns that say of which machine a row is, without a number, `name`, `id` and `no` behind them.
const MACHINES: Words = Words(
    "unit|machine|turbine|generator|aggregate|maschine|maschinensatz|aggregat|turbina|groupe|unidad|host|grupo|gruppo|gruppe|einheit|aggregaat|agregat|агрегат|\
     机组|station|plant|site|anlage|kraftwerk|centrale|usine|planta|device|name|source|src|quelle",
);

/// Names of columns that hold a number of whatever it is.
const NUMBERS: Words = Words("nr|no|num|number|nummer|numero|número|id|kanal|channel");

/// What is known of a table before its records.
#[derive(Clone, Debug)]
pub(in crate::import) struct TableHead {
    pub(in crate::import) path: PathBuf,
    pub(in crate::import) names: Vec<String>,
    /// Units that the table states, empty where it does not.
    pub(in crate::import) units: Vec<String>,
    pub(in crate::import) numbers: Numbers,
    /// How the file was understood.
    pub(in crate::import) notes: Vec<String>,
}

impl TableHead {
    /// The column of a name, `#3` being the third; none where there is none.
    ///
    /// # Errors
    /// In words, where two columns have the name.
    pub(in crate::import) fn find(&self, name: &str) -> Result<Option<usize>, String> {
        let name = name.trim();
        if let Some(number) = name.strip_prefix('#').and_then(|digits| digits.parse::<usize>().ok()) {
            return Ok(number.checked_sub(1).filter(|index| *index < self.names.len()));
        }
        let bare = |known: &String| bracketed(known).is_some_and(|(bare, _)| bare == name);
        for same in [&|known: &String| known == name, &bare as &dyn Fn(&String) -> bool] {
            let places: Vec<usize> =
                self.names.iter().enumerate().filter(|(_, known)| same(known)).map(|(index, _)| index).collect();
            match places[..] {
                [] => {}
                [index] => return Ok(Some(index)),
                [first, second, ..] => {
                    let (first, second) = (first + 1, second + 1);
                    return Err(format!(
                        "`{name}` is the name of columns {first} and {second}; name the one you mean by its number, \"#{first}\""
                    ));
                }
            }
        }
        Ok(None)
    }

    /// Columns that by their names may say of which machine a row is, unless they are among those that say something else, and whether the name is
    /// more than a number's.
    pub(in crate::import) fn machine_columns(&self, taken: &[usize]) -> Vec<(usize, bool)> {
        let is_one = |name: &String, first: Words| {
            let lower = name.trim().to_lowercase();
            let words = lower.split(|letter: char| !letter.is_alphanumeric()).filter(|word| !word.is_empty());
            let behind = ["name", "id", "no", "nr", "number", "nummer"];
            let mut rest =
                words.enumerate().filter(|(place, word)| *place == 0 || !behind.contains(word)).map(|(_, word)| word);
            rest.next().is_some_and(|word| first.has(word)) && rest.next().is_none()
        };
        let named = |first: Words| (0..self.names.len()).filter(move |column| is_one(&self.names[*column], first));
        let all = named(MACHINES).map(|column| (column, true)).chain(named(NUMBERS).map(|column| (column, false)));
        all.filter(|(column, _)| !taken.contains(column)).collect()
    }

    /// What to say of a column that is not there.
    pub(in crate::import) fn absent(&self, name: &str) -> String {
        const MOST: usize = 30;
        let hint = nearest(name, self.names.iter().map(String::as_str));
        let hint = hint.map_or(String::new(), |near| format!(" did you mean `{near}`?"));
        let mut names: Vec<String> = self.names.iter().take(MOST).map(|name| format!("`{name}`")).collect();
        if self.names.len() > MOST {
            names.push(format!("and {} more", self.names.len() - MOST));
        }
        format!("there is no column `{name}`;{hint} columns: {}", names.join(", "))
    }

    /// The columns that by their names hold the time: one, or date and time of day.
    pub(in crate::import) fn time_columns(&self) -> Vec<usize> {
        let bare = |name: &String| bracketed(name).map_or(name.as_str(), |(bare, _)| bare).trim().to_lowercase();
        let find = |wanted: &str| self.names.iter().position(|name| bare(name) == wanted);
        let first = |names: Words| names.all().find_map(find);
        // WinCC writes the time again beside its text, with the part of the second that the text has lost.
        match (first(DATES), first(TIMES_OF_DAY)) {
            _ if find("timestring").is_some() && find("time_ms").is_some() => find("time_ms").into_iter().collect(),
            (Some(date), Some(time)) => vec![date, time],
            (None, Some(time)) if DATA.1.contains(&bare(&self.names[time]).as_str()) && find(DATA.0).is_some() => {
                find(DATA.0).into_iter().chain([time]).collect()
            }
            _ => {
                let named = first(TIMES).filter(|place| bare(&self.names[*place]) != "index");
                let of_day = || self.names.iter().position(|name| says_of_day(name));
                let other = || self.seconds().or_else(|| Some(vec![of_day().or_else(|| first(TIMES))?]));
                named.map(|place| vec![place]).or_else(other).unwrap_or_default()
            }
        }
    }

    /// A column of seconds and the one of their nanoseconds, as messages have them: their names differ by the unit alone.
    fn seconds(&self) -> Option<Vec<usize>> {
        let nanoseconds =
            |of: &str| self.names.iter().position(|name| fraction_digits(name) == Some(9) && last_word(name).0 == of);
        self.names.iter().enumerate().find_map(|(second, name)| {
            let (of, unit) = last_word(name);
            let is_second = SECONDS.has(&unit);
            is_second.then(|| nanoseconds(&of)).flatten().map(|part| vec![second, part])
        })
    }

    /// Whether a column, by its name, may hold times of others as the one of another name does.
    pub(super) fn may_be_time(&self, column: usize, main: usize) -> bool {
        let (own, of_main) = (time_words(&self.names[column]), time_words(&self.names[main]));
        self.has_time_word(column) || (own.last() == of_main.last() && own.len() > 1)
    }

    /// Whether the name of a column has a word for time.
    pub(super) fn has_time_word(&self, column: usize) -> bool {
        time_words(&self.names[column]).iter().any(|word| TIME_WORDS.has(word))
    }

    /// Whether a column, by its name, is the part of the second of times in other columns.
    pub(super) fn is_fraction_of(&self, column: usize, times: &[usize]) -> bool {
        let (before, _) = last_word(&self.names[column]);
        let of_time =
            times.iter().any(|time| last_word(&self.names[*time]).0 == before || before == plain(&self.names[*time]));
        fraction_digits(&self.names[column]).is_some() && (before.is_empty() || of_time)
    }
}

/// Words for seconds.
const SECONDS: Words = Words("s|sec|secs|second|seconds");
/// Words for parts of a second, with their digits behind it.
const PARTS: [(Words, usize); 3] = [
    (Words("ms|msec|millis|millisec|millisecond|milliseconds|millisekunden"), 3),
    (Words("us|usec|microseconds"), 6),
    (Words("ns|nsec|nanosec|nanosecs|nanoseconds"), 9),
];

/// The last word of a column's name, without what stands in brackets, and what is before it; in lower case.
fn last_word(name: &str) -> (String, String) {
    let bare = bracketed(name).map_or(name, |(bare, _)| bare).trim().to_lowercase();
    let from = bare.char_indices().rev().take_while(|(_, letter)| letter.is_alphanumeric()).last();
    let (before, word) = bare.split_at(from.map_or(bare.len(), |(from, _)| from));
    (before.trim_end_matches(|letter: char| !letter.is_alphanumeric()).to_owned(), word.to_owned())
}

/// The words of a column's name, in lower case, without what stands in brackets and without digits.
fn time_words(name: &str) -> Vec<String> {
    let bare = bracketed(name).map_or(name, |(bare, _)| bare).trim().to_lowercase();
    let words = bare.split(|letter: char| !letter.is_alphabetic()).filter(|word| !word.is_empty());
    words.map(str::to_owned).collect()
}

/// The digits behind the second of a column that by its name holds a part of it.
pub(super) fn fraction_digits(name: &str) -> Option<usize> {
    let (_, word) = last_word(name);
    PARTS.iter().find(|(parts, _)| parts.has(&word)).map(|(_, digits)| *digits)
}

/// What a cell that is no number may be.
pub(in crate::import) fn hint(text: &str, numbers: &Numbers) -> String {
    let digits = text.bytes().filter(u8::is_ascii_digit).count();
    if digits == 0 || digits * 2 < text.len() {
        return format!("; if it stands for no value, add it to `file: {{missing: [\"{text}\"]}}` in the map");
    }
    let other = if numbers.decimal == '.' { ',' } else { '.' };
    match (text.matches(other).count(), text.contains(numbers.decimal)) {
        (1, false) if text.rsplit(other).next().is_some_and(|rest| rest.len() == 3) => format!(
            "; give `file: {{decimal: \"{other}\"}}` in the map if that is the decimal sign, `file: {{thousands: \"{other}\"}}` if it stands between \
             groups of digits"
        ),
        (1, false) => format!("; give `file: {{decimal: \"{other}\"}}` in the map if that is the decimal sign"),
        (0, _) => String::new(),
        _ => format!("; give `file: {{thousands: \"{other}\"}}` in the map if that stands between groups of digits"),
    }
}

/// The signal with the unit that its column's header states, where the map states none; where both do and differ, a warning.
///
/// # Errors
/// In words, where the header's unit may be meant two ways.
pub(super) fn with_header_unit(
    one: &SignalMap,
    stated: &str,
    notes: &mut Vec<String>,
    warnings: &mut Vec<String>,
) -> Result<SignalMap, String> {
    let mut one = one.clone();
    let read = |text: &str| if one.target.is_pressure() { pressure(text) } else { share(text) };
    let id = one.target.id();
    if stated.is_empty() || one.target == Target::Esv || one.unit == AS_RECORDED {
        return Ok(one);
    }
    if one.unit.is_empty() {
        let takes_unit = one.conversion.range.is_none() || one.conversion.to != [0.0, 1.0];
        if let (true, Some([first, other])) = (takes_unit, either_factor(stated)) {
            return Err(format!(
                "{id}: its header says `{stated}`, which may mean {first} or {other}; say which with `unit: \"{first}\"` in the map"
            ));
        }
        match read(stated) {
            Some(unit) if takes_unit => {
                if unit != UnitConversion::ONE {
                    notes.push(format!("{id}: unit `{stated}` as its header says"));
                }
                one.conversion.unit = unit;
                stated.clone_into(&mut one.unit);
            }
            None if takes_unit => warnings.push(format!(
                "{id}: its header says `{stated}`, and the map neither a `unit` nor, for a position, which values are closed and open \
                 (`range`); taken as {}",
                one.target.unit()
            )),
            _ => {}
        }
    } else if let (Some(header), Some(mapped)) = (read(stated), read(&one.unit))
        && header != mapped
    {
        let mapped = plain(&one.unit);
        warnings.push(format!("{id}: its header says `{stated}`, the map `{mapped}`; the map counts"));
    }
    Ok(one)
}
