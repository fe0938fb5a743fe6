//! The units table: units, the folders of their recordings, and the sheet of each.

use std::collections::BTreeMap;
use std::fmt;

/// A row of the table.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct UnitRow {
    /// Its line in the file.
    pub line: u64,
    /// The unit's name.
    pub unit: String,
    /// The folder of its recordings below the source, without slashes at its ends; empty for the whole source.
    pub folder: String,
    /// Its data sheet, as written; empty for the shipped unit.
    pub sheet: String,
    /// Its import map, as written; empty where recordings are bags of this project.
    pub map: String,
    /// Effects that it is diagnosed without.
    pub without: Vec<String>,
}

/// What the columns are called.
pub const COLUMNS: [&str; 5] = ["unit", "folder", "sheet", "map", "without"];

/// All that is wrong with a table, one a line.
#[derive(Debug, PartialEq, Eq, thiserror::Error)]
pub struct UnitsError(pub Vec<String>);

impl fmt::Display for UnitsError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.0.join("\n  "))
    }
}

/// Reads a table; `nearest` finds what an unknown word may have been meant to be.
///
/// # Errors
/// With all that is wrong, each with its line.
pub fn read(text: &str, nearest: impl Fn(&str, &[&str]) -> Option<String>) -> Result<Vec<UnitRow>, UnitsError> {
    let mut reader = csv::ReaderBuilder::new()
        .trim(csv::Trim::All)
        .comment(Some(b'#'))
        .from_reader(text.trim_start_matches('\u{feff}').as_bytes());
    let head = reader.headers().map_err(|error| UnitsError(vec![error.to_string()]))?.clone();
    let mut wrong = Vec::new();
    for (place, name) in head.iter().enumerate() {
        if !COLUMNS.contains(&name) {
            let near = nearest(name, &COLUMNS).map(|near| format!("; did you mean `{near}`?")).unwrap_or_default();
            wrong.push(format!("line 1: unknown column `{name}`; expected {}{near}", COLUMNS.join(", ")));
        } else if head.iter().take(place).any(|before| before == name) {
            wrong.push(format!("line 1: the column `{name}` stands there twice"));
        }
    }
    if !head.iter().any(|name| name == "unit") {
        wrong.push("line 1: expected a column `unit` with the names of the units, found none".to_owned());
    }
    if !wrong.is_empty() {
        return Err(UnitsError(wrong));
    }
    let mut rows = Vec::new();
    for record in reader.records() {
        let record = match record {
            Ok(record) => record,
            Err(error) => {
                wrong.push(error.to_string());
                continue;
            }
        };
        let line = record.position().map_or(0, csv::Position::line);
        let cell = |name: &str| {
            head.iter().position(|column| column == name).and_then(|at| record.get(at)).unwrap_or_default()
        };
        let unit = cell("unit").to_owned();
        if let Some(trouble) = name_trouble(&unit) {
            wrong.push(format!("line {line}: {trouble}"));
            continue;
        }
        let folder = if head.iter().any(|name| name == "folder") { cell("folder") } else { &unit };
        rows.push(UnitRow {
            line,
            folder: folder.trim_matches('/').trim_start_matches("./").to_owned(),
            sheet: cell("sheet").to_owned(),
            map: cell("map").to_owned(),
            without: cell("without").split([' ', ';']).filter(|id| !id.is_empty()).map(str::to_owned).collect(),
            unit,
        });
    }
    wrong.extend(doubles(&rows));
    if rows.is_empty() && wrong.is_empty() {
        wrong.push("expected a line for each unit below the head, found none".to_owned());
    }
    if wrong.is_empty() { Ok(rows) } else { Err(UnitsError(wrong)) }
}

fn name_trouble(unit: &str) -> Option<String> {
    if unit.is_empty() {
        return Some("expected the name of a unit in the column `unit`, found nothing".to_owned());
    }
    let control = unit.chars().any(char::is_control);
    control.then(|| "the name of the unit holds control characters; expected letters, digits and spaces".to_owned())
}

/// Units that stand there twice, and folders that hold recordings of two units.
fn doubles(rows: &[UnitRow]) -> Vec<String> {
    let mut wrong = Vec::new();
    let mut units: BTreeMap<&str, u64> = BTreeMap::new();
    for row in rows {
        if let Some(first) = units.insert(&row.unit, row.line) {
            wrong.push(format!("line {}: the unit `{}` stands there already, on line {first}", row.line, row.unit));
        }
    }
    let mut folders: BTreeMap<&str, &UnitRow> = BTreeMap::new();
    for row in rows {
        if let Some(first) = folders.insert(&row.folder, row) {
            wrong.push(format!(
                "line {}: the folder `{}` is that of the unit `{}` on line {}; recordings in it would be of two units: expected a folder for each",
                row.line, row.folder, first.unit, first.line
            ));
        }
    }
    for row in rows {
        // The folders above it, the outermost first.
        let above = row.folder.match_indices('/').map(|(at, _)| &row.folder[..at]);
        let mut above = [""].into_iter().chain(above).filter(|folder| *folder != row.folder);
        if let Some(outer) = above.find_map(|folder| folders.get(folder)) {
            wrong.push(format!(
                "line {}: the folder `{}` lies in `{}`, that of the unit `{}` on line {}; recordings in it would be of two units: expected folders \
                 beside each other",
                row.line, row.folder, outer.folder, outer.unit, outer.line
            ));
        }
    }
    wrong
}

#[cfg(test)]
mod tests {
    use super::*;

    fn wrong(text: &str) -> Vec<String> {
        let nearest = |word: &str, known: &[&str]| {
            known.iter().find(|one| one.starts_with(&word[..1])).map(|one| (*one).to_owned())
        };
        read(text, nearest).unwrap_err().0
    }

    #[test]
    fn a_table_is_read_with_comments_and_defaults() {
        let rows = read("# plant 3\nunit, sheet\n U1 , a.yaml\nU2,\n", |_, _| None).unwrap();
        assert_eq!(
            rows[0],
            UnitRow { line: 3, unit: "U1".into(), folder: "U1".into(), sheet: "a.yaml".into(), ..UnitRow::default() }
        );
        assert_eq!((rows[1].line, rows[1].sheet.as_str()), (4, ""));
        let rows = read("unit,folder,without\nU1,/plant/u 1/,backlash; load\n", |_, _| None).unwrap();
        assert_eq!(
            (rows[0].folder.as_str(), rows[0].without.as_slice()),
            ("plant/u 1", ["backlash".to_owned(), "load".to_owned()].as_slice())
        );
    }

    #[test]
    fn all_that_is_wrong_is_named_with_its_line() {
        let found = wrong("unit,shet,sheet,sheet\n");
        assert!(
            found[0].contains("line 1: unknown column `shet`") && found[0].contains("did you mean `sheet`?"),
            "{found:?}"
        );
        assert!(found[1].contains("`sheet` stands there twice"), "{found:?}");
        assert!(wrong("folder\na\n")[0].contains("expected a column `unit`"));
        let found = wrong("unit,folder\nA,a\nB,b\nA,c\n,d\nC,b\nD,a/deep\n");
        assert_eq!(found.len(), 4, "{found:?}");
        assert!(found[0].contains("line 5: expected the name of a unit"));
        assert!(found[1].contains("line 4: the unit `A` stands there already, on line 2"));
        assert!(found[2].contains("line 6: the folder `b` is that of the unit `B` on line 3"));
        assert!(found[3].contains("line 7: the folder `a/deep` lies in `a`, that of the unit `A`"));
        assert!(wrong("unit\n")[0].contains("expected a line for each unit"));
        assert!(wrong("unit,sheet\nA\n")[0].contains("line"), "a short row names its line");
    }
}
