//! The page of an acceptance report, which prints: limits and standings first, then what each fault costs, then how it was measured.

mod answers;
mod pictures;

use crate::draw::svg;
use crate::page::{KeyFigure, Page, PageBody, Tone};
use crate::table::Table;
use govtwin_diagnosis::acceptance::Measure;
use govtwin_diagnosis::acceptance::limits::{Limit, LimitStanding};
use govtwin_diagnosis::acceptance::series::Series;
use govtwin_diagnosis::acceptance::summary::{AcceptanceSummary, AskedMeasure, Figure, Subject, text};
use govtwin_diagnosis::words::{id_words, in_words};
use govtwin_model::number::significant;
use govtwin_model::provenance::Provenance;

use pictures::{curves, response};

/// Recordings that are drawn.
const MOST_DRAWN: usize = 4;

/// One recording as drawn: measured, and the twins' estimates.
#[derive(Clone, Debug, PartialEq)]
pub struct Drawn {
    /// As measured.
    pub measured: Series,
    /// The twin as found, where there is one.
    pub found: Option<Series>,
    /// The twin without all of the faults named, where there are any.
    pub without: Option<Series>,
}

/// The page.
pub fn page(summary: &AcceptanceSummary, drawn: &[Drawn]) -> Page {
    let made = summary.provenance.clone().unwrap_or_default();
    let subtitle = match summary.limits.as_str() {
        "" => made.unit.clone(),
        limits => format!("{}, against {limits}", made.unit),
    };
    let mut page = Page::new("Acceptance report: measures of the servo system", subtitle);
    let body = &mut page.body;
    body.answers(answers::answers(summary));
    let limited = summary.measures.iter().filter_map(|asked| Some((asked, asked.as_found.as_ref()?.standing?)));
    body.key_figures(limited.take(6).map(|(asked, standing)| {
        let figure = asked.as_found.as_ref();
        let value = figure.and_then(|figure| figure.value).map_or("–".to_owned(), |value| text(value, kind(asked)));
        let interval = figure.map(|figure| value_text(figure, kind(asked)).1).unwrap_or_default();
        let hint = if interval.is_empty() { String::new() } else { format!("{interval}: ") };
        KeyFigure::new(asked.title, value, "").hint(hint + standing.word())
    }));
    for origin in made.origins() {
        body.note(Tone::Plain, origin);
    }
    for warning in made.warnings.iter().take(5) {
        body.note(Tone::Warning, in_words(warning));
    }
    body.heading("Measures and limits");
    body.table(
        measures_table(summary),
        "The unit as it is, with 90 % intervals. A limit passes if the whole interval keeps it, fails if the whole interval breaks it, and is \
         undecided otherwise. *: not shown by the recordings, taken from the twin's standard test.",
    );
    if !summary.verdict.is_empty() {
        body.heading("Expected values without each fault");
        without(body, summary);
    }
    if !drawn.is_empty() {
        body.heading("Recordings");
        for one in drawn.iter().take(MOST_DRAWN) {
            body.figure(
                svg(&curves(one)),
                format!("{}: command and position, and below them position − command.", one.measured.name),
            );
        }
    }
    if !summary.response.is_empty() || !summary.twin_response.is_empty() {
        body.heading("Frequency response");
        body.figure(svg(&response(summary)), "Gain and phase from command to position, at the frequencies that the command excites. Bands: 90 % intervals.");
    }
    closing(body, summary, &made);
    page
}

fn kind(asked: &AskedMeasure) -> Measure {
    Measure::find(asked.id).unwrap_or(Measure::DeadTime)
}

/// The words of a limit.
fn limit_text(limit: Option<&Limit>, measure: Measure) -> String {
    match limit {
        Some(Limit { min: Some(min), max: Some(max), .. }) => {
            format!("{} to {}", text(*min, measure), text(*max, measure))
        }
        Some(Limit { max: Some(max), .. }) => format!("≤ {}", text(*max, measure)),
        Some(Limit { min: Some(min), .. }) => format!("≥ {}", text(*min, measure)),
        _ => String::new(),
    }
}

fn value_text(figure: &Figure, measure: Measure) -> (String, String) {
    let star = if figure.from == "standard test" { "*" } else { "" };
    match (figure.value, figure.ci90) {
        (Some(value), Some([low, high])) => {
            (format!("{}{star}", text(value, measure)), format!("{} to {}", text(low, measure), text(high, measure)))
        }
        _ => ("–".to_owned(), String::new()),
    }
}

/// The measures of the unit as it is, beside the limits.
pub fn measures_table(summary: &AcceptanceSummary) -> Table {
    // Without limits there is no sentence on them.
    let limited = summary.measures.iter().any(|asked| asked.limit.is_some());
    let mut table = Table::new().words("measure").numbers("value").numbers("interval");
    if limited {
        table = table.numbers("limit").words("result").words("source of the limit");
    } else {
        table = table.words("");
    }
    for (i, asked) in summary.measures.iter().enumerate() {
        let measure = kind(asked);
        let limit = limit_text(asked.limit.as_ref(), measure);
        let source = asked.limit.as_ref().map(|limit| limit.source.clone()).unwrap_or_default();
        let (value, interval) =
            asked.as_found.as_ref().map_or(("–".to_owned(), String::new()), |figure| value_text(figure, measure));
        let standing = asked.as_found.as_ref().and_then(|figure| figure.standing);
        let note =
            || summary.subjects.first().and_then(|subject| subject.figures.get(i)).map(|figure| figure.note.clone());
        let words = match standing {
            Some(standing) => standing.word().to_owned(),
            None if value == "–" => note().unwrap_or_default(),
            None => String::new(),
        };
        let mut cells = vec![asked.title.to_owned(), value, interval];
        if limited {
            cells.extend([limit, words, source]);
        } else {
            cells.push(words);
        }
        if standing == Some(LimitStanding::Fails) { table.strong_row(cells) } else { table.row(cells) }
    }
    table
}

/// What each fault costs: the unit as it is beside the unit without it.
pub fn without_table(summary: &AcceptanceSummary) -> Option<Table> {
    let units: Vec<&Subject> =
        summary.subjects.iter().filter(|subject| subject.name.starts_with("unit without")).collect();
    if units.is_empty() {
        return None;
    }
    let limited = summary.measures.iter().any(|asked| asked.limit.is_some());
    let mut table = Table::new().words("measure").numbers("as it is");
    if limited {
        table = table.numbers("limit");
    }
    for unit in &units {
        let faults: Vec<String> = unit.removed.iter().map(|id| id_words(id)).collect();
        let of = format!("without {}", faults.join(" and "));
        table = table.numbers_of(of.clone(), "value").numbers_of(of.clone(), "interval");
        if limited {
            table = table.numbers_of(of, "result");
        }
    }
    for (i, asked) in summary.measures.iter().enumerate() {
        let measure = kind(asked);
        let before = asked.as_found.as_ref().map_or("–".to_owned(), |figure| value_text(figure, measure).0);
        let mut cells = vec![asked.title.to_owned(), before];
        cells.extend(limited.then(|| limit_text(asked.limit.as_ref(), measure)));
        for unit in &units {
            let (value, interval) = value_text(&unit.figures[i], measure);
            let standing = unit.figures[i].standing.map_or("", LimitStanding::word).to_owned();
            cells.extend([value, interval]);
            cells.extend(limited.then_some(standing));
        }
        table.row(cells);
    }
    Some(table)
}

fn without(body: &mut PageBody, summary: &AcceptanceSummary) {
    match without_table(summary) {
        None => body.paragraph(format!(
            "The diagnosis names no fault (verdict: {}), so no values without a fault are computed.",
            summary.verdict
        )),
        Some(table) => {
            if summary.sentences.is_empty() {
                body.paragraph("Removing the named faults changes no measure by more than its interval.");
            }
            for sentence in &summary.sentences {
                body.paragraph(sentence.clone());
            }
            if summary.verdict == "class" {
                body.note(
                    Tone::Warning,
                    "The recordings could not distinguish a few faults; the most probable one represents all of them here.",
                );
            }
            body.table(
                table,
                "Expected value: measured + (twin without the fault − twin as found). Its interval includes the uncertainty of the measurement, of \
                 the fault sizes and of the twin. *: from the twin's standard test only.",
            );
        }
    }
    let twins: Vec<&Subject> =
        summary.subjects.iter().filter(|subject| !subject.name.starts_with("unit without")).collect();
    let mut table = Table::new().words("measure");
    for twin in &twins {
        let name = in_words(&twin.name);
        table = table.numbers_of(name.clone(), "value").numbers_of(name, "interval");
    }
    for (i, asked) in summary.measures.iter().enumerate() {
        let cells = twins.iter().flat_map(|twin| {
            let (value, interval) = value_text(&twin.figures[i], kind(asked));
            [value.trim_end_matches('*').to_owned(), interval]
        });
        table.row(std::iter::once(asked.title.to_owned()).chain(cells));
    }
    let caption = "Measures of the unit and of the twins, along the recordings and in the standard tests.";
    body.details_table("Measures of the twins", table, caption);
}

fn closing(body: &mut PageBody, summary: &AcceptanceSummary, made: &Provenance) {
    body.heading("Definitions of the measures");
    let events = summary.subjects.first().map(|subject| &subject.figures);
    let mut table = Table::new().words("measure").words("definition").words("evidence");
    for (i, asked) in summary.measures.iter().enumerate() {
        let figure = events.and_then(|figures| figures.get(i));
        let from = figure.map_or(0, |figure| figure.events);
        let what = if from == 0 {
            figure.map(|figure| figure.note.clone()).unwrap_or_default()
        } else {
            format!("{from} {}", if from == 1 { "event or segment" } else { "events or segments" })
        };
        table.row([asked.title.to_owned(), asked.definition.to_owned(), what]);
    }
    body.table(table, "IEC 60308, IEEE 125 and ASME PTC 29 name such measures. The definitions here are the program's own and follow no clause of these \
         standards.");
    if !summary.response.is_empty() {
        let mut table = Table::new()
            .numbers("frequency, Hz")
            .numbers("gain")
            .numbers("±")
            .numbers("phase, °")
            .numbers("±")
            .numbers("coherence");
        for one in &summary.response {
            table.row(
                [one.frequency_hz, one.gain, one.gain_half, one.phase_deg, one.phase_half_deg, one.coherence]
                    .map(|value| significant(value, 3)),
            );
        }
        body.details_table(
            "Values of the frequency response",
            table,
            "Measured gain and phase, with the half widths of their 90 % intervals.",
        );
    }
    body.details_facts("How these figures were made", made.facts());
    let line = "_".repeat(30);
    body.facts(["measured by", "accepted by", "date and signature"].map(|who| (who, line.clone())));
}
