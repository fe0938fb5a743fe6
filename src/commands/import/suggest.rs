//! `govtwin import --suggest`: the proposed map, its reasons, and the page that shows what was understood.

use std::path::Path;

use anyhow::Context as _;
use govtwin_bag::import::suggest::{Known, RelatedPair, SuggestedColumn, Suggestion, suggest};
use govtwin_bag::import::{SignalMap, Target, map_text};
use govtwin_files::{Place, place_of, read_text};
use govtwin_model::number::significant;
use govtwin_model::units::seconds_from_nanos;
use govtwin_pages::import::{Guess, ImportView, page};
use govtwin_pages::table::Table;
use serde_json::json;

use super::progress;
use crate::commands::Outcome;
use crate::commands::output::{Output, one_line, print, table_text, warn_all};
use crate::commands::replay::origin;

/// The map.
const MAP: &str = "map.yaml";
/// The page.
const PAGE: &str = "suggestion.html";
/// A larger file is none that was proposed here.
const LARGEST_MAP_BYTES: u64 = 1 << 20;

/// Looks through a file, writes map and page, and prints what was chosen and why.
pub fn run(file: &Path, known: &Known, out: &Path, as_json: bool) -> anyhow::Result<Outcome> {
    let mut output = Output::claim(out, &[MAP, PAGE])?;
    let progress = progress();
    let suggestion = suggest(file, known, &mut |share| progress.at(share, "read"))?;
    drop(progress);
    if suggestion.map.signals.iter().all(|signal| signal.place().is_none()) {
        let names: Vec<String> =
            suggestion.columns.iter().take(20).map(|column| format!("`{}`", column.name)).collect();
        let more = suggestion.columns.len().saturating_sub(names.len());
        let more = if more > 0 { format!(" and {more} more") } else { String::new() };
        let unread: Vec<&str> =
            suggestion.open.iter().filter(|open| open.contains("cells are no numbers")).map(String::as_str).collect();
        let why = if unread.is_empty() { String::new() } else { format!(": {}", unread.join("; ")) };
        anyhow::bail!(
            "{}: nothing in it looks like a signal of a servo system; its columns are {}{more}{why}; write a map by hand (docs/import.md)",
            file.display(),
            names.join(", ")
        );
    }
    let text = text(file, &suggestion);
    let there = output.path(MAP);
    let older = place_of(&there).with_context(|| format!("--out: cannot look at {}", there.display()))?;
    let reading = || format!("--out: cannot read {}", there.display());
    // One that cannot be read may have been settled by hand, too.
    if older == Place::Ours && read_text(&there, LARGEST_MAP_BYTES).with_context(reading)? != text {
        anyhow::bail!(
            "--out: {}: another map is there, which may have been settled by hand; name another folder, or move it away",
            there.display()
        );
    }
    let look = look(file, &suggestion, &text);
    output.add(MAP, text.as_bytes())?;
    output.add(PAGE, page(&look).to_html().as_bytes())?;
    let [map_path, page_path] = [MAP, PAGE].map(|name| output.path(name));
    output.place()?;
    if as_json {
        print(&format!("{:#}\n", figures(&suggestion)))?;
    } else {
        for note in &suggestion.notes {
            print(&format!("{}\n", one_line(note)))?;
        }
        print(&table_text(&table(&suggestion)))?;
        if !suggestion.pairs.is_empty() {
            print(&format!("By their courses alone:\n{}", table_text(&pairs(&suggestion))))?;
        }
        let (file, map) = (file.display(), map_path.display());
        let is = |target: Target| suggestion.map.signals.iter().any(|signal| signal.target == target);
        // Without a tank pressure the chain before the stage cannot be judged.
        let stage = if is(Target::OpeningCommand) && !is(Target::TankPressure) { " --stage-alone" } else { "" };
        print(&format!(
            "Map: {map}\nPage: {}\nNext, once all open questions are answered: govtwin import {file} --map {map} --out BAG, or \
             govtwin diagnose {file} --map {map}{stage}\n",
            page_path.display(),
        ))?;
    }
    warn_all(&suggestion.open);
    Ok(if suggestion.open.is_empty() { Outcome::Ok } else { Outcome::Warnings })
}

fn text(file: &Path, suggestion: &Suggestion) -> String {
    let name = file.file_name().unwrap_or(file.as_os_str()).to_string_lossy();
    let mut head =
        vec![one_line(&format!("Proposed by govtwin {} import --suggest for {name}.", env!("CARGO_PKG_VERSION")))];
    if !suggestion.open.is_empty() {
        head.push("Open, and yours to settle:".to_owned());
        head.extend(suggestion.open.iter().map(|open| format!("- {}", one_line(open))));
    }
    let why = |signal: &SignalMap| {
        let reasons = suggestion.reasons.iter();
        reasons
            .filter(|reason| reason.target == signal.target)
            .map(|reason| reason.why.clone())
            .collect::<Vec<_>>()
            .join("; ")
    };
    map_text(&suggestion.map, &head, why)
}

fn place(suggestion: &Suggestion, column: Option<usize>) -> String {
    column
        .and_then(|column| suggestion.columns.get(column))
        .map_or_else(|| "–".to_owned(), |column| one_line(&column.name))
}

fn table(suggestion: &Suggestion) -> Table {
    let mut table = Table::new().words("signal").words("from").words("unit").words("because of");
    for (reason, signal) in suggestion.reasons.iter().zip(&suggestion.map.signals) {
        let unit = signal.unit.clone();
        table.row([reason.target.id().to_owned(), place(suggestion, reason.column), unit, reason.why.clone()]);
    }
    table
}

/// Which columns move which, whatever they are called.
fn pairs(suggestion: &Suggestion) -> Table {
    let mut table = Table::new()
        .words("column")
        .words("what it does")
        .words("to")
        .numbers("correlation")
        .numbers("time constant, s");
    for RelatedPair { position, other, what, correlation, settles_s } in &suggestion.pairs {
        let [position, other] = [position, other].map(|column| place(suggestion, Some(*column)));
        let settles = settles_s.map_or_else(|| "–".to_owned(), |settles_s| significant(settles_s, 3));
        table.row([position, (*what).to_owned(), other, format!("{correlation:.3}"), settles]);
    }
    table
}

/// What the page shows.
fn look(file: &Path, suggestion: &Suggestion, text: &str) -> ImportView {
    let begin_ns = suggestion
        .columns
        .iter()
        .filter_map(|column| column.envelope.points().next())
        .map(|(time_ns, _)| time_ns)
        .min();
    let guess = |column: &SuggestedColumn, title: String, why: String, signal: Option<&SignalMap>| {
        let convert = |value: f64| signal.map_or(value, |signal| signal.conversion.apply(value));
        let points = column.envelope.points().map(|(time_ns, bucket)| {
            let (one, other) = (convert(bucket.least), convert(bucket.most));
            [seconds_from_nanos(time_ns - begin_ns.unwrap_or(0)), one.min(other), one.max(other)]
        });
        let unit = signal.map_or(column.unit.as_str(), |signal| signal.target.unit());
        Guess { title, column: column.name.clone(), unit: unit.to_owned(), why, points: points.collect() }
    };
    let chosen = suggestion.reasons.iter().zip(&suggestion.map.signals).filter_map(|(reason, signal)| {
        let column = suggestion.columns.get(reason.column?)?;
        // States have no conversion; what is drawn is what the file holds.
        Some(guess(column, reason.target.title().to_owned(), reason.why.clone(), Some(signal)))
    });
    let used = |index: usize| suggestion.reasons.iter().any(|reason| reason.column == Some(index));
    let unused = suggestion.columns.iter().enumerate().filter(|(index, _)| !used(*index));
    let unused = unused.map(|(_, column)| guess(column, column.name.clone(), String::new(), None));
    ImportView {
        file: file.file_name().unwrap_or(file.as_os_str()).to_string_lossy().into_owned(),
        rows: suggestion.rows,
        chosen: chosen.collect(),
        unused: unused.collect(),
        pairs: if suggestion.pairs.is_empty() { None } else { Some(pairs(suggestion)) },
        origin: origin::of(file),
        notes: suggestion.notes.clone(),
        open: suggestion.open.clone(),
        map: text.to_owned(),
    }
}

fn figures(suggestion: &Suggestion) -> serde_json::Value {
    let reasons = suggestion.reasons.iter().map(|reason| {
        let column = reason.column.and_then(|column| suggestion.columns.get(column)).map(|column| column.name.clone());
        json!({"signal": reason.target.id(), "from": column, "evidence": reason.score, "because_of": reason.why})
    });
    let columns = suggestion.columns.iter().map(|column| {
        let [least, most] = column.range.ends();
        json!({"name": column.name, "unit": column.unit, "numbers": column.range.count, "texts": column.texts, "least": least, "most": most})
    });
    let pairs = suggestion.pairs.iter().map(|pair| {
        let [position, other] = [pair.position, pair.other].map(|column| &suggestion.columns[column].name);
        json!({"position": position, "what": pair.what, "other": other, "correlation": pair.correlation, "time_constant_s": pair.settles_s})
    });
    json!({
        "rows": suggestion.rows,
        "signals": reasons.collect::<Vec<_>>(),
        "columns": columns.collect::<Vec<_>>(),
        "pairs": pairs.collect::<Vec<_>>(),
        "notes": suggestion.notes,
        "open": suggestion.open,
    })
}
