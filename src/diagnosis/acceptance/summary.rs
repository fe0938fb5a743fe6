//! The contents of an acceptance report: measures beside limits, sentences on what a fault costs, JSON and CSV.

use serde::Serialize;

use super::counterfactual::{Compared, ExpectedValue};
use super::frequency::Response;
use super::limits::{AcceptanceLimits, Limit, LimitStanding};
use super::{Measure, MeasureFound};
use crate::result::Interval;
use crate::words::id_words;
use govtwin_model::number::{quantity, significant};
use govtwin_model::provenance::Provenance;

/// The schema's name.
pub const SCHEMA: &str = "govtwin-acceptance/1";

/// Share of a value by which a fault must move it to be worth a sentence.
const WORTH_SAYING_SHARE: f64 = 0.1;

/// A value with its interval of nine in ten.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Figure {
    /// The value; null where there is none.
    pub value: Option<f64>,
    /// Its interval; null where there is none.
    pub ci90: Option<[f64; 2]>,
    /// Movements, strokes or stretches that it rests on; 0 where it is computed from others.
    pub events: usize,
    /// `recordings`, `twin` (along the recordings) or `standard test` (of the twin).
    pub from: &'static str,
    /// A note on it; empty if there is none.
    pub note: String,
    /// Its result against the limit; null if there is no limit.
    pub standing: Option<LimitStanding>,
}

/// The unit or its twin, as one column of the report.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Subject {
    /// `measured`, `twin`, `twin without X`, `unit without X`.
    pub name: String,
    /// Ids of the faults that are taken out.
    pub removed: Vec<String>,
    /// One for each measure, in the order of [`AcceptanceSummary::measures`].
    pub figures: Vec<Figure>,
}

/// A measure and its limit.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct AskedMeasure {
    /// The key.
    pub id: &'static str,
    /// The name in words.
    pub title: &'static str,
    /// The unit.
    pub unit: &'static str,
    /// How it is computed.
    pub definition: &'static str,
    /// The limit; null where there is none.
    pub limit: Option<Limit>,
    /// The measure of the unit as it is, and its result.
    pub as_found: Option<Figure>,
}

/// All that an acceptance report holds.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct AcceptanceSummary {
    /// [`SCHEMA`].
    pub schema: &'static str,
    /// What the limits call themselves; empty where there are none.
    pub limits: String,
    /// `passes`, `fails`, `undecided` or `not measured` over all limits, the worst of them; null without limits.
    pub standing: Option<LimitStanding>,
    /// The verdict of the diagnosis that the twin comes from; empty where only recordings were measured.
    pub verdict: String,
    /// The faults that it names.
    pub faults: Vec<String>,
    /// The measures.
    pub measures: Vec<AskedMeasure>,
    /// Recordings and twins.
    pub subjects: Vec<Subject>,
    /// What the faults cost, in sentences.
    pub sentences: Vec<String>,
    /// Frequency response as measured, where excited.
    pub response: Vec<Response>,
    /// Frequency response of the twin in the standard test.
    pub twin_response: Vec<Response>,
    /// What it was made from.
    pub provenance: Option<Provenance>,
}

/// What a twin is known by.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct DiagnosedTwin {
    /// The verdict.
    pub verdict: String,
    /// The faults named.
    pub faults: Vec<String>,
}

fn figure(value: Option<Interval>, from: &'static str, limit: Option<&Limit>) -> Figure {
    Figure {
        value: value.map(|value| value.value),
        ci90: value.map(|value| [value.low, value.high]),
        events: 0,
        from,
        note: String::new(),
        standing: limit.map(|limit| limit.judge(value)),
    }
}

fn figures(found: &[MeasureFound], from: &'static str, limits: &AcceptanceLimits) -> Vec<Figure> {
    let of = |one: &MeasureFound| Figure {
        events: one.events,
        note: one.note.clone(),
        ..figure(one.value, from, limits.limit(one.measure))
    };
    found.iter().map(of).collect()
}

fn expected(all: &[Option<ExpectedValue>], limits: &AcceptanceLimits) -> Vec<Figure> {
    let of = |(measure, one): (Measure, &Option<ExpectedValue>)| {
        let from = if one.is_some_and(|one| one.simulated) { "standard test" } else { "recordings" };
        figure(one.map(|one| one.value), from, limits.limit(measure))
    };
    Measure::ALL.into_iter().zip(all).map(of).collect()
}

/// Gathers the contents of a report.
pub fn summarise(compared: &Compared, diagnosed: &DiagnosedTwin, limits: &AcceptanceLimits) -> AcceptanceSummary {
    let as_found = expected(&compared.as_found, limits);
    let with_twin = !diagnosed.verdict.is_empty();
    let subject = |name: String, removed: &[String], figures| Subject { name, removed: removed.to_vec(), figures };
    let mut subjects =
        vec![subject("measured".to_owned(), &[], figures(&compared.measured.found, "recordings", limits))];
    if with_twin {
        subjects.push(subject("twin".to_owned(), &[], figures(&compared.found.recorded.found, "twin", limits)));
        let tested = figures(&compared.found.tested.found, "standard test", limits);
        subjects.push(subject("twin, standard tests".to_owned(), &[], tested));
    }
    for one in &compared.without {
        let names = one.removed.join(" and ");
        let twin = figures(&one.twin.recorded.found, "twin", limits);
        subjects.push(subject(format!("twin without {names}"), &one.removed, twin));
        let tested = figures(&one.twin.tested.found, "standard test", limits);
        subjects.push(subject(format!("twin without {names}, standard tests"), &one.removed, tested));
        subjects.push(subject(format!("unit without {names}"), &one.removed, expected(&one.expected, limits)));
    }
    let measures = Measure::ALL
        .into_iter()
        .zip(as_found)
        .map(|(measure, figure)| AskedMeasure {
            id: measure.id(),
            title: measure.title(),
            unit: measure.unit(),
            definition: measure.definition(),
            limit: limits.limit(measure).cloned(),
            as_found: Some(figure).filter(|figure| figure.value.is_some() || figure.standing.is_some()),
        })
        .collect::<Vec<_>>();
    let standings: Vec<LimitStanding> =
        measures.iter().filter_map(|asked| asked.as_found.as_ref().and_then(|figure| figure.standing)).collect();
    let worst = [LimitStanding::Fails, LimitStanding::Undecided, LimitStanding::NotMeasured, LimitStanding::Passes];
    AcceptanceSummary {
        schema: SCHEMA,
        limits: limits.name.clone(),
        standing: worst.into_iter().find(|one| standings.contains(one)),
        verdict: diagnosed.verdict.clone(),
        faults: diagnosed.faults.clone(),
        sentences: sentences(compared, limits),
        measures,
        subjects,
        response: compared.measured.response.clone(),
        twin_response: if with_twin { compared.found.tested.response.clone() } else { vec![] },
        provenance: None,
    }
}

/// A value as people read it.
pub fn text(value: f64, measure: Measure) -> String {
    match measure {
        Measure::Overshoot => format!("{} %", significant(100.0 * value, 3)),
        Measure::Bandwidth => format!("{} Hz", significant(value, 3)),
        _ if measure.unit() == "s" => format!("{} s", significant(value, 3)),
        _ => quantity(value, measure.unit()),
    }
}

/// What taking faults out changes, in sentences: first what passes or fails by it, then what moves by more than its interval.
fn sentences(compared: &Compared, limits: &AcceptanceLimits) -> Vec<String> {
    let (mut turning, mut moving) = (vec![], vec![]);
    for one in &compared.without {
        let names = one.removed.iter().map(|id| id_words(id)).collect::<Vec<_>>().join(" and ");
        for (measure, (before, after)) in Measure::ALL.into_iter().zip(compared.as_found.iter().zip(&one.expected)) {
            let (Some(before), Some(after)) = (before, after) else { continue };
            let change = after.value.value - before.value.value;
            let half = 0.5 * (after.value.high - after.value.low);
            let limit = limits.limit(measure);
            let standings = limit.map(|limit| [before, after].map(|one| limit.judge(Some(one.value))));
            let turns = standings.is_some_and(|[before, after]| before != after);
            let moves = change.abs() > half && change.abs() > WORTH_SAYING_SHARE * before.value.value.abs();
            if !turns && !moves {
                continue;
            }
            let verb = if change < 0.0 { "falls" } else { "rises" };
            let [low, high] = [after.value.low, after.value.high].map(|value| text(value, measure));
            let by = if after.simulated { ", by the twin's standard test" } else { "" };
            let standing = standings.map(|[_, after]| format!(": {}", after.word())).unwrap_or_default();
            let (from, to) = (text(before.value.value, measure), text(after.value.value, measure));
            let title = measure.title();
            let sentence =
                format!("Without {names} the {title} {verb} from {from} to {to} ({low} to {high}{by}){standing}.");
            if turns { turning.push(sentence) } else { moving.push(sentence) }
        }
    }
    turning.extend(moving);
    turning
}

/// The figures as CSV: a row for each measure of each subject.
pub fn csv(summary: &AcceptanceSummary) -> String {
    let mut text = "measure,unit,subject,from,value,low,high,events,limit_min,limit_max,standing,note\n".to_owned();
    let quoted = |words: &str| format!("\"{}\"", words.replace('"', "\"\""));
    let number = |value: Option<f64>| value.map(|value| format!("{value}")).unwrap_or_default();
    for subject in &summary.subjects {
        for (asked, figure) in summary.measures.iter().zip(&subject.figures) {
            let limit = asked.limit.clone().unwrap_or_default();
            let cells = [
                asked.id.to_owned(),
                asked.unit.to_owned(),
                quoted(&subject.name),
                quoted(figure.from),
                number(figure.value),
                number(figure.ci90.map(|ends| ends[0])),
                number(figure.ci90.map(|ends| ends[1])),
                figure.events.to_string(),
                number(limit.min),
                number(limit.max),
                figure.standing.map_or("", LimitStanding::word).to_owned(),
                quoted(&figure.note),
            ];
            text += &cells.join(",");
            text.push('\n');
        }
    }
    text
}
