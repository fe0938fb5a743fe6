//! Columns that say of values whether they are good: OPC quality numbers and status codes, words, and flags.

use super::channel::ChannelValue;
use crate::import::words::Words;

/// Words of names that say that a column holds the quality of another.
const QUALITY: Words = Words(
    "quality|qual|q|status|state|valid|validity|good|statuscode|qualitaet|qualität|gueltig|qualite|flag|qc|gültig|bad|invalid|questionable|\
     substituted|suspect|ungueltig|ungültig|fault|error|pctgood|qualité|qualità|calidad|qualidade|kvalitet|kvalité|质量|品质|качество|ok|isgood|\
     confidence|conf|annotation|annotated|interpolated|nan|güte|guete|err|flags|st",
);
/// Words of names by which 1, or true, says that a value is not good.
const NOT_GOOD: Words = Words("bad|invalid|questionable|substituted|suspect|ungueltig|ungültig|interpolated|nan");
/// Words of names that stand for the value beside its quality.
const VALUE: Words = Words("is|value|val|pv|wert|valeur|valor|current|v|code|pct|percent");
/// Beginnings of words that say that a value is good.
const GOOD: Words = Words("good|ok|valid|normal|gut|true|measured|bon|buen|boa|bom|god|bra|好|正常|хорош|g");
/// And that it is not; words of one letter stand for themselves.
const BAD: Words = Words(
    "bad|invalid|uncertain|questionable|false|fail|err|stale|comm|not|no|substitut|i/o|out|timeout|schlecht|ungültig|unsicher|manual|mauvais|mal|\
     ruim|dårlig|dålig|interpol|坏|故障|плох|b|u|x",
);
/// Different values of a column that are kept.
const MOST_DISTINCT: usize = 32;
/// OPC DA: a quality from here on is good, of 0 to 255.
const OPC_DA_GOOD: f64 = 192.0;
/// SIMATIC PCS 7: a quality code from here on is good, where none reaches those of OPC DA.
const PCS7_GOOD: f64 = 128.0;
/// OPC UA: a status below is good; the two bits above say uncertain or bad.
const OPC_UA_NOT_GOOD: f64 = 1_073_741_824.0;

/// How a column says whether a value is good.
#[derive(Clone, Debug, PartialEq)]
pub(in crate::import) enum Quality {
    /// OPC DA: 192 to 255.
    OpcDa,
    /// PCS 7: 128 to 191.
    Pcs7,
    /// OPC UA: a status code below 2^30.
    OpcUa,
    /// Words that begin with good, ok, valid and the like.
    Words,
    /// A flag that is 1 for good.
    Flag,
    /// A flag that is 1 for what is not good.
    NotGood,
    /// A share of good samples, %.
    Share,
    /// What the map lists.
    Listed(Vec<String>),
}

impl Quality {
    /// Whether a value is good by what stands in its quality column.
    pub(in crate::import) fn is_good(&self, value: ChannelValue<'_>) -> bool {
        let number = code(value);
        match (self, value) {
            // An export that leaves the cell empty repeats the one above, or has nothing to complain of.
            (_, ChannelValue::Missing) => true,
            (Self::OpcDa, _) => number.is_some_and(|number| (OPC_DA_GOOD..256.0).contains(&number)),
            (Self::Pcs7, _) => number.is_some_and(|number| (PCS7_GOOD..256.0).contains(&number)),
            (Self::Share, _) => number.is_some_and(|number| number >= 100.0),
            (Self::NotGood, ChannelValue::Text(text)) => is_word(text, Words("false|no|good|ok")),
            (Self::NotGood, _) => number == Some(0.0),
            (Self::OpcUa, _) => number.is_some_and(|number| (0.0..OPC_UA_NOT_GOOD).contains(&number)),
            (Self::Flag | Self::Words, ChannelValue::Text(text)) => is_word(text, GOOD),
            (Self::Flag, _) => number == Some(1.0),
            (Self::Words, _) => false,
            (Self::Listed(good), ChannelValue::Text(text)) => {
                good.iter().any(|word| word.eq_ignore_ascii_case(text.trim()))
            }
            (Self::Listed(good), _) => {
                good.iter().any(|word| word.parse().ok().is_some_and(|known: f64| number == Some(known)))
            }
        }
    }
}

/// The number that a cell holds, also as programs write codes: `0xC0`, `16#80`.
fn code(value: ChannelValue<'_>) -> Option<f64> {
    match value {
        ChannelValue::Number(number) => Some(number),
        ChannelValue::Whole(whole) => Some(whole as f64),
        ChannelValue::Text(text) => {
            let text = text.trim();
            let digits = ["0x", "0X", "16#"].iter().find_map(|begin| text.strip_prefix(begin))?;
            u32::from_str_radix(digits, 16).ok().map(f64::from)
        }
        _ => None,
    }
}

/// Whether a word begins as one of some do; those of one letter must be the whole word.
fn is_word(text: &str, known: Words) -> bool {
    let text = text.trim().trim_matches(['[', ']', '(', ')']).to_lowercase();
    known.all().any(|word| if word.len() == 1 { text == word } else { text.starts_with(word) })
}

/// Counts one of few values.
fn count<T: PartialEq>(found: &mut Vec<(T, u64)>, value: T) {
    if let Some((_, count)) = found.iter_mut().find(|(known, _)| *known == value) {
        *count += 1;
    } else if found.len() < MOST_DISTINCT {
        found.push((value, 1));
    }
}

/// What stands in a column that may hold the quality of another, and how often.
#[derive(Clone, Debug, Default)]
pub(in crate::import) struct QualityLook {
    words: Vec<(String, u64)>,
    numbers: Vec<(f64, u64)>,
    blanks: u64,
    others: bool,
}

impl QualityLook {
    pub(in crate::import) fn take(&mut self, value: ChannelValue<'_>) {
        match (code(value), value) {
            (Some(number), _) => count(&mut self.numbers, number),
            (None, ChannelValue::Text(text)) => match self.words.iter_mut().find(|(known, _)| known == text.trim()) {
                Some((_, times)) => *times += 1,
                None => count(&mut self.words, text.trim().to_owned()),
            },
            (None, ChannelValue::Missing) => self.blanks += 1,
            _ => self.others = true,
        }
    }

    /// How the column says what is good; none where it shows nothing but one state, an error in words where it shows several and nobody knows which
    /// of them is good, or where it calls most values bad.
    pub(in crate::import) fn quality(&self, name: &str) -> Result<Option<Quality>, String> {
        let whole = self.numbers.iter().all(|(number, _)| number.fract() == 0.0);
        if self.others || !whole || self.numbers.len() >= MOST_DISTINCT || self.words.len() >= MOST_DISTINCT {
            return Ok(None);
        }
        let found = self.rule(name);
        let counts = self.numbers.iter().map(|(number, count)| (ChannelValue::Number(*number), count));
        let words = self.words.iter().map(|(word, count)| (ChannelValue::Text(word), count));
        let (mut good, mut all) = (self.blanks, self.blanks);
        for (value, count) in counts.chain(words) {
            all += count;
            good += found.as_ref().map_or(0, |quality| if quality.is_good(value) { *count } else { 0 });
        }
        match found {
            Some(quality) if 2 * good >= all => Ok(Some(quality)),
            // One state alone says nothing; a mark beside some values alone says something.
            None if self.words.len() + self.numbers.len() + usize::from(self.blanks > 0) <= 1 => Ok(None),
            None if self.words.is_empty() && self.numbers.len() == 1 && self.blanks > 0 => Ok(None),
            _ => {
                let words = self.words.iter().map(|(word, _)| word.clone());
                let numbers = self.numbers.iter().map(|(number, _)| number.to_string());
                let found: Vec<String> = words.chain(numbers).take(6).map(|found| format!("`{found}`")).collect();
                Err(found.join(", "))
            }
        }
    }

    /// The rule by which a column of this name, and these contents, says what is good.
    fn rule(&self, name: &str) -> Option<Quality> {
        let most = self.numbers.iter().map(|(number, _)| *number).fold(0.0, f64::max);
        // Programs without unsigned numbers write codes of 32 bits as negative ones.
        let is_signed = self.numbers.iter().any(|(number, _)| *number <= -OPC_UA_NOT_GOOD);
        let words = words_of(name);
        let says = |known: Words| words.iter().any(|word| known.has(word));
        let known = |(word, _): &(String, u64)| is_word(word, GOOD) || is_word(word, BAD);
        let truths = self.words.iter().all(|(word, _)| is_word(word, Words("true|false")));
        match (self.words.is_empty(), self.numbers.is_empty()) {
            _ if says(NOT_GOOD) && truths && most <= 1.0 => Some(Quality::NotGood),
            // `fault` and `error` may be of the machine.
            _ if says(Words("fault|error|err")) => None,
            (false, true) if self.words.iter().all(known) => Some(Quality::Words),
            (true, false)
                if says(Words("pctgood"))
                    || says(Words("good")) && says(Words("pct|percent"))
                    || says(Words("confidence|conf")) && most == 100.0 =>
            {
                Some(Quality::Share)
            }
            (true, false) if (OPC_DA_GOOD..256.0).contains(&most) => Some(Quality::OpcDa),
            (true, false) if (PCS7_GOOD..OPC_DA_GOOD).contains(&most) => Some(Quality::Pcs7),
            (true, false)
                if most >= OPC_UA_NOT_GOOD
                    || is_signed
                    || says(Words("statuscode"))
                    || says(Words("status")) && says(Words("code")) =>
            {
                Some(Quality::OpcUa)
            }
            (true, false) if most <= 1.0 && says(Words("valid|validity|good|gueltig|gültig|ok|isgood")) => {
                Some(Quality::Flag)
            }
            _ => None,
        }
    }
}

fn words_of(name: &str) -> Vec<String> {
    let mut spaced = String::new();
    let mut before = ' ';
    for letter in name.chars() {
        if before.is_lowercase() && letter.is_uppercase() {
            spaced.push(' ');
        }
        spaced.push(letter);
        before = letter;
    }
    spaced
        .to_lowercase()
        .split(|letter: char| !letter.is_alphanumeric())
        .filter(|word| !word.is_empty())
        .map(str::to_owned)
        .collect()
}

fn is_quality_word(word: &str) -> bool {
    QUALITY.has(word.trim_end_matches(|letter: char| letter.is_ascii_digit()))
}

/// The column that holds the quality of a column's values: of the same name but for a word that says so, or right beside it with such a word alone.
pub(in crate::import) fn column_of(names: &[String], value: usize) -> Option<usize> {
    let base = |name: &str| -> Vec<String> {
        let words = words_of(name);
        let kept = words.iter().filter(|word| !is_quality_word(word) && !VALUE.has(word));
        kept.cloned().collect()
    };
    let says_quality = |name: &str| words_of(name).iter().any(|word| is_quality_word(word));
    let own = names.get(value)?;
    let wanted = base(own);
    let same = |index: &usize| *index != value && says_quality(&names[*index]) && base(&names[*index]) == wanted;
    let by_name = (0..names.len()).find(same).filter(|_| !wanted.is_empty() && !says_quality(own));
    let beside = (value + 1 < names.len()).then_some(value + 1);
    by_name
        .or(beside
            .filter(|index| says_quality(&names[*index]) && base(&names[*index]).is_empty() && !says_quality(own)))
}

/// The only column that is called a quality and nothing else: that of whole rows.
pub(in crate::import) fn column_of_rows(names: &[String]) -> Option<usize> {
    let is_bare = |name: &String| {
        let words = words_of(name);
        !words.is_empty() && words.iter().all(|word| is_quality_word(word))
    };
    let mut bare = (0..names.len()).filter(|index| is_bare(&names[*index]));
    bare.next().filter(|_| bare.next().is_none())
}

/// The column of a table with one value a line that holds the quality of each.
pub(in crate::import) fn column_of_lines(names: &[String], taken: &[usize]) -> Option<usize> {
    let is_one = |name: &String| {
        let words = words_of(name);
        !words.is_empty() && words.iter().all(|word| is_quality_word(word) || word == "code" || VALUE.has(word))
    };
    (0..names.len()).find(|index| !taken.contains(index) && is_one(&names[*index]))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn look(values: &[ChannelValue<'_>]) -> QualityLook {
        let mut look = QualityLook::default();
        values.iter().for_each(|value| look.take(*value));
        look
    }

    #[test]
    fn every_way_of_saying_good_is_known() {
        let number = ChannelValue::Number;
        let text = ChannelValue::Text;
        for (name, values, good, bad) in [
            ("Y.Quality", vec![number(192.0), number(24.0)], number(216.0), number(64.0)),
            ("Y.StatusCode", vec![number(0.0), number(2_147_483_648.0)], number(0.0), number(1_083_179_008.0)),
            ("Status", vec![text("Good"), text("Bad, comm. failure")], text("GOOD [Non-Specific]"), text("Uncertain")),
            ("valid", vec![number(1.0), number(0.0)], number(1.0), number(0.0)),
            ("Y_valid", vec![text("true"), text("false")], text("TRUE"), text("false")),
            ("Validity", vec![text("G"), text("B")], text("g"), text("B")),
            ("Y quality", vec![text("0xC0"), text("0x18")], text("0xD8"), text("0x40")),
            ("Y QC", vec![text("16#80"), text("16#00")], text("16#84"), text("16#60")),
            ("Y quality", vec![number(128.0), number(0.0)], number(128.0), number(68.0)),
            ("Y quality", vec![text("[valid]"), text("[invalid]")], text("[valid]"), text("[invalid]")),
            ("Questionable", vec![text("False"), text("True")], text("FALSE"), text("True")),
            ("Y_bad", vec![number(0.0), number(1.0)], number(0.0), number(1.0)),
            ("PctGood", vec![number(100.0), number(0.0)], number(100.0), number(97.0)),
            ("Y Confidence", vec![number(100.0), number(0.0)], number(100.0), number(50.0)),
            ("Y_ok", vec![number(1.0), number(0.0)], number(1.0), number(0.0)),
            ("Y qualité", vec![text("bon"), text("mauvais")], text("bon"), text("mauvais")),
            ("Y 质量", vec![text("好"), text("坏")], text("好"), text("坏")),
            ("Y status", vec![number(0.0), number(-2_146_828_288.0)], number(0.0), number(-2_146_828_288.0)),
            ("Y is_good", vec![text("True"), text("False")], text("True"), text("False")),
            ("Y flag", vec![text("measured"), text("substituted")], text("measured"), text("substituted")),
            ("Y Güte", vec![text("gut"), text("schlecht")], text("gut"), text("schlecht")),
            ("Y flags", vec![ChannelValue::Missing, text("U")], ChannelValue::Missing, text("U")),
            ("Y_st", vec![number(192.0), number(24.0)], number(192.0), number(24.0)),
            ("Y interpolated", vec![number(0.0), number(1.0)], number(0.0), number(1.0)),
        ] {
            let quality = look(&values).quality(name).unwrap().unwrap_or_else(|| panic!("{name}"));
            assert!(quality.is_good(good) && !quality.is_good(bad), "{name}: {quality:?}");
        }
        assert_eq!(look(&[number(0.0)]).quality("Quality").unwrap(), None, "one state says nothing");
        assert!(look(&[number(0.0), number(3.0)]).quality("Quality").is_err(), "nobody knows which is good");
        let system_states = [number(0.0), number(0.0), number(0.0), number(248.0)];
        assert!(look(&system_states).quality("Status").is_err(), "most values would be bad");
        assert!(look(&[ChannelValue::Missing, text("*")]).quality("flag").is_err(), "a mark beside some values");
        for name in ["servo fault", "servo_ERR"] {
            assert!(
                look(&[number(0.0), number(1.0)]).quality(name).is_err(),
                "{name}: of the machine, or of the value?"
            );
        }
    }

    #[test]
    fn the_quality_of_a_column_is_found_by_its_name_or_place() {
        let names = |text: &str| text.split(',').map(str::to_owned).collect::<Vec<_>>();
        for (header, value, quality) in [
            ("t,Y.Value,Y.Quality,Z.Value,Z.Quality", 3, Some(4)),
            ("t,Y,Z,Y_Q,Z_Q", 2, Some(4)),
            ("t,Y,Quality,Z,Quality", 3, Some(4)),
            ("t,ESV_STATUS,Y", 2, None),
            ("t,ESV_STATUS,Y", 1, None),
            ("t,gateValue,gateStatusCode", 1, Some(2)),
        ] {
            assert_eq!(column_of(&names(header), value), quality, "{header} {value}");
        }
        for (header, quality) in
            [("t,Y,Z,Status", Some(3)), ("t,Y,Quality,Z,Quality", None), ("t,Y_Q,Y,UNIT_STATUS", None)]
        {
            assert_eq!(column_of_rows(&names(header)), quality, "{header}");
        }
        assert_eq!(column_of_lines(&names("Tag,Timestamp,Value,Status"), &[0, 1, 2]), Some(3));
    }
}
