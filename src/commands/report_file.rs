//! Reports of diagnoses, read back within bounds, and only as they were written.

use std::collections::BTreeMap;
use std::path::Path;

use anyhow::{Context, bail};
use govtwin_diagnosis::result::schema::DiagnosisReport;
use govtwin_files::digest::sha256;
use govtwin_files::{folder_of, look_at, read_text};
use govtwin_model::effects::find;
use govtwin_model::provenance::Provenance;
use serde::Deserialize;
use serde_json::{Value, json};

use super::diagnose::NAMES;
use super::provenance::file;

/// More than a report of one unit has with all its evidence.
pub const LARGEST_BYTES: u64 = 1 << 24;

/// The text of a report, without the mark of byte order that editors of other systems put before it.
pub fn text(path: &Path) -> anyhow::Result<String> {
    let text = read_text(path, LARGEST_BYTES).with_context(|| format!("cannot read {}", path.display()))?;
    Ok(text.trim_start_matches('\u{feff}').to_owned())
}

/// Whether a file is there. What cannot be looked at is not taken for absent: nothing would be missed where it was left out.
pub fn is_there(path: &Path) -> anyhow::Result<bool> {
    let kind = look_at(path).with_context(|| format!("cannot look at {}", path.display()))?;
    Ok(kind.is_some_and(|kind| kind.is_file()))
}

/// The text of a file of at most so many bytes; nothing where none is there.
pub fn text_if_there(path: &Path, largest_bytes: u64) -> anyhow::Result<Option<String>> {
    if !is_there(path)? {
        return Ok(None);
    }
    read_text(path, largest_bytes).map(Some).with_context(|| format!("cannot read {}", path.display()))
}

/// A report as JSON.
pub fn read(path: &Path) -> anyhow::Result<Value> {
    serde_json::from_str(&text(path)?).with_context(|| path.display().to_string())
}

/// The report of a diagnosis, or of a baseline.
pub fn diagnosis(path: &Path) -> anyhow::Result<DiagnosisReport> {
    of_json(&read(path)?, path)
}

/// The same of its JSON; the files beside it are its own.
pub fn of_json(report: &Value, path: &Path) -> anyhow::Result<DiagnosisReport> {
    let folder = folder_of(path);
    let beside = |name: &str| {
        let path = folder.join(name);
        if is_there(&path)? { file(&path).map(|file| Some(file.sha256)) } else { Ok(None) }
    };
    sound_report(report, beside).with_context(|| path.display().to_string())
}

/// The same of a report beside which are files with these digests, by name.
pub fn sound_report(
    report: &Value,
    beside: impl Fn(&str) -> anyhow::Result<Option<String>>,
) -> anyhow::Result<DiagnosisReport> {
    check(report)?;
    unchanged(report)?;
    let read = DiagnosisReport::of_json(report)?;
    let written = read.provenance.iter().flat_map(|made| &made.written);
    for (name, stated) in written.filter(|(name, _)| NAMES.contains(&name.as_str())) {
        if let Some(found) = beside(name)?.filter(|found| found != stated) {
            bail!(
                "{name} beside it: expected the file that was written with the report (SHA-256 {stated:.12}), found another ({found:.12}), changed or of \
                 another diagnosis; take both from one run of `govtwin diagnose`"
            );
        }
    }
    Ok(read)
}

/// Key of the digests of a report's sections.
const DIGESTS: &str = "digests";

/// A report with a digest of each section, by which a change shows.
pub fn sealed(mut report: Value) -> Value {
    report[DIGESTS] = json!(digests(&report));
    report
}

/// Keys that have no digest: the digests themselves, and how long it took, which alone differs from run to run.
const WITHOUT: [&str; 2] = [DIGESTS, "seconds"];

/// SHA-256 of each section: of each key, or of those below it.
fn digests(report: &Value) -> BTreeMap<String, String> {
    let mut all = BTreeMap::new();
    for (key, section) in report.as_object().into_iter().flatten().filter(|(key, _)| !WITHOUT.contains(&key.as_str())) {
        match section {
            Value::Object(below) => {
                all.extend(below.iter().map(|(last, value)| (format!("{key}.{last}"), sha256(value.to_string()))));
            }
            _ => drop(all.insert(key.clone(), sha256(section.to_string()))),
        }
    }
    all
}

/// Refuses a report with a section that is not the one that was written; one without digests is of another program, or of before.
fn unchanged(report: &Value) -> anyhow::Result<()> {
    let Some(stated) = report.get(DIGESTS) else { return Ok(()) };
    let (stated, found) = (BTreeMap::<String, String>::deserialize(stated).context(DIGESTS)?, digests(report));
    for place in stated.keys().chain(found.keys()) {
        let [stated, found] = [&stated, &found].map(|all| all.get(place).map_or("none", String::as_str));
        if stated != found {
            bail!(
                "{place}: expected what was written (SHA-256 {stated:.12}), found something else ({found:.12}): the report was changed; make it again with \
                 `govtwin diagnose`"
            );
        }
    }
    Ok(())
}

/// What the report in a file was made from; none where it does not say.
pub fn provenance(path: &Path) -> anyhow::Result<Option<Provenance>> {
    made_from(&read(path)?).with_context(|| path.display().to_string())
}

/// What a report was made from; none where it does not say.
pub fn made_from(report: &Value) -> serde_json::Result<Option<Provenance>> {
    report.get("provenance").map_or(Ok(None), Option::deserialize)
}

/// Refuses a report that was edited or made by something else, before its figures are shown as if they were ours.
fn check(report: &Value) -> anyhow::Result<()> {
    let verdict = report["verdict"].as_str().unwrap_or_default();
    let faults = report["effects"].as_array().map_or(0, Vec::len);
    if matches!(verdict, "named" | "class") && faults == 0 {
        bail!("effects: expected the faults of the verdict `{verdict}`, found none");
    }
    if matches!(verdict, "no_gap" | "not_excited" | "no_such_unit" | "unknown") && faults > 0 {
        bail!("effects: expected none with the verdict `{verdict}`, found {faults}");
    }
    effects(report)?;
    agreeing(report)?;
    sound("", report)
}

/// Figures that one report states in two places are the same, and each cause stands in it once.
fn agreeing(report: &Value) -> anyhow::Result<()> {
    for key in ["effects", "ranking"] {
        let ids: Vec<&str> = ids(&report[key]).collect();
        if let Some((row, id)) = ids.iter().enumerate().find(|(row, id)| ids[..*row].contains(id)) {
            bail!("{key}[{row}].id: expected each cause once, found `{id}` again");
        }
    }
    let stages = &report["location"]["probability"];
    let sum: f64 = stages.as_object().into_iter().flatten().filter_map(|(_, share)| share.as_f64()).sum();
    if sum > 1.0 + SAME {
        bail!("location.probability: expected shares of all stages that sum up to 1 at most, found {sum}");
    }
    let (remainder, explained) = (&report["remainder"], &report["remainder"]["explained"]["value"]);
    if report["verdict"] != "named" || remainder.is_null() {
        return Ok(());
    }
    let [beside, named] = [&remainder["beside"], &report["effects"]].map(|list| {
        let mut all: Vec<String> = ids(list).map(str::to_owned).collect();
        all.sort();
        all
    });
    if beside != named {
        bail!(
            "remainder.beside: expected the effects of the report ({}), found {}",
            named.join(", "),
            beside.join(", ")
        );
    }
    let closure = &report["gap"]["closure"]["value"];
    match (explained.as_f64(), closure.as_f64()) {
        (Some(here), Some(there)) if (here - there).abs() > SAME => {
            bail!("remainder.explained: expected {there} as in `gap.closure`, found {here}")
        }
        _ => Ok(()),
    }
}

/// The ids of a list, of texts or of objects that have one.
fn ids(list: &Value) -> impl Iterator<Item = &str> {
    list.as_array().into_iter().flatten().filter_map(|one| one.as_str().or(one["id"].as_str()))
}

/// Every effect is one of the catalogue, with parameters of its own, and the probability that the ranking gives it.
fn effects(report: &Value) -> anyhow::Result<()> {
    let list = |key: &str| report[key].as_array().into_iter().flatten();
    // An effect of the user's own is known by its file alone.
    let own = report["provenance"]["options"].get("candidate").is_some();
    for (row, effect) in list("effects").enumerate() {
        let Some(id) = effect["id"].as_str() else { continue };
        let Some(spec) = find(id) else {
            if own {
                continue;
            }
            bail!("effects[{row}].id: expected an effect of `govtwin effects`, found `{id}`");
        };
        for (place, parameter) in effect["parameters"].as_array().into_iter().flatten().enumerate() {
            let Some(name) = parameter["name"].as_str() else { continue };
            let last = name.rsplit('.').next().unwrap_or(name);
            if !spec.parameters.iter().any(|known| known.name == last) {
                let known: Vec<&str> = spec.parameters.iter().map(|known| known.name).collect();
                bail!(
                    "effects[{row}].parameters[{place}].name: expected a parameter of `{id}` ({}), found `{name}`",
                    known.join(", ")
                );
            }
        }
        let ranked = list("ranking").find(|one| one["id"].as_str() == Some(id));
        let both = ranked.and_then(|ranked| Some((effect["probability"].as_f64()?, ranked["probability"].as_f64()?)));
        match both {
            Some((here, there)) if (here - there).abs() > SAME => {
                bail!("effects[{row}].probability: expected {there} as in the ranking, found {here}")
            }
            None if ranked.is_none() && list("ranking").next().is_some() => {
                bail!("effects[{row}].id: expected an effect of the ranking, found `{id}`")
            }
            _ => {}
        }
    }
    Ok(())
}

/// Figures of one report that state the same differ by rounding alone.
const SAME: f64 = 1e-6;

/// Every probability below a place lies in 0 to 1, and every interval in order.
fn sound(place: &str, value: &Value) -> anyhow::Result<()> {
    match value {
        Value::Object(entries) => within(place, value).and_then(|()| {
            entries.iter().try_for_each(|(key, value)| {
                let place = if place.is_empty() { key.clone() } else { format!("{place}.{key}") };
                match (key.as_str(), value) {
                    ("probability", Value::Object(all)) => {
                        all.iter().try_for_each(|(id, share)| probability(&format!("{place}.{id}"), share))
                    }
                    ("probability" | "likeness", share) => probability(&place, share),
                    ("ci90", Value::Array(ends)) => match ends.iter().filter_map(Value::as_f64).collect::<Vec<_>>()[..]
                    {
                        [low, high] if low > high => {
                            bail!("{place}: expected an interval from low to high, found [{low}, {high}]")
                        }
                        _ => Ok(()),
                    },
                    (_, value) => sound(&place, value),
                }
            })
        }),
        Value::Array(rows) => {
            rows.iter().enumerate().try_for_each(|(row, value)| sound(&format!("{place}[{row}]"), value))
        }
        _ => Ok(()),
    }
}

/// A value lies in its interval.
fn within(place: &str, figure: &Value) -> anyhow::Result<()> {
    let ends: Vec<f64> = figure["ci90"].as_array().into_iter().flatten().filter_map(Value::as_f64).collect();
    let (Some(value), [low, high]) = (figure["value"].as_f64(), &ends[..]) else { return Ok(()) };
    let room = SAME * value.abs().max(low.abs()).max(high.abs());
    if low <= high && !(low - room..=high + room).contains(&value) {
        let place = if place.is_empty() { "value" } else { place };
        bail!("{place}: expected a value in its interval [{low}, {high}], found {}", figure["value"]);
    }
    Ok(())
}

fn probability(place: &str, share: &Value) -> anyhow::Result<()> {
    match share.as_f64() {
        Some(share) if !(0.0..=1.0 + 1e-9).contains(&share) => bail!("{place}: expected 0 to 1, found {share}"),
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::check;

    #[test]
    fn figures_that_no_diagnosis_has_are_named_with_their_place() {
        for (report, words) in [
            (
                json!({"verdict": "named", "effects": []}),
                "effects: expected the faults of the verdict `named`, found none",
            ),
            (
                json!({"ranking": [{"probability": 0.2}, {"probability": 97}]}),
                "ranking[1].probability: expected 0 to 1, found 97",
            ),
            (
                json!({"location": {"probability": {"esv": -0.5}}}),
                "location.probability.esv: expected 0 to 1, found -0.5",
            ),
            (
                json!({"verdict": "no_gap", "effects": [{"id": "backlash"}]}),
                "effects: expected none with the verdict `no_gap`, found 1",
            ),
            (
                json!({"verdict": "named", "effects": [{"id": "no_such_effect"}]}),
                "effects[0].id: expected an effect of `govtwin effects`, found `no_such_effect`",
            ),
            (
                json!({"verdict": "named", "effects": [{"id": "pilot_filter", "parameters": [{"name": "play_pu"}]}]}),
                "effects[0].parameters[0].name: expected a parameter of `pilot_filter` (clogging_ratio), found `play_pu`",
            ),
            (
                json!({"verdict": "named", "effects": [{"id": "backlash", "probability": 0.999}], "ranking": [{"id": "backlash", "probability": 0.97}]}),
                "effects[0].probability: expected 0.97 as in the ranking, found 0.999",
            ),
            (
                json!({"verdict": "named", "effects": [{"id": "backlash", "parameters": [{"name": "play_pu", "value": 9e99, "ci90": [0.1, 0.2]}]}]}),
                "effects[0].parameters[0]: expected a value in its interval [0.1, 0.2], found 9e+99",
            ),
            (
                json!({"verdict": "unknown", "effects": [{"id": "backlash"}]}),
                "effects: expected none with the verdict `unknown`, found 1",
            ),
            (
                json!({"effects": [{"id": "backlash"}, {"id": "backlash"}]}),
                "effects[1].id: expected each cause once, found `backlash` again",
            ),
            (
                json!({"location": {"probability": {"esv": 0.9, "servomotor": 0.9}}}),
                "location.probability: expected shares of all stages that sum up to 1 at most, found 1.8",
            ),
            (
                json!({"verdict": "named", "effects": [{"id": "backlash"}], "remainder": {"beside": ["pilot_filter"]}}),
                "remainder.beside: expected the effects of the report (backlash), found pilot_filter",
            ),
            (
                json!({"verdict": "named", "effects": [{"id": "backlash"}], "gap": {"closure": {"value": 0.0}},
                       "remainder": {"beside": ["backlash"], "explained": {"value": 0.9}}}),
                "remainder.explained: expected 0 as in `gap.closure`, found 0.9",
            ),
            (json!({"evidence": {"alike": [{"likeness": 7}]}}), "evidence.alike[0].likeness: expected 0 to 1, found 7"),
            (
                json!({"gap": {"closure": {"ci90": [0.9, 0.1]}}}),
                "gap.closure.ci90: expected an interval from low to high, found [0.9, 0.1]",
            ),
        ] {
            assert_eq!(check(&report).unwrap_err().to_string(), words);
        }
        let sound = json!({"verdict": "no_gap", "effects": [], "ranking": [{"probability": null}, {"probability": 1.0}], "ci90": [null, 1.0]});
        check(&sound).unwrap();
    }
}
