//! The page of a proposed map: what each signal would look like, what was left aside, and what is open.

use super::draw::{DrawError, svg};
use super::ink::Ink;
use super::page::{Page, PageBody, Tone};
use super::picture::{Mark, MarkShape, Panel, Picture};
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
    /// How the file was understood.
    pub notes: Vec<String>,
    /// What its reader must settle.
    pub open: Vec<String>,
    /// The map as text.
    pub map: String,
}

/// The page.
///
/// # Errors
/// Where a picture cannot be drawn.
pub fn page(look: &ImportView) -> Result<Page, DrawError> {
    let mut page = Page::new(format!("What {} holds", look.file), format!("{} rows", look.rows));
    let body = &mut page.body;
    body.lead(format!(
        "{} of {} columns were taken for signals.",
        look.chosen.len(),
        look.chosen.len() + look.unused.len()
    ));
    for open in &look.open {
        body.note(Tone::Warning, open.clone());
    }
    body.heading("Signals as the map would read them");
    if !look.chosen.is_empty() {
        let picture = picture("signals as the map would read them", &look.chosen, Ink::Measured);
        body.figure(svg(&picture)?, "Least and greatest value over time, in the units after the import.");
    }
    let mut table = Table::new().words("signal").words("column").words("because of");
    for guess in &look.chosen {
        table.row([guess.title.clone(), guess.column.clone(), guess.why.clone()]);
    }
    body.table(table, "Why these columns");
    body.heading("The map");
    // A table of one column keeps lines apart, whatever they hold.
    let mut lines = Table::new().words("map.yaml");
    for line in look.map.lines() {
        lines.row([line.replace(' ', "\u{a0}")]);
    }
    body.table(lines, "");
    if !look.unused.is_empty() {
        body.heading("Columns left aside");
        let drawn: Vec<Guess> =
            look.unused.iter().filter(|guess| !guess.points.is_empty()).take(MOST_UNUSED).cloned().collect();
        let mut inner = PageBody::new();
        if !drawn.is_empty() {
            inner.figure(svg(&picture("columns left aside", &drawn, Ink::Muted))?, "As the file holds them.");
        }
        let empty: Vec<&str> =
            look.unused.iter().filter(|guess| guess.points.is_empty()).map(|guess| guess.column.as_str()).collect();
        if !empty.is_empty() {
            inner.paragraph(format!("Without numbers: {}.", empty.join(", ")));
        }
        body.details(format!("{} columns", look.unused.len()), inner);
    }
    body.heading("How the file was read");
    for note in &look.notes {
        body.paragraph(note.clone());
    }
    Ok(page)
}

fn picture(what: &str, guesses: &[Guess], ink: Ink) -> Picture {
    let panel = |guess: &Guess| {
        let title = match (guess.title == guess.column, guess.unit.is_empty()) {
            (true, true) => guess.column.clone(),
            (true, false) => format!("{}, {}", guess.column, guess.unit),
            (false, true) => format!("{} ({})", guess.title, guess.column),
            (false, false) => format!("{}, {} ({})", guess.title, guess.unit, guess.column),
        };
        let middle = guess.points.iter().map(|[time_s, least, most]| [*time_s, 0.5 * (least + most)]).collect();
        let mut panel = Panel::new(title).height(90).x_name("time, s");
        let ends = guess
            .points
            .iter()
            .fold([f64::INFINITY, f64::NEG_INFINITY], |ends, point| [ends[0].min(point[1]), ends[1].max(point[2])]);
        if ends[0] == ends[1] {
            // What stands still needs a scale of its own size.
            let around = 0.5 * ends[0].abs().max(1.0);
            panel = panel.y_range(ends[0] - around, ends[1] + around);
        }
        panel.marks.push(Mark::new(MarkShape::Band(guess.points.clone()), ink, ""));
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
        let look = ImportView {
            file: "a.csv".into(),
            rows: 2,
            chosen: vec![guess("Servomotor position", "its name")],
            unused: vec![guess("x", "")],
            notes: vec!["read as it is".into()],
            open: vec!["range: yours".into()],
            map: "signals:\n  esv: normal\n".into(),
        };
        let html = page(&look).unwrap().to_html();
        for words in [
            "Servomotor position, pu (Y_ist)",
            "its name",
            "range: yours",
            "esv:",
            "1 columns",
            "read as it is",
            "<svg",
        ] {
            assert!(html.contains(words), "{words}");
        }
    }
}
