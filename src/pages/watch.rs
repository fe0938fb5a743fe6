//! The page of a watched unit: what has moved, the course of every size, and every process.

use std::cmp::Reverse;

use crate::draw::svg;
use crate::ink::Ink;
use crate::page::{KeyFigure, Page, Tone};
use crate::picture::{Mark, MarkShape, Panel, Picture};
use crate::table::Table;
use govtwin_diagnosis::watch::history::{Course, ProcessEntry, origins};
use govtwin_diagnosis::words::{capital, id_words, in_words, shown_unit, verdict_words};
use govtwin_model::number::{quantity, scaled_unit, significant};
use govtwin_model::recording::Process;

/// Sizes that stand above the pictures.
const MOST_SIZES: usize = 6;

/// How a note begins that every process has, as each is diagnosed alone.
const ALONE: &str = "One recording";

/// Processes that the table shows, the newest.
const MOST_ROWS: usize = 200;

/// The contents of the page.
#[derive(Clone, Copy, Debug)]
pub struct Watched<'a> {
    /// What the unit is called.
    pub unit: &'a str,
    /// Its history.
    pub entries: &'a [ProcessEntry],
    /// The courses of all sizes.
    pub courses: &'a [Course],
    /// Processes between two false alarms of one size.
    pub between_false_alarms: f64,
    /// Times of the entries as text.
    pub times: &'a [String],
}

/// The page.
pub fn page(watched: &Watched) -> Page {
    let Watched { unit, entries, courses, between_false_alarms, times } = *watched;
    let mut page = Page::new(format!("Watched unit: {unit}"), format!("{} processes", entries.len()));
    let body = &mut page.body;
    let warnings: Vec<String> = courses.iter().filter_map(Course::warning).collect();
    body.answers(answers(watched, &warnings));
    // Bags may come late, and those of one look in the order of their names.
    let mut order: Vec<usize> = (0..entries.len()).collect();
    order.sort_by_key(|&i| (Reverse(entries[i].time_ns), Reverse(i)));
    let newest = order.first().and_then(|&i| times.get(i));
    let newest = newest.map_or_else(String::new, |time| format!("newest: {}", readable(time)));
    let counts = [
        KeyFigure::new("processes", entries.len().to_string(), "").hint(newest),
        KeyFigure::new("sizes that have moved", warnings.len().to_string(), "")
            .hint(format!("of {} followed", courses.len())),
    ];
    body.key_figures(counts.into_iter().chain(courses.iter().take(MOST_SIZES).filter_map(latest)));
    for origin in origins(entries) {
        body.note(Tone::Plain, origin);
    }
    for warning in warnings.iter().skip(1) {
        body.note(Tone::Warning, format!("{warning}."));
    }
    if !courses.is_empty() {
        body.heading("Fault sizes over time");
        for course in courses {
            let caption = format!(
                "{}. Above: size in each process with its 90 % interval; filled if the verdict names the fault, hollow if it does not, large if the \
                 size has moved. Short lines: mean of the earlier sizes from the same kind of process. Below: cumulative sums for growth and \
                 shrinkage. At their limit of {} standard deviations one false alarm in {} processes is expected.",
                course.title(),
                significant(course.limit, 3),
                significant(between_false_alarms, 3),
            );
            body.figure(svg(&picture(course, entries)), caption);
        }
    }
    body.heading("Diagnosed processes");
    let mut table = Table::new()
        .words("began")
        .words("process")
        .numbers("length")
        .words("verdict")
        .words("sizes")
        .words("bag")
        .words("remarks");
    let mixed = entries.iter().any(|entry| entry.synthetic) && !entries.iter().all(|entry| entry.synthetic);
    for (entry, time) in order.iter().filter_map(|&i| Some((&entries[i], times.get(i)?))).take(MOST_ROWS) {
        let sizes = entry.sizes.iter().filter(|size| size.named);
        let sizes: Vec<String> = sizes
            .map(|size| {
                let unit = shown_unit(&size.parameter, &size.unit);
                let [low, high] = size.ci90.map(|end| quantity(end, unit));
                format!("{} {} ({low} to {high})", id_words(&size.effect), quantity(size.value, unit))
            })
            .collect();
        let own = entry.notes.iter().filter(|note| !note.starts_with(ALONE));
        let warnings = entry.warnings.iter().map(|warning| format!("{warning}."));
        let synthetic = (mixed && entry.synthetic).then(|| "Synthetic.".to_owned());
        let notes = warnings.chain(synthetic).chain(own.map(|note| in_words(note))).collect::<Vec<_>>().join(" ");
        let cells = [
            readable(time),
            process_words(&entry.process),
            format!("{} s", significant(entry.duration_s, 3)),
            verdict_words(&entry.verdict).to_owned(),
            sizes.join("; "),
            entry.bag.clone(),
            notes,
        ];
        if entry.warnings.is_empty() { table.row(cells) } else { table.strong_row(cells) }
    }
    body.table(table, "Newest first. Each process is diagnosed alone, so the results do not confirm each other.");
    page
}

/// What every page answers first, of the unit's history.
fn answers(watched: &Watched, warnings: &[String]) -> [(&'static str, Vec<String>); 4] {
    let Watched { entries, courses, between_false_alarms, .. } = *watched;
    let cause = match warnings.first() {
        Some(first) => format!("{first}."),
        None if courses.is_empty() => "No fault has been named yet.".to_owned(),
        None => "No fault's size has moved beyond what its intervals allow.".to_owned(),
    };
    let mut sure = Vec::new();
    if let Some(moved) = courses.iter().find(|course| course.points.last().is_some_and(|point| point.alarm)) {
        let sum = moved.points.last().map_or(0.0, |point| point.sums.growth.max(point.sums.shrinkage));
        let [sum, limit] = [sum, moved.limit].map(|sd| significant(sd, 3));
        sure.push(format!("Its cumulative sum is {sum} standard deviations; the limit is {limit}."));
    }
    sure.push(format!(
        "If nothing changes, one false warning of each size is expected in {} processes.",
        significant(between_false_alarms, 3)
    ));
    let named = |course: &Course| {
        let names = |entry: &&ProcessEntry| entry.sizes.iter().any(|size| size.effect == course.effect && size.named);
        entries.iter().filter(names).count()
    };
    let mut effects: Vec<(&str, usize)> = Vec::new();
    for course in courses {
        if effects.iter().all(|(known, _)| *known != course.effect) {
            effects.push((&course.effect, named(course)));
        }
    }
    let mut far: Vec<String> = vec![format!("{} processes are in the history.", entries.len())];
    far.extend(effects.iter().map(|(id, count)| format!("{} was named in {count} of them.", capital(&id_words(id)))));
    let next = if warnings.is_empty() && courses.is_empty() {
        "Nothing to do: the next process is diagnosed after it ends."
    } else {
        "Diagnose the latest recordings of several kinds of process together with `govtwin diagnose`: here each process is diagnosed alone, so \
         the results do not confirm each other."
    };
    [
        ("Result", vec![cause]),
        ("How sure", sure),
        ("Coverage", vec![far.join(" ")]),
        ("What next", vec![next.to_owned()]),
    ]
}

/// The size of a course as it was found last.
fn latest(course: &Course) -> Option<KeyFigure> {
    let (last, point) = (course.estimates.last()?, course.points.last()?);
    let [size, low, high] =
        [last.size, last.low, last.high].map(|value| quantity(value, shown_unit(&course.parameter, &course.unit)));
    let moved = if point.alarm { "has moved" } else { "not moved" };
    Some(KeyFigure::new(course.title(), size, "").hint(format!("{low} to {high}; {moved}")))
}

/// A kind of process as people call it.
fn process_words(id: &str) -> String {
    Process::with_id(id).map_or_else(|| id.replace('_', " "), |kind| kind.title().to_owned())
}

/// A time as people write it.
fn readable(time: &str) -> String {
    time.replace('T', " ").replace('Z', " UTC")
}

/// Sizes with their intervals over time, and the sums below.
fn picture(course: &Course, entries: &[ProcessEntry]) -> Picture {
    let first_ns = entries.iter().map(|entry| entry.time_ns).min().unwrap_or_default();
    let span_h = entries.iter().map(|entry| hours(entry.time_ns - first_ns)).fold(0.0, f64::max);
    let (scale_h, name) = match span_h {
        span_h if span_h > 72.0 => (24.0, "time, days"),
        span_h if span_h > 2.0 => (1.0, "time, h"),
        _ => (1.0 / 60.0, "time, min"),
    };
    // Processes of one instant have a place as well.
    let span = span_h.max(1.0 / 60.0) / scale_h;
    let x = |k: usize| hours(entries[course.entries[k]].time_ns - first_ns) / scale_h;
    let ends = course.estimates.iter().flat_map(|one| [one.low.abs(), one.high.abs()]);
    let (factor, unit) = scaled_unit(ends.fold(0.0, f64::max), shown_unit(&course.parameter, &course.unit));
    let count = course.estimates.len();
    let whiskers =
        (0..count).map(|k| [x(k), factor * course.estimates[k].low, x(k), factor * course.estimates[k].high]);
    let named = |k: &usize| {
        let sizes = &entries[course.entries[*k]].sizes;
        sizes.iter().any(|size| size.effect == course.effect && size.named)
    };
    let dot = |k: usize| [x(k), factor * course.estimates[k].size];
    let title = if unit.is_empty() { course.title() } else { format!("{}, {unit}", course.title()) };
    let dash = 0.004 * span;
    let dashes = (0..count).map(|k| {
        let mean = factor * course.points[k].mean;
        [x(k) - dash, mean, x(k) + dash, mean]
    });
    let mean = Mark::new(MarkShape::Segments(dashes.collect()), Ink::Command, "earlier mean, same kind");
    let mut sizes = Panel::new(title)
        .x_range(-0.03 * span, 1.03 * span)
        .mark(Mark::new(MarkShape::Segments(whiskers.collect()), Ink::Band, "90 % interval"))
        .mark(Mark { width_px: 3.0, ..mean });
    let groups: [(Ink, &str, u8, Vec<usize>); 2] = [
        (Ink::Simulated, "named", 0, (0..count).filter(named).collect()),
        (Ink::Muted, "not named", 1, (0..count).filter(|k| !named(k)).collect()),
    ];
    for (ink, label, dash, ks) in groups.into_iter().filter(|group| !group.3.is_empty()) {
        let dots = Mark::new(MarkShape::Dots(ks.into_iter().map(dot).collect()), ink, label).dashed(dash);
        sizes = sizes.mark(Mark { width_px: 3.5, ..dots });
    }
    let alarmed: Vec<[f64; 2]> = (0..count).filter(|&k| course.points[k].alarm).map(dot).collect();
    if !alarmed.is_empty() {
        sizes = sizes.mark(Mark { width_px: 5.5, ..Mark::new(MarkShape::Dots(alarmed), Ink::Alarm, "moved") });
    }
    let of = |value: fn(&govtwin_diagnosis::trend::ChartPoint) -> f64| {
        (0..count).map(|k| [x(k), value(&course.points[k])]).collect()
    };
    let sums = Panel::new("Cumulative sums, standard deviations")
        .height(90)
        .x_range(-0.03 * span, 1.03 * span)
        .line(Ink::Extra1, "growth", of(|point| point.sums.growth))
        .dashed_line(Ink::Extra2, "shrinkage", of(|point| point.sums.shrinkage))
        .level(Ink::Alarm, "limit", course.limit)
        .x_name(name);
    Picture::stacked(format!("Size over time of {}", id_words(&course.effect)), vec![sizes, sums])
}

fn hours(nanos_ns: i64) -> f64 {
    govtwin_model::units::seconds_from_nanos(nanos_ns) / 3600.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use govtwin_diagnosis::watch::history::courses;
    use govtwin_diagnosis::watch::history::{ProcessSize, SCHEMA};

    fn entry(i: i64, value: f64) -> ProcessEntry {
        let size = ProcessSize {
            effect: "backlash".into(),
            parameter: "play_pu".into(),
            unit: "pu".into(),
            value,
            ci90: [value - 1e-4, value + 1e-4],
            named: true,
        };
        ProcessEntry {
            schema: SCHEMA.into(),
            digest: format!("{i}"),
            bag: "a.mcap".into(),
            synthetic: false,
            origin: None,
            time_ns: i,
            duration_s: 30.0,
            process: "startup".into(),
            verdict: "named".into(),
            explained_fraction: Some(0.9),
            sizes: vec![size],
            notes: vec![],
            warnings: vec![],
            program: "govtwin".into(),
        }
    }

    /// The page of a history; a process begins every minute.
    fn html_of(entries: &[ProcessEntry]) -> String {
        let courses = courses(entries, 1000.0);
        let times: Vec<String> = (0..entries.len()).map(|i| format!("2026-11-26T00:{i:02}:00Z")).collect();
        let watched =
            Watched { unit: "unit3", entries, courses: &courses, between_false_alarms: 1000.0, times: &times };
        page(&watched).to_html()
    }

    /// What has moved leads the page, and nothing is reported as moved that has not.
    #[test]
    fn a_size_that_has_moved_leads_the_page() {
        let of = |growth: f64| {
            let entries: Vec<ProcessEntry> = (0..30)
                .map(|i| entry(i, 2e-3 + 2e-5 * ((i * 7 % 5) as f64 - 2.0) + growth * (i - 15).max(0) as f64))
                .collect();
            html_of(&entries)
        };
        let (grown, still) = (of(2e-5), of(0.0));
        let head = |html: &str| html[..html.find("<svg").unwrap()].to_owned();
        assert!(head(&grown).contains("Backlash has grown") && head(&grown).contains("1</"), "{}", head(&grown));
        assert!(head(&still).contains("size has moved beyond") && !still.contains("has grown"), "{}", head(&still));
    }

    /// The newest process by its time leads the table, whenever its bag came.
    #[test]
    fn the_newest_process_leads_the_table() {
        let mut entries: Vec<ProcessEntry> = (0..3).map(|i| entry(i, 2e-3)).collect();
        entries[0].time_ns = 9;
        let html = html_of(&entries);
        assert!(html.contains("newest: 2026-11-26 00:00:00 UTC"), "{html}");
        let at = |minute: &str| html.rfind(&format!("2026-11-26 00:{minute}:00 UTC")).unwrap();
        assert!(at("00") < at("02") && at("02") < at("01"), "{html}");
    }

    /// The page states whether recordings are marked as synthetic, and which if only some are.
    #[test]
    fn what_is_synthetic_is_told() {
        let mut entries: Vec<ProcessEntry> = (0..3).map(|i| entry(i, 2e-3)).collect();
        assert!(!html_of(&entries).contains("ynthetic"));
        entries[1].synthetic = true;
        entries[1].notes.push("oil.bulk_modulus_pa was fitted to the end of its range.".to_owned());
        let some = html_of(&entries);
        assert!(
            some.contains("Synthetic data among the recordings")
                && some.matches(">Synthetic. oil bulk modulus was").count() == 1
        );
        for entry in &mut entries {
            (entry.synthetic, entry.origin) = (true, Some("All units are synthetic: made by a simulator.".to_owned()));
        }
        let all = html_of(&entries);
        assert!(all.matches("made by a simulator.").count() == 1 && !all.contains(">Synthetic."), "{all}");
    }
}
