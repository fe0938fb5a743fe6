//! The page of a proposed map: each signal as the map reads it, unused columns, and open questions.

use super::draw::svg;
use super::ink::Ink;
use super::page::{Page, PageBody, Tone};
use super::picture::{Mark, MarkShape, Panel, Picture};
use super::replay::thousands;
use super::table::Table;

/// Columns that are drawn although nothing was made of them.
const MOST_UNUSED: usize = 40;

/// One column, as a signal or as it is.
#[derive(Clone, Debug, PartialEq)]
pub struct Guess {
    /// The signal's name, or the column's.
    pub title: String,
    /// The column or field.
    pub column: String,
    /// The unit of the values drawn; empty where it is not known.
    pub unit: String,
    /// Why it was chosen; empty where it was not.
    pub why: String,
    /// Time in s from the beginning, least and greatest value there, in the unit.
    pub points: Vec<[f64; 3]>,
}

/// What was understood of a file.
#[derive(Clone, Debug, PartialEq)]
pub struct ImportView {
    /// The file's name.
    pub file: String,
    /// Rows, or messages.
    pub rows: u64,
    /// Signals that were found, along the chain.
    pub chosen: Vec<Guess>,
    /// Columns of which nothing was made.
    pub unused: Vec<Guess>,
    /// Which columns move which, by their courses alone; none where none does.
    pub pairs: Option<Table>,
    /// The origin that the file's folder states.
    pub origin: Option<String>,
    /// How the file was understood.
    pub notes: Vec<String>,
    /// What its reader must settle.
    pub open: Vec<String>,
    /// The map as text.
    pub map: String,
}

/// The page.
pub fn page(look: &ImportView) -> Page {
    let mut page = Page::new(format!("Proposed import of {}", look.file), format!("{} rows", thousands(look.rows)));
    let body = &mut page.body;
    body.answers(answers(look));
    if let Some(origin) = &look.origin {
        body.note(Tone::Plain, origin.clone());
    }
    for open in &look.open {
        body.note(Tone::Warning, open.clone());
    }
    body.heading("Signals as the proposed map reads them");
    if !look.chosen.is_empty() {
        let picture = picture("signals as the proposed map reads them", &look.chosen, Ink::Measured);
        body.figure(svg(&picture), "Minimum and maximum over time, in the units after the import.");
    }
    let mut table = Table::new().words("signal").words("column").words("reason");
    for guess in &look.chosen {
        table.row([guess.title.clone(), guess.column.clone(), guess.why.clone()]);
    }
    body.table(table, "Columns chosen for the signals, with the reason.");
    if let Some(pairs) = &look.pairs {
        body.table(
            pairs.clone(),
            "Columns that hang together by their courses alone, whatever they are called, the strongest first.",
        );
    }
    body.heading("Proposed map");
    body.file_text(look.map.trim_end());
    if !look.unused.is_empty() {
        body.heading("Unused columns");
        let drawn: Vec<Guess> =
            look.unused.iter().filter(|guess| !guess.points.is_empty()).take(MOST_UNUSED).cloned().collect();
        let mut inner = PageBody::new();
        if !drawn.is_empty() {
            inner.figure(svg(&picture("unused columns", &drawn, Ink::Muted)), "Values as in the file.");
        }
        let empty: Vec<&str> =
            look.unused.iter().filter(|guess| guess.points.is_empty()).map(|guess| guess.column.as_str()).collect();
        if !empty.is_empty() {
            inner.paragraph(format!("Without numeric values: {}.", empty.join(", ")));
        }
        let noun = if look.unused.len() == 1 { "column" } else { "columns" };
        body.details(format!("{} {noun}", look.unused.len()), inner);
    }
    body.heading("How the file was read");
    for note in &look.notes {
        body.paragraph(note.clone());
    }
    page
}

/// Findings, their certainty, how much of the file they cover, and what to do next.
fn answers(look: &ImportView) -> [(&'static str, Vec<String>); 4] {
    let names: Vec<String> = look.chosen.iter().map(|guess| format!("{} ({})", guess.title, guess.column)).collect();
    let total = look.chosen.len() + look.unused.len();
    let mut found = vec![format!("{} of {total} columns are used as signals.", look.chosen.len())];
    if !names.is_empty() {
        found.push(format!("{}.", names.join(", ")));
    }
    let open = look.open.len();
    let sure = match open {
        0 => "No question is open. The plot and the reasons below show whether each column is right.".to_owned(),
        1 => "One question is open (below). The reason for each column is given below the plot.".to_owned(),
        _ => format!("{open} questions are open (below). The reason for each column is given below the plot."),
    };
    let far = format!("{} rows were read; {} columns are not used.", thousands(look.rows), look.unused.len());
    let next = if look.chosen.is_empty() {
        "Complete the map by hand: `map.yaml` next to this page is a template."
    } else if open > 0 {
        "Answer the open questions in `map.yaml` next to this page, then import with it: `govtwin import FILE --map map.yaml`."
    } else {
        "Check the plot, then import with the map next to this page: `govtwin import FILE --map map.yaml`."
    };
    [("Result", found), ("How sure", vec![sure]), ("Coverage", vec![far]), ("What next", vec![next.to_owned()])]
}

fn picture(what: &str, guesses: &[Guess], ink: Ink) -> Picture {
    let panel = |guess: &Guess| {
        let largest = guess.points.iter().fold(0.0, |most: f64, point| most.max(point[2].abs()));
        // Nobody reads an axis of millions of pascals.
        let (scale, unit) =
            if guess.unit == "Pa" && largest >= 1e5 { (1e-6, "MPa") } else { (1.0, guess.unit.as_str()) };
        let points: Vec<[f64; 3]> =
            guess.points.iter().map(|[time_s, least, most]| [*time_s, scale * least, scale * most]).collect();
        let title = match (guess.title == guess.column, unit.is_empty()) {
            (true, true) => guess.column.clone(),
            (true, false) => format!("{}, {unit}", guess.column),
            (false, true) => format!("{} ({})", guess.title, guess.column),
            (false, false) => format!("{}, {unit} ({})", guess.title, guess.column),
        };
        let middle = points.iter().map(|[time_s, least, most]| [*time_s, 0.5 * (least + most)]).collect();
        let mut panel = Panel::new(title).height(90).x_name("time, s");
        let ends = points
            .iter()
            .fold([f64::INFINITY, f64::NEG_INFINITY], |ends, point| [ends[0].min(point[1]), ends[1].max(point[2])]);
        if ends[0] == ends[1] {
            // A constant signal needs a scale of its own size.
            let around = 0.5 * ends[0].abs().max(1.0);
            panel = panel.y_range(ends[0] - around, ends[1] + around);
        }
        panel.marks.push(Mark::new(MarkShape::Band(points), ink, ""));
        panel.marks.push(Mark::new(MarkShape::Line(middle), ink, ""));
        panel
    };
    Picture::stacked(what, guesses.iter().map(panel).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_page_shows_signals_reasons_map_and_what_is_open() {
        let guess = |title: &str, why: &str| Guess {
            title: title.into(),
            column: "Y_ist".into(),
            unit: "pu".into(),
            why: why.into(),
            points: vec![[0.0, 0.1, 0.2], [1.0, 0.2, 0.3]],
        };
        let mut pairs = Table::new().words("column").words("what it does");
        pairs.row(["Y_ist", "sums up"]);
        let look = ImportView {
            file: "a.csv".into(),
            rows: 2,
            chosen: vec![guess("Servomotor position", "its name")],
            unused: vec![guess("x", "")],
            pairs: Some(pairs),
            origin: Some("Synthetic data: made up.".into()),
            notes: vec!["read as it is".into()],
            open: vec!["range: yours".into()],
            map: "signals:\n  esv: normal\n".into(),
        };
        let html = page(&look).to_html();
        for words in [
            "Servomotor position, pu (Y_ist)",
            "its name",
            "sums up",
            "Synthetic data: made up.",
            "range: yours",
            "Answer the open questions in",
            "esv:",
            "1 column<",
            "read as it is",
            "<svg",
        ] {
            assert!(html.contains(words), "{words}");
        }
    }
}
