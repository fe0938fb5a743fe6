//! The page of a diagnosis: the verdict in words first, then the evidence for it.

mod answers;
mod claims;
mod next_test;
mod pictures;
mod sheet;
mod stage;
mod summary;
mod tables;
mod traces;

use super::draw::svg;
use super::page::{KeyFigure, Page, PageBody, Tone};
use govtwin_diagnosis::result::{Diagnosis, Setup, Trace, Verdict};
use govtwin_diagnosis::words;
use govtwin_model::number::significant;
use govtwin_model::provenance::Provenance;
use govtwin_model::signal::Signal;

pub(crate) use claims::like as claims_like;
pub use stage::figure_text;
pub use summary::summary;
pub use traces::kept as kept_traces;
pub(crate) use traces::{WORST_S, worst_stretch};

#[cfg(test)]
mod tests;

/// The page; `made` has the inputs of the diagnosis and the origin of the recordings.
///
/// ```no_run
/// use govtwin_diagnosis::result::{Diagnosis, schema::DiagnosisReport};
/// use govtwin_model::provenance::Provenance;
/// use govtwin_pages::diagnosis::page;
///
/// fn keep(diagnosis: &Diagnosis, seconds: f64) -> Result<(), Box<dyn std::error::Error>> {
///     let made = Provenance { unit: "unit 3".to_owned(), ..Provenance::default() };
///     std::fs::write("report.html", page(diagnosis, &made).to_html())?;
///     std::fs::write("report.json", DiagnosisReport::of(diagnosis, seconds).json().to_string())?;
///     Ok(())
/// }
/// ```
pub fn page(diagnosis: &Diagnosis, made: &Provenance) -> Page {
    let mut page = Page::new("Why the unit differs from its twin", subtitle(diagnosis, made));
    // Without an effect the twin with effects is the refitted one.
    let explained = !diagnosis.blamed.is_empty();
    let body = &mut page.body;
    opening(body, diagnosis, made);
    residuals(body, diagnosis, explained);
    if diagnosis.traces.iter().any(|trace| !trace.time_s.is_empty()) {
        recordings(body, diagnosis);
    }
    location(body, diagnosis, explained);
    causes(body, diagnosis);
    next(body, diagnosis);
    closing(body, diagnosis, made);
    page
}

/// Unit, recordings and day.
fn subtitle(diagnosis: &Diagnosis, made: &Provenance) -> String {
    // Parts of one recording share its name.
    let whole = |trace: &Trace| trace.name.split(", part ").next().unwrap_or_default().to_owned();
    let mut names: Vec<String> = diagnosis.traces.iter().map(whole).collect();
    names.dedup();
    let recordings = if names.len() > 6 { format!("{} recordings", names.len()) } else { names.join(", ") };
    let day = made.date.split('T').next().unwrap_or_default();
    let unit = if made.unit == recordings { "" } else { made.unit.as_str() };
    let parts = [unit, recordings.as_str(), day];
    parts.into_iter().filter(|part| !part.is_empty()).collect::<Vec<_>>().join(" · ")
}

fn opening(body: &mut PageBody, diagnosis: &Diagnosis, made: &Provenance) {
    body.answers(answers::answers(diagnosis));
    let verdict = words::verdict_title(diagnosis.verdict);
    let verdict = KeyFigure::new("verdict", verdict, "");
    let alone = diagnosis.verdict == Verdict::Named && answers::is_alone(diagnosis);
    let mut key = vec![if alone { verdict.hint("not confirmed") } else { verdict }];
    let some = matches!(diagnosis.verdict, Verdict::Named | Verdict::Class | Verdict::Unknown);
    if let Some((stage, hint)) = words::place(diagnosis).filter(|_| some) {
        key.push(KeyFigure::new("stage", stage, "").hint(hint));
    }
    let finding = !matches!(diagnosis.verdict, Verdict::NotExcited | Verdict::NoSuchUnit);
    if let Some(first) = diagnosis.ranking.first().filter(|_| finding) {
        key.push(
            KeyFigure::new("most probable", words::id_words(&first.id), "")
                .hint(format!("probability {}", words::probability(first.probability))),
        );
    }
    if let [one] = diagnosis.blamed.as_slice()
        && let Some(first) = one.parameters.first()
    {
        let (name, value) = (words::parameter_title(first), words::value(first));
        let (value, interval) = value.split_once(" [").unwrap_or((&value, ""));
        let hint = if interval.is_empty() { String::new() } else { format!("90 %: [{interval}") };
        key.push(KeyFigure::new(name, value, "").hint(hint));
    }
    let errors_left =
        diagnosis.gap.iter().filter(|gap| gap.noise_floor > 0.0 && Signal::POSITIONS.contains(&gap.signal));
    for gap in errors_left.filter(|_| diagnosis.blamed.is_empty()) {
        let times = format!("{} × noise", significant(gap.refitted / gap.noise_floor, 2));
        key.push(
            KeyFigure::new(format!("remaining error, {}", gap.signal.title().to_lowercase()), times, "")
                .hint("1 for a correct twin"),
        );
    }
    if !diagnosis.blamed.is_empty() {
        let explained_fraction = diagnosis.explained_fraction;
        let hint = format!(
            "held-out data; 90 %: {} to {}",
            words::percent(explained_fraction.low),
            words::percent(explained_fraction.high)
        );
        let value = if explained_fraction.leaves_all_open() {
            "undetermined".to_owned()
        } else {
            words::percent(explained_fraction.value)
        };
        key.push(KeyFigure::new("error explained", value, "").hint(hint));
    }
    let nearest = diagnosis.remainder.as_ref().filter(|one| diagnosis.blamed.is_empty() && !one.beside.is_empty());
    if let Some(nearest) = nearest.filter(|nearest| nearest.explained.is_bounded()) {
        let names: Vec<String> = nearest.beside.iter().map(|id| words::id_words(id)).collect();
        let key_figure =
            KeyFigure::new("error explained by the nearest causes", words::percent(nearest.explained.value), "");
        key.push(key_figure.hint(words::listed(&names, "and")));
    }
    body.key_figures(key);
    for origin in made.origins() {
        body.note(Tone::Plain, origin);
    }
    // The page does not repeat notes that are among the answers.
    let answered = |note: &&String| {
        let foreign = diagnosis.part.as_ref().and_then(|part| part.foreign.as_ref());
        note.starts_with("One recording alone")
            || diagnosis.verdict == Verdict::Unknown
                && (note.starts_with(answers::NEAREST) || note.contains(words::WRONG_DATA))
            || diagnosis.verdict == Verdict::NoSuchUnit && foreign == Some(*note)
    };
    for note in diagnosis.notes.iter().filter(|note| !answered(note)) {
        body.note(Tone::Warning, words::in_words(note));
    }
    let far = answers::far_off(diagnosis);
    if !far.is_empty() {
        let caption =
            "Data-sheet values that recalibration moved by more than three standard deviations of their tolerance.";
        body.table(tables::moved(&far), caption);
    }
}

fn residuals(body: &mut PageBody, diagnosis: &Diagnosis, explained: bool) {
    body.heading("RMS error of the twin");
    if !diagnosis.gap.is_empty() {
        let caption = if diagnosis.setup == Setup::StageFree {
            "Data sheet: a first guess, as none is known. Recalibrated: the stage fitted freely, equal in both directions. Line: error \
             from transducer noise alone, estimated from the differences between neighbouring samples."
        } else if diagnosis.setup == Setup::AssumedSheet {
            "Assumed sheet: estimated from the recordings. Recalibrated: its values fitted within their tolerances. Line: expected error of \
             a correct twin, from transducer noise and chatter of the regulator."
        } else {
            "Data sheet: its values as stated. Recalibrated: the same values fitted within their tolerances. Line: expected error of a \
             correct twin, from transducer noise and chatter of the regulator."
        };
        body.figure(svg(&pictures::residuals(diagnosis, explained)), caption);
    }
    let caption = if explained {
        "RMS error over all recordings; positions in % of stroke. Explained: share of the squared error beyond noise, on the fitted data."
    } else {
        "RMS error over all recordings; positions in % of stroke."
    };
    body.table(tables::gap(diagnosis, explained), caption);
    if let Some(part) = diagnosis.part.as_ref().filter(|part| !part.models.is_empty()) {
        let caption = format!(
            "Free runs of {} s from measured starts over held-out pieces: each half of the recordings is predicted by models fitted to the other. RMS error of \
             the servomotor position in % of stroke. Plain models know nothing of a servomotor; the twin is worth what it predicts better. Their parameters, \
             fitted to all recordings, are in the units of the recordings. Plain law: two gains, dead zone and lag.",
            significant(part.free_run_s, 3)
        );
        body.table(tables::models(part), caption);
    }
    if let Some(part) = diagnosis.part.as_ref().filter(|part| !part.figures.is_empty()) {
        body.table(
            tables::stage_figures(part),
            "The fitted stage in the units of the recordings, with 90 % intervals.",
        );
    }
    if diagnosis.blamed.len() > 1 {
        body.table(
            tables::blamed(diagnosis),
            "Causes found, with the share of the error that each explains on held-out data.",
        );
    }
}

fn recordings(body: &mut PageBody, diagnosis: &Diagnosis) {
    body.heading("Measured and simulated signals");
    let improved = words::improved(diagnosis);
    // A report that was read back has the curves of one recording.
    let mut order: Vec<&Trace> = diagnosis.traces.iter().filter(|trace| !trace.time_s.is_empty()).collect();
    order.sort_by(|a, b| traces::gap(b).total_cmp(&traces::gap(a)));
    let sheet = diagnosis.setup.sheet_title();
    let picture = |trace: &Trace, window_s| traces::picture(trace, window_s, improved, sheet);
    for (rank, trace) in order.into_iter().enumerate() {
        let mut inner = PageBody::new();
        let into = if rank == 0 { &mut *body } else { &mut inner };
        let what = match diagnosis.part {
            Some(_) => trace.name.clone(),
            None if letters(&trace.name).contains(&letters(trace.process.title())) => trace.name.clone(),
            None => format!("{} ({})", trace.name, trace.process.title()),
        };
        let first = if rank == 0 && diagnosis.traces.len() > 1 { " The recording with the largest error." } else { "" };
        into.figure(svg(&picture(trace, None)), format!("{what}.{first}"));
        if let Some(window_s) = traces::close_up(trace) {
            let caption = format!("{what}: the 15 s with the largest error of the recalibrated twin.");
            into.figure(svg(&picture(trace, Some(window_s))), caption);
        }
        if let Some(window_s) = traces::worst(trace, traces::WORST_S).filter(|_| rank == 0) {
            let caption = format!("{what}: the 2 s with the largest error of the recalibrated twin.");
            into.figure(svg(&picture(trace, Some(window_s))), caption);
        }
        if rank > 0 {
            body.details(what, inner);
        }
    }
}

/// A name's letters: `startup_01` is called like a start-up.
fn letters(name: &str) -> String {
    name.chars().filter(|c| c.is_alphabetic()).flat_map(char::to_lowercase).collect()
}

fn location(body: &mut PageBody, diagnosis: &Diagnosis, explained: bool) {
    body.heading("Where the error occurs");
    for signal in Signal::POSITIONS {
        let breakdowns: Vec<_> = diagnosis.breakdowns.iter().filter(|breakdown| breakdown.signal == signal).collect();
        if !breakdowns.is_empty() {
            let caption = format!(
                "{}: share of the squared error of the recalibrated twin in each condition, %. The shares in each panel sum to 100.",
                signal.title()
            );
            body.figure(svg(&pictures::breakdown(&breakdowns, signal, explained)), caption);
        }
    }
    if !diagnosis.stage_tests.is_empty() {
        body.table(
            tables::stage_tests(diagnosis),
            "Stages of the recalibrated twin, each driven by the recorded signal at its input. Mean square over noise: 1 if only noise is left.",
        );
    }
    if let Some(best) = diagnosis.discrepancy_terms.first() {
        // A term that explains nothing is a flat line.
        if best.explains >= answers::TOLD {
            let beside = if best.curves.iter().all(|curve| curve.named.is_empty()) {
                ""
            } else {
                " Dashed: the same term if the unit were the twin with faults. Where both curves agree, the named faults account for the error."
            };
            let caption = format!(
                "A discrepancy term, a free addition to one signal: on the {} ({}) it would explain {} of the error beyond noise. Each panel shows \
                 its dependence on one variable.{beside}",
                best.place,
                words::stage_title(best.stage),
                words::percent(best.explains),
            );
            body.figure(svg(&pictures::shape(best)), caption);
        }
        body.details_table(
            "Discrepancy terms on all signals",
            tables::discrepancy_terms(diagnosis),
            "Share of the error beyond noise that a free addition to each of these signals would explain.",
        );
    }
}

fn causes(body: &mut PageBody, diagnosis: &Diagnosis) {
    body.heading("Probable causes");
    let some = matches!(diagnosis.verdict, Verdict::Named | Verdict::Class | Verdict::Unknown);
    let caption = if some {
        "Probability that the fault is in each stage, and that each effect is present. Several effects may be present at once."
    } else {
        "Probability that each effect is present. Several effects may be present at once."
    };
    if !diagnosis.ranking.is_empty() {
        body.figure(svg(&pictures::probabilities(diagnosis)), caption);
    }
    if !diagnosis.transfers.is_empty() {
        let caption = "Error explained on each recording when both twins are fitted to the other recordings only. It is low if no other \
                       recording shows the same error.";
        body.table(tables::transfers(diagnosis), caption);
    }
    if !diagnosis.tried.is_empty() {
        let caption = "Fault sets fitted together with the data-sheet values, highest evidence first. Cost reduction: decrease of χ², priors \
                       included. Held out: decrease of χ² on each recording with a fit to the others, for the leading sets only.";
        body.details_table(
            format!("All fitted fault sets ({})", diagnosis.tried.len()),
            tables::tried(diagnosis),
            caption,
        );
    }
}

fn next(body: &mut PageBody, diagnosis: &Diagnosis) {
    body.heading("Limits of these recordings");
    if diagnosis.ambiguous_pairs.is_empty() {
        body.paragraph("These recordings can distinguish all effects of the catalogue from each other.");
    } else {
        body.table(
            tables::ambiguous_pairs(diagnosis),
            "Pairs of effects that these recordings cannot distinguish. Cosine of their signatures: 1 if they are identical.",
        );
    }
    if !diagnosis.experiments.is_empty() && diagnosis.verdict != Verdict::NoSuchUnit {
        body.table(
            tables::experiments(diagnosis),
            "Proposed tests: the most informative candidates, each simulated with all remaining hypotheses. Entropy drop: expected information \
             about the cause, with parameter uncertainty and equation error included. next_test.mcap holds the first test if a governor can \
             run it.",
        );
        let mut inner = PageBody::new();
        for one in &diagnosis.experiments {
            inner.paragraph(format!("{}: {}", words::capital(&one.test), next_test::how_to_run(one)));
        }
        body.details("How to run these tests", inner);
    }
    if let Some(limits) = &diagnosis.sheet_limits {
        for sentence in sheet::sentences(diagnosis) {
            body.paragraph(format!("Data sheet: {sentence}."));
        }
        body.details_table("How the data sheet limits the verdict", sheet::table(limits),
            "Data-sheet values whose tolerances limit the verdict most. Settles: information about the fault set that the true value is expected to \
             give. Hides: factor by which an effect would stand out more if this value were known. report.json lists all values.");
    }
    let sizes = tables::detectable_sizes(diagnosis);
    let caption =
        "Minimum detectable deviation from a fault-free unit in these recordings, compared with a moderate fault.";
    if matches!(diagnosis.verdict, Verdict::NoGap | Verdict::NotExcited) {
        body.table(sizes, caption);
    } else {
        body.details_table("Minimum detectable sizes", sizes, caption);
    }
}

fn closing(body: &mut PageBody, diagnosis: &Diagnosis, made: &Provenance) {
    body.heading("Fitted parameters and recorded signals");
    body.details_table(format!("Data-sheet parameters as fitted ({})", diagnosis.parameters.len()), tables::parameters(diagnosis),
        "Largest change first. σ from sheet: change in standard deviations of the tolerance. From recordings: share of the information \
         that the recordings contribute; 0 % if only the tolerance determines the value.");
    body.details_table("Recorded signals", tables::channels(diagnosis),
        "Resolution: smallest step between two values. Noise: standard deviation, estimated where the signal moves slowly. Positions in % \
         of stroke.");
    let mut inner = PageBody::new();
    inner.paragraph(
        "Error explained: (MSE recalibrated − MSE with faults) / (MSE recalibrated − noise²) over all recorded signals, each weighted by its \
         noise, on held-out data; its interval by a bootstrap of blocks of 2 s. All intervals are 90 % intervals, which hold if the twin's \
         equations are right.",
    );
    let simulations = ("simulations of a recording".to_owned(), diagnosis.simulations.to_string());
    inner.facts(made.facts().into_iter().chain([simulations]));
    body.details("How these figures were made", inner);
}
