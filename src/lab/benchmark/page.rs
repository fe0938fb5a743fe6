//! The page of a score: the measures beside their targets, the confusion matrix, how far probabilities can be trusted.

mod answers;

use crate::benchmark::next_test::NextTestScore;
use crate::benchmark::score::{Confusion, Score, ScoredMeasure};
use crate::benchmark::scored::{MissedBy, SEEN, ScoredUnit};
use crate::benchmark::scored_report::ScoredReport as _;
use crate::benchmark::statistics::{Bin, Measured};
use govtwin_diagnosis::words::{id_words, stage_words, verdict_words};
use govtwin_model::number::significant;
use govtwin_pages::draw::svg;
use govtwin_pages::ink::Ink;
use govtwin_pages::page::{KeyFigure, Page, Tone};
use govtwin_pages::picture::{Mark, MarkShape, Panel, Picture};
use govtwin_pages::table::Table;

pub use answers::{misses_in_words, regret_in_words};

/// One method with its score, the diagnosis first.
#[derive(Clone, Debug)]
pub struct MethodScore {
    /// What people call it.
    pub name: String,
    /// Its score.
    pub score: Score,
}

/// The page; `cases` are those of the first method, `parts` the scores of some of them, such as those of one rate, `tests` what next tests brought, `origin` what is known of
/// where the units come from.
pub fn page(
    methods: &[MethodScore],
    cases: &[ScoredUnit],
    (parts, tests): (&[MethodScore], &NextTestScore),
    subtitle: &str,
    origin: Option<&str>,
) -> Page {
    let mut page = Page::new("Benchmark: verdicts compared with the true faults", subtitle);
    let body = &mut page.body;
    let Some(first) = methods.first() else {
        body.note(Tone::Warning, "No unit was scored.");
        return page;
    };
    body.answers(answers::answers(&first.score, cases));
    let shown = ["false_alarm", "detection", "single_first", "unknown"];
    body.key_figures(
        first.score.measures.iter().filter(|measure| shown.contains(&measure.id) && measure.measured.cases > 0).map(
            |measure| {
                let value = percent(measure.measured.value);
                let hint =
                    format!("{} of {} units; target {}", interval(measure), measure.measured.cases, measure.target);
                KeyFigure::new(measure.name, value, "%").hint(hint)
            },
        ),
    );
    if let Some(origin) = origin {
        body.note(Tone::Plain, origin);
    }
    body.heading("Measures");
    body.figure(
        svg(&measures_picture(first)),
        "Shares of units with Wilson's 95 % intervals. Filled dots: target reached. Hollow dots: target missed. Thin lines: no target.",
    );
    // The baselines stand in a table of their own: one with all would be wider than a page.
    body.table(
        measures_table(&methods[..1]),
        "Value, 95 % interval, number of units, and number of misses by cause (defined under Units; some causes are not known). Named verdicts \
         with an effect that is not there: share of all verdicts `named` on units whose faults are in the catalogue, fault-free units included.",
    );
    if methods.len() > 1 {
        body.table(
            methods_table(methods),
            "The same measures for the baselines, which are run on the same units and scored in the same way.",
        );
    }
    if parts.len() > 1 {
        body.table(measures_table(parts), "The same measures for groups of the units.");
    }
    body.heading("Confusion matrix");
    body.figure(
        svg(&confusion_picture(&first.score.confusion)),
        "Number of units by true fault (rows) and by the first answer of the verdict (columns). Units with two or three effects are left out.",
    );
    body.heading("Reliability of the probabilities");
    body.figure(
        svg(&reliability_picture(methods)),
        "Share of true statements against their stated probability. On the diagonal both are equal. Whiskers: 95 % intervals.",
    );
    if let Some(words) = tests.in_words() {
        body.heading("Next tests");
        body.paragraph(words);
    }
    if let Some(words) = regret_in_words(&first.score.regret) {
        body.heading("Regret of the search");
        body.paragraph(words);
    }
    body.heading("Units");
    body.table(
        cases_table(cases),
        format!(
            "Strength: RMS change of the most affected recorded signal due to the faults, over its noise floor. Of missed units, expected: twice \
             the log Bayes factor that the missed fault should gain by the catalogue's equation, with data sheet and answer fitted against it; \
             left: χ² of the answer's model above that of a right model. A miss lies with information if expected is below {SEEN}; otherwise \
             with the search if its regret is above 1 % and {SEEN}; otherwise with information if left is below {SEEN}; otherwise with the verdict if \
             the true set leads by the evidence, and with the model if another one does."
        ),
    );
    page
}

/// The readable name of a verdict or a truth.
fn in_words(id: &str) -> String {
    match id {
        "unknown" => "unknown".to_owned(),
        "outside" => "outside the catalogue".to_owned(),
        id => id_words(id),
    }
}

fn percent(share: f64) -> String {
    significant(100.0 * share, 3)
}

/// A value as text: percent for shares, plain for times and probabilities.
fn value_text(measure: &ScoredMeasure) -> String {
    match measure.id {
        "seconds" | "probability" => significant(measure.measured.value, 3),
        _ if measure.measured.cases == 0 => "–".to_owned(),
        _ => format!("{} %", percent(measure.measured.value)),
    }
}

fn interval(measure: &ScoredMeasure) -> String {
    let Measured { low, high, cases, .. } = measure.measured;
    match measure.id {
        _ if cases == 0 => String::new(),
        "seconds" | "probability" => format!("[{}, {}]", significant(low, 3), significant(high, 3)),
        _ => format!("[{}, {}]", percent(low), percent(high)),
    }
}

/// The methods side by side, by their values alone.
fn methods_table(methods: &[MethodScore]) -> Table {
    let mut table = Table::new().words("measure").words("target");
    for method in methods {
        table = table.numbers(method.name.replace('_', " "));
    }
    for (row, measure) in methods.iter().take(1).flat_map(|first| first.score.measures.iter().enumerate()) {
        let values = methods.iter().map(|method| method.score.measures.get(row).map_or_else(String::new, value_text));
        table.row([measure.name.to_owned(), measure.target.to_owned()].into_iter().chain(values));
    }
    table
}

/// The table of measures: targets, the diagnosis, the baselines; what misses lie with where there are any.
pub fn measures_table(methods: &[MethodScore]) -> Table {
    let mut table = Table::new().words("measure").words("target");
    let any_missed = methods.iter().take(1).flat_map(|first| &first.score.measures).any(|one| one.misses.is_some());
    for (place, method) in methods.iter().enumerate() {
        // The first has room for its intervals; those of the others are in the file of figures.
        if place == 0 {
            let name = method.name.as_str();
            table = table.numbers_of(name, "value").numbers_of(name, "95 %").numbers_of(name, "units").words("result");
            if any_missed {
                table = table.numbers_of("misses", "all");
            }
            for what in MissedBy::ALL.iter().filter(|_| any_missed) {
                table = table.numbers_of("misses", what.id());
            }
        } else {
            table = table.numbers(method.name.as_str());
        }
    }
    let Some(first) = methods.first() else { return table };
    for (row, measure) in first.score.measures.iter().enumerate() {
        let mut cells = vec![measure.name.to_owned(), measure.target.to_owned()];
        for (place, method) in methods.iter().enumerate() {
            let Some(own) = method.score.measures.get(row) else { continue };
            cells.push(value_text(own));
            if place == 0 {
                cells.push(interval(own));
                let mark = match own.reached {
                    Some(true) => "reached",
                    Some(false) => "missed",
                    None => "",
                };
                cells.extend([own.measured.cases.to_string(), mark.to_owned()]);
                let counts = own.misses.map(|misses| [[misses.all].as_slice(), &misses.by].concat());
                let counts = counts
                    .map_or_else(|| vec![String::new(); 4], |counts| counts.iter().map(usize::to_string).collect());
                cells.extend(counts.into_iter().filter(|_| any_missed));
            }
        }
        table.row(cells);
    }
    table
}

fn measures_picture(method: &MethodScore) -> Picture {
    let shares: Vec<&ScoredMeasure> = method
        .score
        .measures
        .iter()
        .filter(|measure| measure.id != "seconds" && measure.measured.cases > 0)
        .rev()
        .collect();
    let height = |place: usize| place as f64;
    let mut panel = Panel::new("share of units, or mean probability")
        .height(26 * u32::try_from(shares.len().max(4)).unwrap_or(10))
        .x_range(0.0, 1.0)
        .y_range(-0.6, shares.len().max(1) as f64 - 0.4)
        .y_categories(shares.iter().map(|measure| measure.name));
    // Not by colour alone.
    let kinds = [
        (Ink::Good, Some(true), "target reached", 4.5, 0),
        (Ink::Alarm, Some(false), "target missed", 5.5, 1),
        (Ink::Muted, None, "no target", 2.5, 0),
    ];
    for (ink, wanted, label, width_px, dash) in kinds {
        let own = || shares.iter().enumerate().filter(|(_, measure)| measure.reached == wanted);
        let lines = own().map(|(k, m)| [m.measured.low.max(0.0), height(k), m.measured.high.min(1.0), height(k)]);
        let (line_px, of_lines, of_dots) = if wanted.is_none() { (1.2, label, "") } else { (3.0, "", label) };
        let dots: Vec<[f64; 2]> = own().map(|(k, m)| [m.measured.value, height(k)]).collect();
        if dots.is_empty() {
            continue;
        }
        panel = panel
            .mark(Mark { width_px: line_px, ..Mark::new(MarkShape::Segments(lines.collect()), ink, of_lines) })
            .mark(Mark { width_px, opacity: 1.0, dash, ..Mark::new(MarkShape::Dots(dots), ink, of_dots) });
    }
    Picture::grid("Measures with their intervals", 1, vec![panel])
}

fn confusion_picture(confusion: &Confusion) -> Picture {
    let rows: Vec<Vec<f64>> = confusion
        .counts
        .iter()
        .rev()
        .map(|row| row.iter().map(|&count| if count == 0 { f64::NAN } else { count as f64 }).collect())
        .collect();
    let full = confusion.counts.iter().flatten().copied().max().unwrap_or(1) as f64;
    let numbered: Vec<String> = confusion.words.iter().enumerate().map(|(k, _)| (k + 1).to_string()).collect();
    let words: Vec<String> = confusion.words.iter().map(|word| in_words(word)).collect();
    let side = confusion.words.iter().enumerate().map(|(k, word)| format!("{} {}", k + 1, in_words(word)));
    let legend = side.collect::<Vec<_>>().join(", ");
    let panel = Panel::new("number of units")
        .height(24 * u32::try_from(rows.len().max(4)).unwrap_or(10))
        .x_name(if confusion.words.len() > 8 { legend } else { "verdict".to_owned() })
        .x_categories(if confusion.words.len() > 8 { numbered } else { words })
        .y_categories(confusion.truths.iter().rev().map(|truth| in_words(truth)))
        .mark(Mark::new(MarkShape::Cells { rows, full, below: Ink::Alarm, decimals: 0 }, Ink::Simulated, ""));
    Picture::grid("Confusion matrix: true fault against verdict", 1, vec![panel])
}

fn reliability_picture(methods: &[MethodScore]) -> Picture {
    let mut panel = Panel::new("share of true statements")
        .height(300)
        .x_name("stated probability")
        .x_range(0.0, 1.0)
        .y_range(0.0, 1.0)
        .mark(Mark::new(MarkShape::Segments(vec![[0.0, 0.0, 1.0, 1.0]]), Ink::Muted, "ideal"));
    for (place, (method, ink)) in methods.iter().zip(Ink::SERIES).enumerate() {
        let point = |bin: &Bin| [bin.stated_probability, bin.was.value];
        let points: Vec<[f64; 2]> = method.score.reliability.iter().map(point).collect();
        let pattern = u8::try_from(place).unwrap_or(0);
        panel = panel.mark(Mark::new(MarkShape::Line(points.clone()), ink, &method.name).dashed(pattern));
        if place == 0 {
            let whiskers = method
                .score
                .reliability
                .iter()
                .map(|b| [b.stated_probability, b.was.low, b.stated_probability, b.was.high]);
            panel = panel.dots(ink, "", points).mark(Mark::new(MarkShape::Segments(whiskers.collect()), ink, ""));
        }
    }
    Picture::grid("Reliability of the probabilities", 1, vec![panel])
}

/// Case by case: truth and verdict.
pub fn cases_table(cases: &[ScoredUnit]) -> Table {
    let table =
        Table::new().words("unit").words("true faults").numbers("strength").words("verdict").words("named effects");
    let table = table.words("stage").numbers("p(truth)").words("answer").numbers("expected").numbers("left");
    let mut table = table.words("missed by");
    for case in cases {
        let truths: Vec<&str> = case.label.effects.iter().map(|truth| truth.id.as_str()).collect();
        let joined = |ids: &[&str], by: &str| ids.iter().map(|id| id_words(id)).collect::<Vec<_>>().join(by);
        let mut truth = if truths.is_empty() { "no fault".to_owned() } else { joined(&truths, " + ") };
        if !case.label.listed {
            truth += " (not in the catalogue)";
        }
        let blamed: Vec<&str> = case.report.effects.iter().map(|effect| effect.id.as_str()).collect();
        let true_word = match truths.first() {
            _ if !case.label.listed => "unknown",
            None => "none",
            Some(first) => first,
        };
        let right = case.report.word() == true_word
            || (case.label.listed && truths.iter().any(|truth| case.report.word() == *truth));
        let figure = |of: Option<f64>| of.filter(|_| case.missed()).map_or_else(String::new, |of| significant(of, 2));
        table.row([
            case.label.name.clone(),
            truth,
            significant(case.label.strength_ratio, 2),
            verdict_words(case.report.verdict.id()).to_owned(),
            joined(&blamed, ", "),
            case.report.location.stage.map_or("", |stage| stage_words(stage.id())).to_owned(),
            significant(case.report.probability(true_word), 2),
            match right {
                false => "wrong",
                true if case.makes_up() => "false effect as well",
                true => "",
            }
            .to_owned(),
            figure(case.expected_log_bayes_factor),
            figure(case.report.leaves()),
            case.missed_by().map_or("", MissedBy::id).to_owned(),
        ]);
    }
    table
}
