//! The four answers at the head of a diagnosis, in this order: what the cause is, how sure, how large the error is and how much of it is explained, what to do next.

use crate::diagnosis::stage::{beside_plain, fitted_stage, plain_as_good, plain_wins, sound_stage};
use crate::diagnosis::{claims, next_test, traces};
use govtwin_diagnosis::result::{Diagnosis, Fitted, Setup, Verdict};
use govtwin_diagnosis::words::{
    WRONG_DATA, besides, capital, cause, errors, explained, id_words, in_words, key_words, listed, of_several,
    over_noise, percent, probability, remains, stage_title, symptom, values,
};
use govtwin_model::effects::Stage;
use govtwin_model::number::{fixed, quantity};
use govtwin_model::signal::Signal;

/// Share of the gap from which it is worth a word what a discrepancy term would explain.
pub(crate) const TOLD: f64 = 0.05;

/// Tolerances from which a recalibrated value is worth a word where nothing else is wrong.
const MOVED: f64 = 1.0;

/// Errors in multiples of the noise from which the first sentence on a sound unit tells of them.
const MUCH: f64 = 2.0;

/// Values that are named in a sentence.
const NAMED_VALUES: usize = 3;

/// Tolerances from which a value is far from its sheet: by chance one in 370 is.
const FAR: f64 = 3.0;

/// Probability of a stage below which the next one is named beside it.
const OPEN: f64 = 0.5;

/// How a note begins that says what is nearest where nothing has a name.
pub(crate) const NEAREST: &str = "Nearest in the catalogue: ";

/// The answers, each under its question and in one paragraph or more.
pub(crate) fn answers(diagnosis: &Diagnosis) -> [(&'static str, Vec<String>); 4] {
    let paragraphs = |all: Vec<String>| all.into_iter().filter(|text| !text.is_empty()).collect();
    [
        ("Cause", paragraphs(causes(diagnosis))),
        ("How sure", paragraphs(sureness(diagnosis))),
        ("Error", paragraphs(reach(diagnosis))),
        ("What next", paragraphs(next(diagnosis))),
    ]
}

/// One recording alone: nothing confirms what it says.
pub(crate) fn is_alone(diagnosis: &Diagnosis) -> bool {
    diagnosis.part.is_none() && diagnosis.traces.len() == 1
}

/// The first paragraphs: what to take away; before it the plain model that predicts better, or after it the one that tells the same, where one does.
pub(crate) fn leads(diagnosis: &Diagnosis) -> Vec<String> {
    plain_wins(diagnosis).into_iter().chain([lead(diagnosis)]).chain(plain_as_good(diagnosis)).collect()
}

/// The one sentence or two to take away.
fn lead(diagnosis: &Diagnosis) -> String {
    match (diagnosis.verdict, diagnosis.blamed.as_slice()) {
        (Verdict::Named, [one]) => {
            let values = values(&one.parameters);
            let values = if values.is_empty() { values } else { format!(": {values}") };
            format!("{}{values}{}.", cause(diagnosis, &one.id), confirmed(diagnosis))
        }
        (Verdict::Named, several) => {
            let names: Vec<String> = several.iter().map(|one| id_words(&one.id)).collect();
            format!("{} act at once: {}{}.", count(several.len()), listed(&names, "and"), confirmed(diagnosis))
        }
        (Verdict::Class, competing) => {
            let names: Vec<String> = competing.iter().map(|one| id_words(&one.id)).collect();
            format!("{}; these recordings cannot distinguish them.", capital(&listed(&names, "or")))
        }
        (Verdict::Unknown, _) => wrong_data(diagnosis)
            .or_else(|| beside_plain(diagnosis))
            .unwrap_or_else(|| unknown(diagnosis)),
        (Verdict::NoGap, _) => sound_stage(diagnosis).map_or_else(|| no_gap(diagnosis), |words| words + &left(diagnosis)),
        (Verdict::NotExcited, _) => {
            "These recordings do not move the unit enough for a verdict: most faults would not show in them even at three times \
             a moderate size."
                .to_owned()
        }
        (Verdict::NoSuchUnit, _) => {
            let why = diagnosis.part.as_ref().and_then(|part| part.foreign.as_deref()).unwrap_or_default();
            format!("These recordings are not of a servomotor stage driven by this spool. {why}").trim_end().to_owned()
        }
    }
}

/// What is wrong with the recordings, where nothing is named for that.
fn wrong_data(diagnosis: &Diagnosis) -> Option<String> {
    diagnosis.notes.iter().find(|note| note.contains(WRONG_DATA)).map(|note| in_words(note))
}

fn confirmed(diagnosis: &Diagnosis) -> &'static str {
    if is_alone(diagnosis) { " (not confirmed: based on one recording)" } else { "" }
}

fn count(number: usize) -> String {
    match number {
        2 => "Two faults".into(),
        3 => "Three faults".into(),
        more => format!("{more} faults"),
    }
}

/// Values of the data sheet that the recalibration moved, farthest first, by more than so many tolerances.
pub(crate) fn moved(diagnosis: &Diagnosis, beyond: f64) -> Vec<&Fitted> {
    let of_sheet = diagnosis.parameters.iter().filter(|one| one.name.contains('.'));
    let mut moved: Vec<&Fitted> = of_sheet.filter(|one| one.position.abs() >= beyond).collect();
    moved.sort_by(|a, b| b.position.abs().total_cmp(&a.position.abs()));
    moved
}

/// Values that the recalibration moved far off a data sheet, where one is known.
pub(crate) fn far_off(diagnosis: &Diagnosis) -> Vec<&Fitted> {
    if diagnosis.setup == Setup::StageFree { Vec::new() } else { moved(diagnosis, FAR) }
}

/// What the recalibration found.
fn no_gap(diagnosis: &Diagnosis) -> String {
    let (moved, sheet) = (moved(diagnosis, MOVED), diagnosis.setup.sheet_title());
    if moved.is_empty() {
        return format!(
            "No fault found, and the {sheet} is right: recalibration moved no value by more than one tolerance.{}",
            left(diagnosis)
        );
    }
    let found: Vec<String> = moved.iter().take(NAMED_VALUES).map(|one| found(one)).collect();
    let more = match moved.len().saturating_sub(NAMED_VALUES) {
        0 => String::new(),
        1 => "; one more value is off by more than one tolerance".to_owned(),
        more => format!("; {more} more values are off by more than one tolerance"),
    };
    format!("No fault found; the {sheet} is off: {}{more}.{}", found.join(", "), left(diagnosis))
}

/// What recalibration leaves, which may be far from nothing though no fault of the catalogue explains it.
fn left(diagnosis: &Diagnosis) -> String {
    if leaves_much(diagnosis) { format!(" {}", over_noise(diagnosis)) } else { String::new() }
}

/// Whether recalibration leaves more than noise in a position.
fn leaves_much(diagnosis: &Diagnosis) -> bool {
    let mut positions = diagnosis.gap.iter().filter(|gap| Signal::POSITIONS.contains(&gap.signal));
    positions.any(|gap| gap.noise_floor > 0.0 && gap.refitted > MUCH * gap.noise_floor)
}

/// What was found of a value: `main ports overlap 0.168 mm instead of 0.200 mm (−2.0 σ)`.
fn found(one: &Fitted) -> String {
    let title = key_words(&one.name).replace(':', "");
    let [value, sheet] = [one.value.value, one.sheet].map(|value| quantity(value, one.unit));
    let sign = if one.position > 0.0 { "+" } else { "" };
    format!("{title} {value} instead of {sheet} ({sign}{} σ)", fixed(one.position, 1))
}

/// Where and when the error sits.
fn unknown(diagnosis: &Diagnosis) -> String {
    let place = diagnosis.stage.map_or_else(String::new, |stage| {
        let share = share_of(diagnosis, stage).unwrap_or(1.0);
        // Where the stage is open, the next one is worth a look as well.
        let others = diagnosis.stages.iter().filter(|(at, _)| *at != stage);
        let next = others.max_by(|a, b| a.1.total_cmp(&b.1)).filter(|_| share < OPEN);
        let then = next.map(|(at, other)| {
            format!(" ({}), then at the {} ({})", probability(share), stage_title(*at), probability(*other))
        });
        format!("look first at the {}{}", stage_title(stage), then.unwrap_or_default())
    });
    let when = worst(diagnosis).map(|(name, [from_s, to_s])| {
        format!("it is largest in {name} at {} to {} s", fixed(from_s, 1), fixed(to_s, 1))
    });
    let words: Vec<String> = [place].into_iter().filter(|place| !place.is_empty()).chain(when).collect();
    let nothing = "No effect in the catalogue explains the error";
    if words.is_empty() { format!("{nothing}.") } else { format!("{nothing}: {}.", words.join("; ")) }
}

/// The probability that the error sits in a stage.
fn share_of(diagnosis: &Diagnosis, stage: Stage) -> Option<f64> {
    diagnosis.stages.iter().find(|(at, _)| *at == stage).map(|(_, share)| *share)
}

/// The recording with most of the error, and the [`traces::WORST_S`] of it in which the recalibrated twin is farthest off.
fn worst(diagnosis: &Diagnosis) -> Option<(&str, [f64; 2])> {
    let trace = diagnosis.traces.iter().max_by(|a, b| traces::gap(a).total_cmp(&traces::gap(b)))?;
    Some((trace.name.as_str(), traces::worst(trace, traces::WORST_S)?))
}

fn causes(diagnosis: &Diagnosis) -> Vec<String> {
    let mut all = leads(diagnosis);
    let several = diagnosis.blamed.len() > 1;
    for blame in &diagnosis.blamed {
        all.push(if several { of_several(diagnosis, blame) } else { symptom(&blame.id) });
    }
    if diagnosis.verdict == Verdict::Unknown && wrong_data(diagnosis).is_none() {
        all.push(nearest(diagnosis));
    }
    all.extend(fitted_stage(diagnosis));
    all
}

/// What comes nearest, and what speaks against it.
fn nearest(diagnosis: &Diagnosis) -> String {
    if let Some(note) = diagnosis.notes.iter().find(|note| note.starts_with(NEAREST)) {
        return in_words(note);
    }
    let known = |id: &str| id != "unknown" && id != "none";
    let Some(one) = diagnosis.ranking.iter().find(|ranked| known(&ranked.id)) else { return String::new() };
    let fitted =
        diagnosis.tried.iter().find(|tried| tried.ids == [one.id.clone()]).map(|tried| values(&tried.parameters));
    let size = fitted.filter(|size| !size.is_empty()).map(|size| format!(", fitted {size}")).unwrap_or_default();
    format!(
        "{NEAREST}{}{size}. Its probability is {}, because it leaves more of the error than the right effect would.",
        id_words(&one.id),
        probability(one.probability)
    )
}

fn sureness(diagnosis: &Diagnosis) -> Vec<String> {
    let of = |id: &str| diagnosis.ranking.iter().find(|one| one.id == id).map(|one| one.probability);
    let at_stage = diagnosis.stage.and_then(|stage| {
        Some(format!("that the fault is in the {}: {}", stage_title(stage), probability(share_of(diagnosis, stage)?)))
    });
    let faults = |joint: &str| {
        let each: Vec<String> = diagnosis
            .blamed
            .iter()
            .map(|one| format!("{} {}", id_words(&one.id), probability(one.probability)))
            .collect();
        listed(&each, joint)
    };
    let (claimed, mut parts) = match diagnosis.verdict {
        Verdict::Named => {
            let least = diagnosis.blamed.iter().map(|one| one.probability).fold(f64::INFINITY, f64::min);
            (Some(least), vec![format!("Probability of {}", faults("and"))])
        }
        Verdict::Class => {
            let most = diagnosis.blamed.iter().map(|one| one.probability).fold(f64::NEG_INFINITY, f64::max);
            (most.is_finite().then_some(most), vec![format!("Probability of {}", faults("or"))])
        }
        Verdict::Unknown if wrong_data(diagnosis).is_some() => {
            (None, vec!["No cause has a probability before the recordings are right".to_owned()])
        }
        Verdict::Unknown => {
            let share = of("unknown").unwrap_or(f64::NAN);
            (Some(share), vec![format!("Probability of a cause outside the catalogue: {}", probability(share))])
        }
        Verdict::NoSuchUnit => (
            None,
            vec!["This verdict follows from which law predicts held-out pieces best; it has no probability".to_owned()],
        ),
        Verdict::NotExcited => {
            let share = of("none").unwrap_or(f64::NAN);
            let words = "but this is no finding: most faults would not show in these recordings";
            (
                None,
                vec![format!(
                    "There is no evidence of a fault (probability of no fault: {}), {words}",
                    probability(share)
                )],
            )
        }
        Verdict::NoGap => {
            let share = of("none").unwrap_or(f64::NAN);
            (Some(share), vec![format!("Probability of no fault: {}", probability(share))])
        }
    };
    // Several faults that act at once have no one stage.
    let several = diagnosis.verdict == Verdict::Named && diagnosis.blamed.len() > 1;
    if matches!(diagnosis.verdict, Verdict::Named | Verdict::Class | Verdict::Unknown) && !several && claimed.is_some()
    {
        parts.extend(at_stage);
    }
    let mut first = format!("{}.", parts.join("; "));
    let claimed = claimed.filter(|_| !diagnosis.ranking.is_empty());
    // Only whole chains with a data sheet were counted.
    let rate = claimed.filter(|_| diagnosis.setup == Setup::Chain).and_then(claims::like);
    // In one paragraph, so that a phone shows both.
    if let Some(rate) = rate {
        first += &format!(" {rate}");
    }
    let mut all = vec![first];
    all.extend(besides(diagnosis).map(|words| capital(&words)));
    if is_alone(diagnosis) && diagnosis.verdict != Verdict::NotExcited {
        all.push("One recording alone: this is its best explanation, not confirmed by another recording.".to_owned());
    }
    all
}

fn reach(diagnosis: &Diagnosis) -> Vec<String> {
    let mut all = Vec::new();
    if !diagnosis.blamed.is_empty() {
        let subject = match (diagnosis.verdict, diagnosis.blamed.len()) {
            (Verdict::Class, _) => ["the most probable one", "explains"],
            (_, 1) => ["the fault", "explains"],
            _ => ["the faults", "explain"],
        };
        all.push(explained(diagnosis.explained_fraction, subject));
    }
    if diagnosis.verdict == Verdict::Unknown {
        all.extend(explained_by_nearest(diagnosis));
        all.extend(discrepancy(diagnosis));
    }
    all.extend(remains(diagnosis));
    // Of a sound unit the first sentence says it where it is much.
    if diagnosis.verdict != Verdict::NoGap || !leaves_much(diagnosis) {
        all.push(over_noise(diagnosis));
    }
    all.push(errors(diagnosis));
    let far = far_off(diagnosis);
    if !far.is_empty() && diagnosis.verdict != Verdict::NoGap {
        let found: Vec<String> = far.iter().take(NAMED_VALUES).map(|one| found(one)).collect();
        all.push(format!("This holds only if the {} is far off: {}.", diagnosis.setup.sheet_title(), found.join(", ")));
    }
    all
}

/// How much the causes that come nearest explain, where nothing has a name.
fn explained_by_nearest(diagnosis: &Diagnosis) -> Option<String> {
    let nearest = diagnosis.remainder.as_ref().filter(|one| !one.beside.is_empty() && one.explained.is_bounded())?;
    let names: Vec<String> = nearest.beside.iter().map(|id| id_words(id)).collect();
    Some(explained(
        nearest.explained,
        [listed(&names, "and").as_str(), if names.len() > 1 { "explain" } else { "explains" }],
    ))
}

/// What a discrepancy term at the stage would explain, if it is worth a word.
fn discrepancy(diagnosis: &Diagnosis) -> Option<String> {
    let stage = diagnosis.stage?;
    let there = diagnosis
        .discrepancy_terms
        .iter()
        .filter(|discrepancy_term| discrepancy_term.stage == stage && discrepancy_term.explains >= TOLD);
    let best = there.max_by(|a, b| a.explains.total_cmp(&b.explains))?;
    Some(format!(
        "A discrepancy term on the {} would explain {} of the error beyond noise; its shape is shown below.",
        best.place,
        percent(best.explains)
    ))
}

fn next(diagnosis: &Diagnosis) -> Vec<String> {
    let mut all = next_test::paragraphs(diagnosis);
    match diagnosis.verdict {
        Verdict::NotExcited => {
            if diagnosis.experiments.is_empty() {
                all.clear();
            }
            all.insert(
                0,
                "Record a process that moves the servomotor: a start-up, a load step or a shutdown by the ESV.".into(),
            );
        }
        Verdict::NoSuchUnit => {
            // No test of a servomotor stage tells more of what is none.
            all.clear();
            all.push(next_test::CHECK_SIGNALS.into());
        }
        Verdict::NoGap => {
            all.push(
                "The minimum detectable sizes below show which faults these recordings would have revealed.".into(),
            );
        }
        Verdict::Named if is_alone(diagnosis) => {
            all.insert(
                0,
                "Record another process of the same unit and diagnose both together: this confirms or refutes the cause."
                    .into(),
            );
        }
        _ => {}
    }
    all
}
