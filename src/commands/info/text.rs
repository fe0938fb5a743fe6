//! The table that `govtwin info` prints.

use govtwin_bag::{FileHealth, TopicSurvey};
use govtwin_model::number::{fixed, significant};
use govtwin_model::units::seconds_from_nanos;
use govtwin_pages::table::Table;

use super::BagEntry;
use crate::commands::output::{one_line, table_text};

/// All that is said of one bag.
pub(super) fn entry(entry: &BagEntry) -> String {
    let mut lines = vec![entry.path.display().to_string()];
    lines.extend(entry.survey.files.iter().map(|file| format!("  file       {}", self::file(file, entry))));
    lines.push(format!("  time       {}", time(entry)));
    lines.push(format!("  messages   {} on {} topics", entry.survey.messages, entry.survey.topics.len()));
    let recording = match (&entry.recording, &entry.no_recording) {
        (Some(recording), _) => {
            format!("{}, {} rows, {} s", recording.title, recording.rows, fixed(recording.duration_s, 1))
        }
        (None, Some(reason)) => format!("not of the whole servo system: {reason}"),
        (None, None) => "not of the servo system".into(),
    };
    lines.push(format!("  recording  {recording}"));
    lines.extend(entry.warnings_in_words.iter().map(|warning| format!("  warning    {warning}")));
    lines.extend(entry.notes_in_words.iter().map(|note| format!("  note       {note}")));
    let lines: Vec<String> = lines.iter().map(|line| one_line(line)).collect();
    format!("{}\n\n{}", lines.join("\n"), table_text(&topics(&entry.survey.topics)))
}

fn file(file: &FileHealth, entry: &BagEntry) -> String {
    let mut parts = vec![size(file.bytes)];
    if !file.library.is_empty() {
        parts.push(format!("written by {}", file.library));
    }
    if file.chunks > 0 {
        let names: Vec<&str> =
            file.compressions.iter().map(|name| if name.is_empty() { "uncompressed" } else { name }).collect();
        let ratio = significant(file.uncompressed_bytes as f64 / file.bytes.max(1) as f64, 2);
        let plural = if file.chunks == 1 { "" } else { "s" };
        parts.push(format!("{} chunk{plural}, {} ({ratio}:1)", file.chunks, names.join(" and ")));
    }
    match file.packed {
        "file" => parts.push("compressed as a whole with zstd".into()),
        "message" => parts.push("messages compressed one by one with zstd".into()),
        _ => {}
    }
    if file.storage == "mcap" {
        parts.push(if file.indexed { "indexed" } else { "no index" }.into());
        if !file.finished {
            parts.push("not finished".into());
        }
    }
    let name = if entry.survey.files.len() > 1 || entry.path.is_dir() {
        format!("{}: ", file.path.file_name().unwrap_or_default().to_string_lossy())
    } else {
        String::new()
    };
    format!("{name}{}, {}", file.storage, parts.join(", "))
}

fn time(entry: &BagEntry) -> String {
    match (entry.survey.first_ns, entry.survey.last_ns) {
        (Some(first_ns), Some(last_ns)) => {
            let duration_s = seconds_from_nanos(last_ns.saturating_sub(first_ns));
            format!("{} to {} ({} s)", utc(first_ns), utc(last_ns), fixed(duration_s, 3))
        }
        _ => "no message".into(),
    }
}

fn topics(topics: &[TopicSurvey]) -> Table {
    let mut table = Table::new().words("topic").words("type").numbers("messages").numbers("rate Hz");
    table = table.numbers("jitter ms").numbers_of("gaps", "count").numbers_of("gaps", "longest s").numbers("late");
    table = table.numbers("delay ms").numbers("NaN").numbers("inf");
    for topic in topics {
        let pace = topic.stamps.as_ref().unwrap_or(&topic.log);
        let mark = if topic.stamps.is_some() { "" } else { "*" };
        let delay = topic.delay_s.map_or_else(
            || "–".into(),
            |delay| {
                let ms = |seconds_s: f64| significant(seconds_s * 1e3, 3);
                format!("{} ({} … {})", ms(delay.median), ms(delay.least), ms(delay.most))
            },
        );
        let several = topic.messages > 1;
        let number = |there: bool, text: String| if there { text } else { "–".into() };
        table.row([
            topic.name.clone(),
            if topic.type_name.is_empty() { "?".into() } else { topic.type_name.clone() },
            topic.messages.to_string(),
            number(several, format!("{mark}{}", significant(pace.rate_hz, 4))),
            number(several, significant(pace.jitter_s * 1e3, 2)),
            number(several, pace.gaps.to_string()),
            number(several, significant(pace.longest_gap_s, 4)),
            number(several, pace.backwards.to_string()),
            delay,
            number(topic.readable, topic.nan.to_string()),
            number(topic.readable, topic.infinite.to_string()),
        ]);
    }
    table
}

fn size(bytes: u64) -> String {
    match bytes {
        0..10_000 => format!("{bytes} B"),
        10_000..10_000_000 => format!("{} kB", bytes / 1000),
        _ => format!("{} MB", bytes / 1_000_000),
    }
}

/// A time as `2026-05-28 21:33:20.000`, UTC.
fn utc(time_ns: i64) -> String {
    // Every number of nanoseconds of 64 bits is a time that the calendar knows.
    let time = jiff::Timestamp::from_nanosecond(time_ns.into()).unwrap_or_default();
    time.strftime("%Y-%m-%d %H:%M:%S%.3f").to_string()
}

#[cfg(test)]
mod tests {
    use super::{size, utc};

    #[test]
    fn times_read_as_dates() {
        assert_eq!(utc(1_780_004_000_150_000_000), "2026-05-28 21:33:20.150");
        assert_eq!(utc(0), "1970-01-01 00:00:00.000");
        assert_eq!(utc(-1_000_000), "1969-12-31 23:59:59.999");
        assert_eq!(utc(11_016 * 86_400_000_000_000), "2000-02-29 00:00:00.000");
        assert_eq!(utc(i64::MAX), "2262-04-11 23:47:16.854");
    }

    #[test]
    fn sizes_have_a_unit() {
        assert_eq!([size(812), size(121_174), size(24_000_000)], ["812 B", "121 kB", "24 MB"]);
    }
}
