//! The scorer: opens the labels, reads the reports back, writes score and page.

use govtwin_lab::benchmark::scored_report::ScoredReport as _;
use std::collections::BTreeMap;
use std::path::Path;

use anyhow::Context;
use govtwin_diagnosis::result::Blame;
use govtwin_diagnosis::result::schema::DiagnosisReport;
use govtwin_lab::battery::Label;
use govtwin_lab::benchmark::isolability::{self, Sized};
use govtwin_lab::benchmark::next_test::NextTestScore;
use govtwin_lab::benchmark::page::{self, measures_table};
use govtwin_lab::benchmark::score::{Misses, Score, ScoredMeasure, score};
use govtwin_lab::benchmark::scored::{MissedBy, ScoredUnit};
use govtwin_lab::benchmark::statistics::Measured;
use govtwin_lab::labels;
use govtwin_model::effects::Stage;
use govtwin_model::number::significant;
use govtwin_model::params;
use govtwin_model::provenance::Provenance;
use govtwin_pages::page::PageBody;
use govtwin_pages::table::Table;
use serde_json::{Value, json};

use super::cases::UnitFolder;
use super::expected::ExpectedDigests;
use super::method::JudgingMethod;
use super::next_test;
use crate::commands::output::{Output, Progress, print, table_text};

pub use crate::commands::report_file::LARGEST_BYTES;

/// Opens a label file.
pub fn read_labels(path: &Path) -> anyhow::Result<Vec<Label>> {
    let text =
        govtwin_files::read_text(path, LARGEST_BYTES).with_context(|| format!("cannot read {}", path.display()))?;
    labels::read(&text).with_context(|| path.display().to_string())
}

/// What a method said of a unit: the unit's name, the method's, and the report.
pub type MethodVerdict = (String, &'static str, DiagnosisReport);

/// What every method said of every unit, where nobody knows the truth.
pub fn verdicts(
    cases: &[UnitFolder],
    methods: &[JudgingMethod],
    reports: (&Path, &ExpectedDigests),
) -> anyhow::Result<Vec<MethodVerdict>> {
    let mut all = Vec::new();
    for case in cases {
        for method in methods {
            let report = method.report(reports, &case.name)?;
            all.extend(report.map(|report| (case.name.clone(), method.name(), report)));
        }
    }
    Ok(all)
}

/// The same as a table.
pub fn verdicts_table(verdicts: &[MethodVerdict]) -> Table {
    let mut table =
        Table::new().words("unit").words("method").words("verdict").words("blamed").words("stage").numbers("p");
    for (unit, method, report) in verdicts {
        let blamed: Vec<&str> = report.effects.iter().map(|effect| effect.id.as_str()).collect();
        table.row([
            unit.clone(),
            (*method).to_owned(),
            report.verdict.id().to_owned(),
            blamed.join(", "),
            report.location.stage.map_or("", Stage::id).to_owned(),
            significant(report.probability(report.word()), 2),
        ]);
    }
    table
}

/// The same for machines.
pub fn verdicts_json(verdicts: &[MethodVerdict]) -> Value {
    let one = |(unit, method, report): &MethodVerdict| {
        json!({
            "unit": unit, "method": method, "verdict": report.verdict, "stage": report.location.stage,
            "effects": report.effects.iter().map(|effect| &effect.id).collect::<Vec<_>>(), "probability": report.probability(report.word()),
        })
    };
    json!({"schema": "govtwin-verdicts/1", "verdicts": verdicts.iter().map(one).collect::<Vec<_>>()})
}

/// Scores of the units that share a figure of their labels, the largest figure first.
fn parts(cases: &[ScoredUnit], figure: impl Fn(&Label) -> f64, name: impl Fn(f64) -> String) -> Vec<page::MethodScore> {
    let mut figures: Vec<f64> = cases.iter().map(|case| figure(&case.label)).filter(|one| one.is_finite()).collect();
    figures.sort_by(|one, other| other.total_cmp(one));
    figures.dedup();
    let part = |of: f64| {
        let own: Vec<ScoredUnit> = cases.iter().filter(|case| figure(&case.label) == of).cloned().collect();
        page::MethodScore { name: name(of), score: score(&own) }
    };
    figures.into_iter().map(part).collect()
}

/// Scores all methods, prints the table, writes `score.json` and `score.html`; hands out what could not be scored, each with its reason.
pub fn score_all(
    labels: &[Label],
    realised: &BTreeMap<String, f64>,
    methods: &[JudgingMethod],
    (units, expected): (&[UnitFolder], &ExpectedDigests),
    made: &Provenance,
    (out, mut output): (&Path, Output),
    as_json: bool,
) -> anyhow::Result<Vec<String>> {
    let mut scores = Vec::new();
    let mut first = Vec::new();
    let mut unscored: Vec<String> = units
        .iter()
        .filter(|unit| labels.iter().all(|label| label.name != unit.name))
        .map(|unit| format!("{}: no label says what is in it; not counted", unit.name))
        .collect();
    for (place, method) in methods.iter().enumerate() {
        let mut cases = Vec::new();
        for label in labels {
            let Some(report) = method.report((out, expected), &label.name)? else {
                unscored.push(format!("{}: {} said nothing of it; not counted", label.name, method.name()));
                continue;
            };
            // The improved twins are the diagnosis's own.
            let realised_fraction = realised.get(&label.name).copied().filter(|_| place == 0);
            cases.push(ScoredUnit { report, label: label.clone(), realised_fraction, expected_log_bayes_factor: None });
        }
        if matches!(method, JudgingMethod::Diagnosis) {
            tell(&mut cases, units, out);
        }
        scores.push(page::MethodScore { name: method.name().to_owned(), score: score(&cases) });
        if place == 0 {
            first = cases;
        }
    }
    let by_rate = parts(&first, |label| label.rate_hz, |rate_hz| format!("{rate_hz} Hz"));
    let by_mismatch = parts(&first, |label| label.mismatch, |level| format!("mismatch {level}"));
    let mut tested = Vec::new();
    for before in &first {
        if let Some(report) = next_test::report(out, &before.label.name)? {
            tested.push((before.clone(), ScoredUnit { report, expected_log_bayes_factor: None, ..before.clone() }));
        }
    }
    let tests = NextTestScore::new(&tested);
    if !as_json {
        let words = page::misses_in_words(&first).map(|words| format!("{words}\n\n")).unwrap_or_default();
        let (cases, measures) = (table_text(&page::cases_table(&first)), table_text(&measures_table(&scores)));
        let regret = scores.first().and_then(|method| page::regret_in_words(&method.score.regret));
        let regret = regret.map(|words| format!("\n{words}\n")).unwrap_or_default();
        let tests = tests.in_words().map(|words| format!("\n{words}\n")).unwrap_or_default();
        print(&format!("{cases}\n{words}{measures}{regret}{tests}"))?;
    }
    let all: serde_json::Map<String, Value> =
        scores.iter().map(|method| (method.name.clone(), score_json(&method.score))).collect();
    let json_of = |parts: &[page::MethodScore]| -> serde_json::Map<String, Value> {
        parts.iter().map(|part| (part.name.clone(), score_json(&part.score))).collect()
    };
    let misses: serde_json::Map<String, Value> = first
        .iter()
        .filter(|case| case.missed())
        .map(|case| {
            (
                case.label.name.clone(),
                json!({"told": case.expected_log_bayes_factor, "left": case.report.leaves(), "by": case.missed_by().map(MissedBy::id)}),
            )
        })
        .collect();
    let strong = |label: &&Label| label.strength_ratio.is_finite();
    let strengths: serde_json::Map<String, Value> =
        labels.iter().filter(strong).map(|label| (label.name.clone(), label.strength_ratio.into())).collect();
    let whole = json!({
        "schema": "govtwin-blind/1",
        "units": labels.len(),
        "scored": first.len(),
        "methods": all,
        "by_rate": json_of(&by_rate),
        "by_mismatch": json_of(&by_mismatch),
        "next_tests": (tests.units > 0).then(|| json!(tests)),
        "closures": (!realised.is_empty()).then_some(realised),
        "strengths": strengths,
        "misses": misses,
        "provenance": made,
    });
    let subtitle = format!("{}, {} of {} units", made.unit, first.len(), labels.len());
    // All at one mismatch are the first column again.
    let parts: Vec<page::MethodScore> =
        by_rate.into_iter().chain(by_mismatch.into_iter().filter(|part| part.score.units < first.len())).collect();
    let mut page = page::page(&scores, &first, (&parts, &tests), &subtitle, made.origins().first().copied());
    let mut inner = PageBody::new();
    inner.facts(made.facts());
    page.body.details("What these figures were made from", inner);
    output.add("score.html", page.to_html().as_bytes())?;
    output.add_json("score.json", &whole)?;
    output.place()?;
    print(&if as_json {
        format!("{whole:#}\n")
    } else {
        format!("\n{} and score.json beside it\n", out.join("score.html").display())
    })?;
    Ok(unscored)
}

/// Asks the recordings of every missed unit whether they could have told.
fn tell(cases: &mut [ScoredUnit], units: &[UnitFolder], out: &Path) {
    let missed: Vec<&mut ScoredUnit> = cases.iter_mut().filter(|case| case.missed()).collect();
    Progress::each(missed, "missed units examined", |case| {
        case.expected_log_bayes_factor = expected_log_bayes_factor(case, units, out);
    });
}

fn expected_log_bayes_factor(case: &ScoredUnit, units: &[UnitFolder], out: &Path) -> Option<f64> {
    let unit = units.iter().find(|unit| unit.name == case.label.name)?;
    let refitted = params::load(&out.join(&unit.name).join("refitted.yaml")).ok()?;
    let hidden: Vec<Sized> = case.hidden().map(|truth| (truth.id.as_str(), vec![truth.size])).collect();
    let values = |blamed: &Blame| {
        blamed.parameters.iter().map(|one| one.value.value).take_while(|value| !value.is_nan()).collect()
    };
    // Of a class what is taken for left out is no part of the answer.
    let answers = case.report.effects.iter().filter(|blamed| hidden.iter().all(|(id, _)| *id != blamed.id));
    let answer: Vec<Sized> = answers.map(|blamed| (blamed.id.as_str(), values(blamed))).collect();
    if hidden.is_empty() {
        return None;
    }
    isolability::expected_log_bayes_factor(unit.recordings(&refitted).ok()?, &refitted, &hidden, &answer)
}

fn misses_json(misses: Misses) -> Value {
    let mut value = json!({"all": misses.all});
    for (what, count) in MissedBy::ALL.into_iter().zip(misses.by) {
        value[what.id()] = count.into();
    }
    value
}

fn score_json(score: &Score) -> Value {
    let measured = |m: &Measured| json!({"value": m.value, "ci95": [m.low, m.high], "units": m.cases});
    let measure = |m: &ScoredMeasure| {
        let mut value = measured(&m.measured);
        value["target"] = m.target.into();
        value["reached"] = m.reached.into();
        value["misses"] = m.misses.map(misses_json).into();
        (m.id.to_owned(), value)
    };
    let bins: Vec<Value> = score
        .reliability
        .iter()
        .map(|bin| json!({"said": bin.stated_probability, "was": measured(&bin.was)}))
        .collect();
    let confusion = &score.confusion;
    let regrets = |all: &[(String, f64)]| -> serde_json::Map<String, Value> {
        all.iter().map(|(name, share)| (name.clone(), (*share).into())).collect()
    };
    let quantiles: Vec<Value> =
        score.regret.quantiles.iter().map(|(units, regret)| json!({"units": units, "at_most": regret})).collect();
    json!({
        "scored": score.units,
        "measures": score.measures.iter().map(measure).collect::<serde_json::Map<_, _>>(),
        "reliability": bins,
        "regret": {"quantiles": quantiles, "large": regrets(&score.regret.large)},
        "confusion": {"truths": confusion.truths, "words": confusion.words, "counts": confusion.counts},
    })
}
