//! The zone of local times, by what the map says, a header, or a column of its own.

use super::head::TableHead;
use super::records::{SAMPLED, TableRecords};
use super::timing::{TimeGroup, time_text};
use crate::import::ImportError;
use crate::import::clock::{is_zone, zone_of_header};
use crate::import::dialect::bracketed;
use crate::import::map::Map;
use crate::import::words::Words;

/// Names of columns that hold the zone of the times beside them, in lower case, letters alone.
const NAMES: Words = Words(
    "zone|timezone|tz|utcoffset|gmtoffset|tzoffset|zoneoffset|zeitzone|fuseau|fuseauhoraire|zonahoraria|fusoorario|fusohorario|tidssone|tidszon|часовойпояс|\
     时区",
);

/// A place that states the zone of times.
pub(super) enum StatedZone {
    /// The map.
    Map(String),
    /// The header of a column of times.
    Header(usize, String),
    /// A column of zones.
    Column(usize),
}

impl StatedZone {
    /// The zone of all times; none where each has its own.
    pub(super) fn of_all(&self) -> Option<String> {
        match self {
            Self::Map(zone) | Self::Header(_, zone) => Some(zone.clone()),
            Self::Column(_) => None,
        }
    }

    /// The column of the zones, where each time has its own.
    pub(super) fn column(&self) -> Option<usize> {
        if let Self::Column(column) = self { Some(*column) } else { None }
    }

    /// The place and the zone of a record, in words.
    fn words<R: TableRecords>(&self, head: &TableHead, records: &R) -> String {
        match self {
            Self::Map(zone) => format!("the map says `{zone}`"),
            Self::Header(column, zone) => format!("the header `{}` says `{zone}`", head.names[*column]),
            Self::Column(column) => {
                format!("column `{}` says `{}`", head.names[*column], time_text(records, &[*column], None))
            }
        }
    }
}

/// The places that state the zone of times, of which the first counts, and what to ask of a column that may be another; `probe` reads times without any.
pub(super) fn stated<R: TableRecords>(
    head: &TableHead,
    map: &Map,
    mut probe: TimeGroup,
    open: &impl Fn() -> Result<R, ImportError>,
) -> Result<(Vec<StatedZone>, Option<String>), ImportError> {
    let of_header = |column: &usize| Some(StatedZone::Header(*column, zone_of_header(&head.names[*column])?));
    let of_map = map.time.zone.clone().map(StatedZone::Map);
    let mut found: Vec<StatedZone> = of_map.into_iter().chain(probe.columns.iter().find_map(of_header)).collect();
    let letters = |name: &str| -> String {
        let bare = bracketed(name).map_or(name, |(bare, _)| bare);
        bare.to_lowercase().chars().filter(|letter| letter.is_alphabetic()).collect()
    };
    let named = |column: &usize| !probe.columns.contains(column) && NAMES.has(&letters(&head.names[*column]));
    let Some(column) = (0..head.names.len()).find(named) else { return Ok((found, None)) };
    let mut records = open()?;
    let (mut count, mut zones, mut other) = (0, 0, None);
    while count < SAMPLED && records.advance()? {
        count += 1;
        let _ = probe.read(&records);
        let cell = time_text(&records, &[column], None);
        if is_zone(&cell) {
            zones += 1;
        } else {
            other = other.or(Some(cell));
        }
    }
    // Times that count from a fixed moment, or have their zone behind them, are in none.
    if !probe.clock.used_zone {
        return Ok((found, None));
    }
    if zones * 10 >= count * 9 {
        found.push(StatedZone::Column(column));
        return Ok((found, None));
    }
    let unclear = other.filter(|_| found.is_empty()).map(|cell| {
        format!(
            "time: column `{}` may hold the zone of the times, and says `{cell}`, which means several, or none that is known; say which with \
             `time: {{zone: …}}` in the map",
            head.names[column]
        )
    });
    Ok((found, unclear))
}

/// What to say of two places that state different zones, of which the first counts.
pub(super) fn conflict<R: TableRecords>(
    head: &TableHead,
    (used, used_zone): (&TimeGroup, &StatedZone),
    (other, other_zone): (&TimeGroup, &StatedZone),
    open: &impl Fn() -> Result<R, ImportError>,
) -> Result<Option<String>, ImportError> {
    let (mut used, mut other) = (used.clone(), other.clone());
    let mut records = open()?;
    let mut count = 0;
    while count < SAMPLED && records.advance()? {
        count += 1;
        let (Some(Ok(time_ns)), Some(Ok(other_ns))) = (used.read(&records), other.read(&records)) else { continue };
        if time_ns != other_ns {
            let [used, other] = [used_zone, other_zone].map(|zone| zone.words(head, &records));
            return Ok(Some(format!(
                "time: {used} of the zone, and {other}; the former counts; state the right one with `time: {{zone: …}}` in the map"
            )));
        }
    }
    Ok(None)
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::import::{Import, ImportOutcome};

    /// The time of the first row of a table, s since 1970, and what there is to say.
    fn first(header: &str, row: &str, zone: &str) -> (i64, ImportOutcome) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("t.csv");
        let next = row.replace(":00:00", ":00:01");
        std::fs::write(&path, format!("{header};Y\n{row};0.5\n{next};0.5\n")).unwrap();
        let zone = if zone.is_empty() { String::new() } else { format!("time: {{zone: \"{zone}\"}}\n") };
        let map = Map::parse(&format!("{zone}signals: {{servomotor_position: Y}}\n"), Path::new("m.yaml")).unwrap();
        let (mut times_ns, import) = (vec![], Import::open(&[path], &map).unwrap());
        let mut keep = |row: &crate::import::ImportedRow| {
            times_ns.push(row.time_ns);
            Ok::<(), ImportError>(())
        };
        let outcome = import.run(&mut keep, &mut |_| ()).unwrap();
        (times_ns[0] / 1_000_000_000, outcome)
    }

    #[test]
    fn the_zone_is_that_of_map_header_or_column_and_a_conflict_is_named() {
        const NOON: i64 = 1_790_078_400; // 2026-09-22T12:00:00Z
        for (header, row, zone, offset_s, words) in [
            ("Date;Time;Zone", "22.09.2026;14:00:00;+02:00", "", 7200, ""),
            ("Date;Time;TZ", "22.09.2026;14:00:00;CEST", "", 7200, ""),
            ("Time;Time zone", "2026-09-22 14:00:00;Europe/Zurich", "", 7200, ""),
            ("Zone;Time", "UTC-0330;2026-09-22 14:00:00", "", -12_600, ""),
            // Times in no zone need none.
            ("Time;Zone", "2026-09-22T14:00:00Z;CEST", "", 0, ""),
            ("Time;Zone", "1790085600;CEST", "", 0, ""),
            ("Time;Zone", "2026-09-22T14:00:00Z;IST", "", 0, ""),
            (
                "Time;Zone",
                "2026-09-22 14:00:00;IST",
                "",
                0,
                "column `Zone` may hold the zone of the times, and says `IST`",
            ),
            ("Time;Zone", "2026-09-22 14:00:00;IST", "Asia/Kolkata", 19_800, ""),
            ("Time (UTC+0200)", "2026-09-22 14:00:00", "", 7200, ""),
            ("Time (UTC+0200)", "2026-09-22 14:00:00", "Europe/Zurich", 7200, ""),
            ("Time (UTC+0200);Zone", "2026-09-22 14:00:00;CEST", "UTC+2", 7200, ""),
            (
                "Time (UTC)",
                "2026-09-22 14:00:00",
                "+01:00",
                3600,
                "the map says `+01:00` of the zone, and the header `Time (UTC)` says `UTC`",
            ),
            (
                "Time;Zone",
                "2026-09-22 14:00:00;CEST",
                "UTC",
                0,
                "the map says `UTC` of the zone, and column `Zone` says `CEST`",
            ),
            (
                "Time (UTC);Zone",
                "2026-09-22 14:00:00;CEST",
                "",
                0,
                "the header `Time (UTC)` says `UTC` of the zone, and column `Zone` says `CEST`",
            ),
        ] {
            let (time_s, outcome) = first(header, row, zone);
            assert_eq!(time_s, NOON + 7200 - offset_s, "{header} {row} {zone}");
            let said: Vec<&String> = outcome.warnings.iter().filter(|one| one.contains("zone")).collect();
            assert!(said.is_empty() == words.is_empty(), "{header} {row} {zone}: {said:?}");
            assert!(words.is_empty() || said.iter().any(|one| one.contains(words)), "{header} {row} {zone}: {said:?}");
        }
    }
}
