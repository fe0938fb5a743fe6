//! The scorer: opens the labels, reads the reports back, writes score and page.

use std::collections::BTreeMap;
use std::path::Path;

use anyhow::Context;
use govtwin::battery::Label;
use govtwin::blind::limits::{self, Sized};
use govtwin::blind::page::{self, measures_table};
use govtwin::blind::said::Blamed;
use govtwin::blind::score::{Measure, Misses, Score, score};
use govtwin::blind::scored::{MissedBy, Scored};
use govtwin::blind::statistics::Measured;
use govtwin::params::{self, labels};
use govtwin::report::table::{Table, significant};
use rayon::prelude::{IntoParallelIterator, ParallelIterator};
use serde_json::{Value, json};

use super::cases::Case;
use super::method::Method;
use crate::commands::output::{Output, Progress, print};

pub use crate::commands::report_file::LARGEST_BYTES;

/// Opens a label file.
pub fn read_labels(path: &Path) -> anyhow::Result<Vec<Label>> {
    let text =
        govtwin::files::read_text(path, LARGEST_BYTES).with_context(|| format!("cannot read {}", path.display()))?;
    labels::read(&text).with_context(|| path.display().to_string())
}

/// What every method said of every unit, where nobody knows the truth.
pub fn verdicts(cases: &[Case], methods: &[Method], out: &Path) -> anyhow::Result<Table> {
    let mut table =
        Table::new().words("unit").words("method").words("verdict").words("blamed").words("stage").numbers("p");
    for case in cases {
        for method in methods {
            let Some(said) = method.said(out, &case.name)? else { continue };
            let blamed: Vec<&str> = said.effects.iter().map(|effect| effect.id.as_str()).collect();
            table.row([
                case.name.clone(),
                method.name().to_owned(),
                said.verdict.clone(),
                blamed.join(", "),
                said.location.stage.clone().unwrap_or_default(),
                significant(said.probability(said.word()), 2),
            ]);
        }
    }
    Ok(table)
}

/// Scores all methods, prints the table, writes `score.json` and `score.html`; hands out what could not be scored, each with its reason.
pub fn score_all(
    labels: &[Label],
    exams: Option<&BTreeMap<String, f64>>,
    methods: &[Method],
    units: &[Case],
    (dir, origin): (&Path, Option<&str>),
    (out, mut output): (&Path, Output),
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
            let Some(said) = method.said(out, &label.name)? else {
                unscored.push(format!("{}: {} said nothing of it; not counted", label.name, method.name()));
                continue;
            };
            // The improved twins are the diagnosis's own.
            let realised_closure = exams.filter(|_| place == 0).and_then(|exams| exams.get(&label.name)).copied();
            cases.push(Scored { said, label: label.clone(), realised_closure, told: None });
        }
        if matches!(method, Method::Diagnosis) {
            tell(&mut cases, units, out);
        }
        scores.push(page::Method { name: method.name().to_owned(), score: score(&cases) });
        if place == 0 {
            first = cases;
        }
    }
    let mut parts: Vec<page::Method> = Vec::new();
    for (name, rate_hz) in [("100 Hz", 100.0), ("5 Hz", 5.0)] {
        let own: Vec<Scored> = first.iter().filter(|case| case.label.rate_hz == rate_hz).cloned().collect();
        if !own.is_empty() {
            parts.push(page::Method { name: name.to_owned(), score: score(&own) });
        }
    }
    print(&page::cases_table(&first).to_text())?;
    print("\n")?;
    if let Some(words) = page::misses_in_words(&first) {
        print(&format!("{words}\n\n"))?;
    }
    print(&measures_table(&scores).to_text())?;
    let all: serde_json::Map<String, Value> =
        scores.iter().map(|method| (method.name.clone(), score_json(&method.score))).collect();
    let rates: serde_json::Map<String, Value> =
        parts.iter().map(|part| (part.name.clone(), score_json(&part.score))).collect();
    let misses: serde_json::Map<String, Value> = first
        .iter()
        .filter(|case| case.missed())
        .map(|case| {
            (
                case.label.name.clone(),
                json!({"told": case.told, "left": case.said.leaves(), "by": case.missed_by().map(MissedBy::id)}),
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
        "by_rate": rates,
        "closures": exams,
        "strengths": strengths,
        "misses": misses,
    });
    let name = dir.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
    let subtitle = format!("{name}, {} of {} units", first.len(), labels.len());
    let page = page::page(&scores, &first, &parts, &subtitle, origin)?;
    output.add("score.html", page.to_html().as_bytes())?;
    output.add_json("score.json", &whole)?;
    output.place()?;
    print(&format!("\n{} and score.json beside it\n", out.join("score.html").display()))?;
    Ok(unscored)
}

/// Asks the recordings of every missed unit whether they could have told.
fn tell(cases: &mut [Scored], units: &[Case], out: &Path) {
    let missed: Vec<&mut Scored> = cases.iter_mut().filter(|case| case.missed()).collect();
    let progress = Progress::new(missed.len(), "misses looked into");
    missed.into_par_iter().for_each(|case| {
        case.told = told(case, units, out);
        progress.step();
    });
}

fn told(case: &Scored, units: &[Case], out: &Path) -> Option<f64> {
    let unit = units.iter().find(|unit| unit.name == case.label.name)?;
    let refitted = params::load(&out.join(&unit.name).join("refitted.yaml")).ok()?;
    let hidden: Vec<Sized> = case.hidden().map(|truth| (truth.id.as_str(), vec![truth.size])).collect();
    let values = |blamed: &Blamed| blamed.parameters.iter().map_while(|parameter| parameter.value).collect();
    // Of a class what is taken for left out is no part of the answer.
    let answers = case.said.effects.iter().filter(|blamed| hidden.iter().all(|(id, _)| *id != blamed.id));
    let answer: Vec<Sized> = answers.map(|blamed| (blamed.id.as_str(), values(blamed))).collect();
    if hidden.is_empty() {
        return None;
    }
    limits::told(unit.recordings(&refitted).ok()?, &refitted, &hidden, &answer)
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
    let measure = |m: &Measure| {
        let mut value = measured(&m.measured);
        value["target"] = m.target.into();
        value["reached"] = m.reached.into();
        value["misses"] = m.misses.map(misses_json).into();
        (m.id.to_owned(), value)
    };
    let bins: Vec<Value> =
        score.reliability.iter().map(|bin| json!({"said": bin.said_probability, "was": measured(&bin.was)})).collect();
    let confusion = &score.confusion;
    json!({
        "scored": score.units,
        "measures": score.measures.iter().map(measure).collect::<serde_json::Map<_, _>>(),
        "reliability": bins,
        "confusion": {"truths": confusion.truths, "words": confusion.words, "counts": confusion.counts},
    })
}
