//! Tables that hold more than one recording: of several machines, or under several headers.

use super::super::machine::MachineLook;
use super::super::records::TableRecords;
use super::TableSource;
use crate::import::ImportError;
use crate::import::map::{Map, SignalMap};

/// What a record says that is a header again, where that is of other columns than the first; none of another record.
pub(super) fn other_header<R: TableRecords>(records: &R, names: &[String], time: Option<&usize>) -> Option<String> {
    let time = *time?;
    let cell = |column: usize| records.text_of(column).map(str::trim);
    if cell(time)? != names.get(time)?.trim() {
        return None;
    }
    let (column, name) = names.iter().enumerate().find(|(column, name)| cell(*column) != Some(name.trim()))?;
    let found = cell(column).unwrap_or_default();
    Some(format!(
        "a second header names column {} `{found}`, the first `{name}`; split the file there and import each part by a map of its own",
        column + 1
    ))
}

/// Rows of several machines are none of one recording.
pub(super) fn one_machine<R: TableRecords>(
    table: &TableSource<R>,
    map: &Map,
    records: &mut R,
) -> Result<(), ImportError> {
    let mapped =
        map.signals.iter().filter_map(SignalMap::place).filter_map(|name| table.head.find(name).ok().flatten());
    let long = table.long.as_ref().map(|long| [long.tag, long.value]);
    let taken: Vec<usize> =
        table.times[0].columns.iter().copied().chain(mapped).chain(long.into_iter().flatten()).collect();
    let mut looks: Vec<_> =
        table.head.machine_columns(&taken).into_iter().map(|column| (column, MachineLook::default())).collect();
    while !looks.is_empty() && records.advance()? {
        for ((column, _), machines) in &mut looks {
            machines.take(records.tag(*column).as_deref().unwrap_or_default());
        }
    }
    for ((column, is_machine), machines) in looks {
        let (wide, name) = (table.long.is_none(), &table.head.names[column]);
        let problem = match if is_machine { machines.several() } else { machines.several_with_letters() } {
            Some(found) => format!(
                "holds rows of several machines: column `{name}` says {found}; import those of one alone, and export the others as files of their own"
            ),
            None => match machines.by_turns().filter(|_| wide) {
                Some(found) => format!(
                    "may hold rows of several machines: column `{name}` says {found} by turns; export each as a file of its own, or leave the column out \
                     where it says something else"
                ),
                None => continue,
            },
        };
        return Err(ImportError::file(&table.head.path, problem));
    }
    Ok(())
}
