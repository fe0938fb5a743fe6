//! How a table is laid out, found out from its first lines: separator, decimal sign, where names, units and data stand.

use super::convert::{is_any_unit, is_unit, pressure, with_factor};
use super::map::FileMap;
use super::number::{NumberCell, Numbers, groups};

/// Lines of a sample that are looked at.
const MOST_LINES: usize = 200;
/// Separators that are tried, in this order: a comma may be a decimal sign, the others hardly anything else.
const SEPARATORS: [u8; 4] = *b";\t|,";
/// The share of lines that must have as many cells as most.
const CONSISTENT: f64 = 0.8;
/// Lines of names, units and words that may stand above the data.
const MOST_HEADER_LINES: usize = 4;

/// How a table is laid out.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Dialect {
    pub(super) separator: u8,
    pub(super) numbers: Numbers,
    /// Names of the columns; their numbers where the table has none.
    pub(super) names: Vec<String>,
    /// Units of the columns, empty where the table does not say.
    pub(super) units: Vec<String>,
    /// Line of the names, counted from 1; 0 where there is none.
    pub(super) header_line: u64,
    pub(super) unit_line: Option<u64>,
    /// First line of data.
    pub(super) first_line: u64,
    /// Whether cells may be quoted.
    pub(super) quoted: bool,
    /// Units that stand behind the numbers of a column in its cells, empty where none does.
    pub(super) in_cells: Vec<String>,
}

/// Finds out how a table is laid out from its first lines, of which the last may be cut; what the map says counts.
///
/// # Errors
/// In words, where it is no table.
pub(super) fn sniff(sample: &str, map: &FileMap) -> Result<Dialect, String> {
    let lines: Vec<&str> = sample.lines().take(MOST_LINES).collect();
    let stated = lines.first().and_then(|line| line.trim().strip_prefix("sep=")).and_then(|rest| rest.bytes().next());
    let separator = map.separator.or(stated).unwrap_or_else(|| separator(&lines));
    let cells: Vec<Vec<String>> = lines.iter().map(|line| split(line, separator)).collect();
    let width = most_common(cells.iter().filter(|row| !is_blank(row)).map(Vec::len))
        .ok_or("expected a table, found no line with text in it")?;
    let decimal = map.decimal.unwrap_or_else(|| decimal(&cells, separator, width));
    let thousands = map.thousands.or_else(|| cells.iter().flatten().find_map(|cell| groups(cell, decimal)));
    let numbers = Numbers { decimal, thousands, missing: map.missing.clone() };
    let data = |row: &Vec<String>| is_data(row, width, &numbers);
    let header = map.header_line.filter(|line| *line > 0);
    let begin = if let Some(line) = map.first_line {
        usize::try_from(line.saturating_sub(1)).unwrap_or(usize::MAX)
    } else {
        let from = header.max(map.unit_line).map_or(0, |line| usize::try_from(line).unwrap_or(0));
        let rows = || cells.iter().enumerate().skip(from).filter(|(_, row)| !is_blank(row));
        // One line with numbers may be part of a preamble, two in a row are data.
        let next = |k: usize| rows().find(|(other, _)| *other > k).is_none_or(|(_, row)| data(row));
        rows().find(|(k, row)| data(row) && next(*k)).map(|(k, _)| k).ok_or_else(|| no_data(&cells, separator))?
    };
    let above = begin.min(cells.len());
    // Names may go on where the rows of data end, as before a comment that none has.
    let names_more = |k: usize| {
        let row = &cells[k];
        let is_name = |(i, cell): (usize, &String)| {
            !cell.is_empty() && !row[..i].contains(cell) && !is_number(cell, &numbers) && !is_time(cell)
        };
        row.len() > width && k + 1 == begin && row.iter().take(width).enumerate().all(is_name)
    };
    let is_above = |k: &usize| cells[*k].len() == width || names_more(*k);
    let filled = (0..above).rev().filter(|k| !is_blank(&cells[*k]));
    let above: Vec<usize> = filled.take(MOST_HEADER_LINES).take_while(is_above).collect();
    let unit_row = |k: usize| {
        let filled: Vec<&String> = cells[k].iter().filter(|cell| !cell.is_empty()).collect();
        let units = filled.iter().filter(|cell| is_unit(cell) || cell.starts_with('[')).count();
        // A number before a unit is a factor beside units alone.
        let scaled = filled.iter().filter(|cell| !is_unit(cell) && is_any_unit(cell)).count();
        units > 0 && 2 * (units + scaled) >= filled.len()
    };
    let units_at = match map.unit_line {
        Some(line) => usize::try_from(line).ok().and_then(|line| line.checked_sub(1)),
        // A single line above the data names the columns, and `t,a` are names.
        None => above.iter().copied().find(|k| above.len() > 1 && unit_row(*k)),
    };
    let names_at = match map.header_line {
        Some(0) => None,
        Some(line) => usize::try_from(line).ok().map(|line| line - 1),
        None => {
            let named = |k: &usize| {
                let row = &cells[*k];
                Some(*k) != units_at
                    && row.iter().enumerate().all(|(i, cell)| !cell.is_empty() && !row[..i].contains(cell))
            };
            let rest = || above.iter().copied().filter(|k| Some(*k) != units_at);
            rest().rev().find(named).or(rest().next())
        }
    };
    let row = |k: Option<usize>| k.and_then(|k| cells.get(k)).cloned().unwrap_or_default();
    let above_names = names_at.and_then(|k| k.checked_sub(1)).filter(|k| Some(*k) != units_at);
    let mut names = below_tags(row(names_at), above_names.map(|k| cells[k].as_slice()));
    let mut units = row(units_at);
    names.truncate(width);
    if names_at.is_none() {
        names = (1..=width).map(|k| format!("#{k}")).collect();
    }
    for (k, name) in names.iter_mut().enumerate().filter(|(_, name)| name.is_empty()) {
        *name = format!("#{}", k + 1);
    }
    units.resize(names.len(), String::new());
    for (name, unit) in names.iter().zip(&mut units) {
        *unit = unit.trim_matches(['[', ']', '(', ')']).to_owned();
        if unit.is_empty() {
            *unit = bracketed(name).map_or_else(String::new, |(_, unit)| unit.to_owned());
        }
    }
    let in_cells = units_in_cells(&cells[begin.min(cells.len())..], names.len(), &numbers);
    for (unit, in_cells) in units.iter_mut().zip(&in_cells).filter(|(unit, _)| unit.is_empty()) {
        unit.clone_from(in_cells);
    }
    let line = |k: usize| k as u64 + 1;
    Ok(Dialect {
        separator,
        numbers,
        names,
        units,
        header_line: names_at.map_or(0, line),
        unit_line: units_at.map(line),
        first_line: map.first_line.unwrap_or(line(begin)),
        quoted: sample.contains('"'),
        in_cells,
    })
}

/// Words that name no signal, below a line of tags of which each stands above the first of its columns.
const BELOW_TAGS: [&str; 6] = ["value", "wert", "valeur", "valor", "val", "verdi"];

/// Names of two lines: where the lower has `Time` and `Value` again and again, the tag above a value is its name.
fn below_tags(names: Vec<String>, above: Option<&[String]>) -> Vec<String> {
    let is_value = |name: &String| BELOW_TAGS.contains(&name.to_lowercase().as_str());
    let Some(tags) =
        above.filter(|tags| tags.len() == names.len() && names.iter().filter(|name| is_value(name)).count() > 1)
    else {
        return names;
    };
    let tag_of = |column: usize| tags[..=column].iter().rev().find(|tag| !tag.is_empty());
    let named = |(column, name): (usize, &String)| match tag_of(column).filter(|_| is_value(name)) {
        Some(tag) => tag.clone(),
        None => name.clone(),
    };
    names.iter().enumerate().map(named).collect()
}

/// A number and the unit behind it, `70.8 %`.
pub(super) fn with_unit<'a>(text: &'a str, numbers: &Numbers) -> Option<(&'a str, &'a str)> {
    let text = text.trim();
    let is_exponent = |at: usize| {
        let rest = text[at + 1..].trim_start_matches(['+', '-']);
        text[..at].ends_with(|letter: char| letter.is_ascii_digit())
            && rest.starts_with(|letter: char| letter.is_ascii_digit())
    };
    let begins = |(at, letter): &(usize, char)| {
        let exponent = matches!(letter, 'e' | 'E' | 'd' | 'D') && is_exponent(*at);
        (letter.is_alphabetic() && !exponent) || "%‰°[".contains(*letter)
    };
    let (at, _) = text.char_indices().find(begins)?;
    let (number, unit) = (text[..at].trim_end(), &text[at..]);
    (is_unit(unit) && matches!(numbers.cell(number), NumberCell::Number(_))).then_some((number, unit))
}

/// The unit behind most numbers of each column.
fn units_in_cells(rows: &[Vec<String>], width: usize, numbers: &Numbers) -> Vec<String> {
    let of = |column: usize| {
        let filled =
            rows.iter().filter_map(|row| row.get(column)).filter(|cell| numbers.cell(cell) != NumberCell::Missing);
        let units: Vec<&str> = filled.map(|cell| with_unit(cell, numbers).map_or("", |(_, unit)| unit)).collect();
        let first = units.iter().find(|unit| !unit.is_empty())?;
        let same = units.iter().filter(|unit| *unit == first).count();
        (same as f64 >= CONSISTENT * units.len() as f64).then(|| (*first).to_owned())
    };
    (0..width).map(|column| of(column).unwrap_or_default()).collect()
}

fn no_data(cells: &[Vec<String>], separator: u8) -> String {
    let first = cells.iter().find(|row| !is_blank(row)).map(|row| row.join(&char::from(separator).to_string()));
    let first: String = first.unwrap_or_default().chars().take(60).collect();
    format!(
        "expected lines of numbers, found none in the first {} lines, which begin with `{first}`; if data begin later, say \
         where with `file: {{first_line: N}}` in the map",
        cells.len()
    )
}

/// A name and the unit at its end: in brackets, `p_tank [bar]`, or behind a sign or word, `p tank / bar`, `Y, %`, `Y in mm`, `p_tank bar`.
pub(super) fn bracketed(name: &str) -> Option<(&str, &str)> {
    let name = name.trim();
    if let Some(open) = name.rfind(['[', '(']) {
        let inside = |open: usize| Some(name[open + 1..].strip_suffix([']', ')'])?.trim());
        // Gauge and absolute stand in brackets of their own: `[bar(g)]`.
        let outer = name[..open]
            .rfind(['[', '('])
            .filter(|_| name.ends_with("])") || name.ends_with(")]") || name.ends_with("))"));
        let found = [Some(open), outer]
            .into_iter()
            .flatten()
            .find_map(|open| Some((open, inside(open).filter(|unit| is_any_unit(unit))?)));
        return found.filter(|(open, _)| *open > 0).map(|(open, unit)| (name[..open].trim(), unit));
    }
    let scaled = [" / ", ", ", " in "].iter().filter_map(|sign| name.rsplit_once(sign));
    if let Some(found) = scaled.into_iter().find(|(_, unit)| with_factor(unit).0 != 1.0 && is_any_unit(unit)) {
        return Some((found.0.trim(), found.1)).filter(|(bare, _)| !bare.is_empty());
    }
    let (rest, unit) = name.rsplit_once([' ', '/', ','])?;
    // `p 0.1 bar` and `t 10 ms`; `p 1 bar` is a name with a number.
    let before =
        rest.rsplit_once(' ').filter(|(_, word)| unit == "ms" || word.starts_with("0.") || word.starts_with("0,"));
    if let Some((bare, unit)) =
        before.map(|(bare, _)| (bare.trim(), name[bare.len()..].trim())).filter(|(_, unit)| is_any_unit(unit))
    {
        return Some((bare, unit)).filter(|(bare, _)| !bare.is_empty());
    }
    // Letters that stand alone tell signals apart as well.
    let sure = (pressure(unit).is_some() && unit != "at") || ["%", "‰", "mm", "mA", "ms", "kPa"].contains(&unit);
    let rest = rest.trim_end();
    let behind = [" /", " in", ","].iter().find_map(|sign| rest.strip_suffix(sign));
    let stated = behind.filter(|_| is_unit(unit)).or((sure && unit.len() > 1 || unit == "%").then_some(rest));
    stated.map(str::trim).filter(|bare| !bare.is_empty()).map(|bare| (bare, unit))
}

/// The separator by which most lines have the same number of cells, more than one.
fn separator(lines: &[&str]) -> u8 {
    let full = || lines.iter().filter(|line| !line.trim().is_empty());
    let consistent = |separator: &u8| {
        let counts: Vec<usize> = full().map(|line| split(line, *separator).len()).collect();
        let Some(width) = most_common(counts.iter().copied()) else { return false };
        let same = counts.iter().filter(|count| **count == width).count();
        width > 1 && same as f64 >= CONSISTENT * counts.len().saturating_sub(MOST_HEADER_LINES).max(1) as f64
    };
    if let Some(found) = SEPARATORS.into_iter().find(consistent) {
        return found;
    }
    let blank = |line: &&&str| line.split_whitespace().count() > 1 && line.bytes().any(|byte| byte.is_ascii_digit());
    if full().filter(blank).count() * 2 > lines.len() { b' ' } else { b',' }
}

/// Cells of a line; of one that blanks separate, runs of blanks count as one.
pub(super) fn split(line: &str, separator: u8) -> Vec<String> {
    if separator == b' ' {
        return line.split_whitespace().map(str::to_owned).collect();
    }
    let mut cells = vec![String::new()];
    let mut quoted = false;
    for letter in line.trim_end_matches('\r').chars() {
        if letter == '"' {
            quoted = !quoted;
        } else if letter == char::from(separator) && !quoted {
            cells.push(String::new());
        } else if let Some(cell) = cells.last_mut() {
            cell.push(letter);
        }
    }
    for cell in &mut cells {
        *cell = cell.trim().to_owned();
    }
    cells
}

fn is_blank(row: &[String]) -> bool {
    row.iter().all(String::is_empty)
}

fn most_common(counts: impl Iterator<Item = usize>) -> Option<usize> {
    let mut counts: Vec<usize> = counts.collect();
    counts.sort_unstable();
    counts.chunk_by(|a, b| a == b).max_by_key(|same| (same.len(), same[0])).map(|same| same[0])
}

/// Whether a row holds data: at least half of what it holds are numbers or times, or a time is among them.
pub(super) fn is_data(row: &[String], width: usize, numbers: &Numbers) -> bool {
    let filled: Vec<&String> = row.iter().filter(|cell| numbers.cell(cell) != NumberCell::Missing).collect();
    let values = filled.iter().filter(|cell| is_number(cell, numbers) || is_time(cell)).count();
    // Beside names and words, a time and a number are enough: a line of one value has no more.
    let dated = values > 1 && filled.iter().any(|cell| is_time(cell));
    row.len() == width && values > 0 && (dated || 2 * values >= filled.len())
}

/// Whether a cell is a number, with or without a unit.
fn is_number(cell: &str, numbers: &Numbers) -> bool {
    matches!(numbers.cell(cell), NumberCell::Number(_)) || with_unit(cell, numbers).is_some()
}

/// Whether a text looks like a date or a time of day.
fn is_time(text: &str) -> bool {
    let digits = text.bytes().filter(u8::is_ascii_digit).count();
    text.starts_with(|letter: char| letter.is_ascii_digit())
        && digits >= 4
        && 2 * digits >= text.len()
        && text.contains([':', '-', '.', '/'])
}

/// The decimal sign that most numbers have which have one.
fn decimal(cells: &[Vec<String>], separator: u8, width: usize) -> char {
    let signed = |sign: char| {
        let has = |cell: &&String| {
            let plain = Numbers { decimal: sign, thousands: None, missing: vec![] };
            let number = with_unit(cell, &plain).map_or(cell.as_str(), |(number, _)| number);
            number.contains(sign) && matches!(plain.cell(number), NumberCell::Number(_))
        };
        cells.iter().filter(|row| row.len() == width).flatten().filter(has).count()
    };
    if separator == b',' {
        // A comma inside of quotes may stand between groups of digits.
        let part = |cell: &String| {
            cell.rsplit_once(',')
                .is_some_and(|(_, part)| part.bytes().all(|byte| byte.is_ascii_digit()) && part.len() != 3)
        };
        return if signed('.') == 0 && cells.iter().flatten().any(part) && signed(',') > 0 { ',' } else { '.' };
    }
    if signed(',') > signed('.') { ',' } else { '.' }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(sample: &str) -> Dialect {
        sniff(sample, &FileMap::default()).unwrap_or_else(|error| panic!("{error}\n{sample}"))
    }

    #[test]
    fn layouts_of_many_tools_are_found_out() {
        // Name of the last column, separator, decimal sign, line of the names, first line.
        for (sample, name, separator, decimal, header, first) in [
            ("t,r,u\n0,1,2\n1,2,3\n", "u", b',', '.', 1, 2),
            ("Zeit;p [bar];Y\n02.05.2024 10:00:00;63,5;0,1\n02.05.2024 10:00:01;63,4;0,2\n", "Y", b';', ',', 1, 2),
            ("Anlage X\nUnit 3\n\nt;p\ns;bar\n0;63,5\n1;63,5\n", "p", b';', ',', 4, 6),
            ("sep=;\nt;p\n0,5;1\n1,5;1\n", "p", b';', ',', 2, 3),
            ("t\ty\n0\t1.5\n1\t2.5\n", "y", b'\t', '.', 1, 2),
            ("0.1 0.2 0.3\n0.2 0.3 0.4\n", "#3", b' ', '.', 0, 1),
            ("   1.0000000e+00   2.0000000e+00\n   2.0000000e+00   2.0e+00\n", "#2", b' ', '.', 0, 1),
            ("1.5\n1.6\n", "#1", b',', '.', 0, 1),
            (",a,b\n0,1.5,\n1,,2.5\n", "b", b',', '.', 1, 2),
            ("t,a,b,comment,\n0,1.5,1\n1,1.5,2.5\n", "b", b',', '.', 1, 2),
            ("t,a,b,\n0,1.5,1\n1,1.5,2.5\n", "b", b',', '.', 1, 2),
            ("\"Time\",\"Y, ist\"\n\"0\",\"1.5\"\n\"1\",\"2.5\"\n", "Y, ist", b',', '.', 1, 2),
        ] {
            let found = of(sample);
            let shape = (found.separator, found.numbers.decimal, found.header_line, found.first_line);
            assert_eq!(shape, (separator, decimal, header, first), "{sample}");
            assert_eq!(found.names.last().map(String::as_str), Some(name), "{sample}");
        }
        let pairs = of("Y_SP,,Y.PV,\nTime,Value,Time,Value\n0,1,0,2\n1,1,1,2\n");
        assert_eq!(pairs.names, ["Time", "Y_SP", "Time", "Y.PV"]);
        let quoted = of("\"t\",\"a\"\n\"0,5\",\"6323,25\"\n\"1,5\",\"6324,75\"\n");
        assert_eq!((quoted.separator, quoted.numbers.decimal), (b',', ','));
        let three = of("TAG1;TAG2\nTank pressure;Position\nbar;mm\n63;1\n63;2\n");
        assert_eq!((three.names, three.units), (vec!["TAG1".into(), "TAG2".into()], vec!["bar".into(), "mm".into()]));
        let scaled = of("Time,cmd,servo,spool,p tank\n10 ms,%,%,%,0.1 bar\n0,1.5,1.5,1,632\n4,1,1,1,632\n");
        assert_eq!(
            (scaled.names[1].as_str(), scaled.units[0].as_str(), scaled.units[4].as_str()),
            ("cmd", "10 ms", "0.1 bar")
        );
        let groups = of("Regler;;Anlage\nt;u;p [bar]\n0;1;63\n1;1;63\n");
        assert_eq!((groups.names[1].as_str(), groups.units[2].as_str()), ("u", "bar"));
    }

    #[test]
    fn units_in_cells_are_those_of_their_columns() {
        let found = of("Time,Gate,Oil\n0.00 s,70.8 %,6.3 MPa\n0.04 s,-1e-3 %,6.3 MPa\n");
        assert_eq!((found.header_line, found.first_line), (1, 2));
        assert_eq!(found.units, ["s", "%", "MPa"]);
        let comma = of("Zeit;Y\n0,5 s;70,8 mm\n1,5 s;70,9 mm\n");
        assert_eq!((comma.numbers.decimal, comma.in_cells), (',', vec!["s".to_owned(), "mm".to_owned()]));
    }

    #[test]
    fn a_name_may_end_with_its_unit() {
        for (name, found) in [
            ("p_tank [bar]", Some(("p_tank", "bar"))),
            ("p kPa", Some(("p", "kPa"))),
            ("cmd %", Some(("cmd", "%"))),
            ("t / s", Some(("t", "s"))),
            ("Weg in mm", Some(("Weg", "mm"))),
            ("Y, %", Some(("Y", "%"))),
            ("p/bar", Some(("p", "bar"))),
            ("p tank [0.1 bar]", Some(("p tank", "0.1 bar"))),
            ("Ticks (0.1 ms)", Some(("Ticks", "0.1 ms"))),
            ("p / 10 kPa", Some(("p", "10 kPa"))),
            ("p 0.1 bar", Some(("p", "0.1 bar"))),
            ("t 10 ms", Some(("t", "10 ms"))),
            ("p 2 bar", Some(("p 2", "bar"))),
            ("p [bar x 10]", Some(("p", "bar x 10"))),
            ("Date/Time", None),
            ("gov/a", None),
            ("Y at", None),
            ("Oil pressure", None),
            ("%", None),
        ] {
            assert_eq!(bracketed(name), found, "{name}");
        }
    }

    #[test]
    fn groups_of_digits_are_seen_where_they_can_be_nothing_else() {
        assert_eq!(of("t;p\n0,5;6.323,0\n1,5;6.324,5\n").numbers.thousands, Some('.'));
        assert_eq!(of("t;p\n0.5;6,323\n1.5;6,324\n").numbers.thousands, None);
    }

    #[test]
    fn what_is_no_table_is_refused_in_words() {
        let refused = |sample: &str| sniff(sample, &FileMap::default()).unwrap_err();
        assert!(refused("").contains("no line with text"));
        let words = refused("Dear colleague,\nplease find attached\nthe data.\n");
        assert!(words.contains("expected lines of numbers") && words.contains("first_line"), "{words}");
    }
}
