//! A diagnosis in sentences: readable names of effects, stages and values, and the verdict.

use crate::result::{Blame, Diagnosis, Fitted, Interval, SignalGap, Verdict};
use govtwin_model::effects::{self, Stage};
use govtwin_model::number::{fixed, scaled_unit, significant};
use govtwin_model::signal::Signal;

/// Share of the error that is worth a word where it remains.
const LEAST_REMAINDER: f64 = 0.05;

/// What a note says that calls the recordings wrong instead of the unit.
pub const WRONG_DATA: &str = "No effect is named for such recordings.";

/// A share as a percentage.
pub fn percent(share: f64) -> String {
    if share.is_finite() { format!("{} %", fixed(100.0 * share, 0)) } else { "–".into() }
}

/// A probability, or a share that is expected, as a percentage; none is certain, and none is nothing.
pub fn probability(share: f64) -> String {
    match share {
        share if share < 0.005 => "under 1 %".to_owned(),
        share if share > 0.995 => "over 99 %".to_owned(),
        share => percent(share),
    }
}

/// A share with its interval, as percentages; no figure if the interval excludes nothing.
pub fn percents(interval: Interval) -> String {
    if interval.leaves_all_open() {
        return "undetermined".to_owned();
    }
    let plain = |share: f64| percent(share).replace(" %", "");
    format!("{} [{}, {}]", percent(interval.value), plain(interval.low), plain(interval.high))
}

/// How much of the error is explained, `subject` with its verb: `the fault`, `explains`.
pub fn explained(explained_fraction: Interval, [subject, explains]: [&str; 2]) -> String {
    let error = "the squared error that recalibration leaves beyond noise";
    if explained_fraction.leaves_all_open() {
        return format!(
            "{} {explains} an undetermined share of {error}: the error occurs in too few places or is too close to noise.",
            capital(subject)
        );
    }
    let share = if explained_fraction.value > 0.0 { percents(explained_fraction) } else { "nothing".to_owned() };
    format!("On other recordings of the unit, {subject} {explains} {share} of {error}.")
}

/// Where a stage is on the machine.
pub fn stage_title(stage: Stage) -> &'static str {
    match stage {
        Stage::Regulator => "regulator",
        Stage::PilotValve => "pilot valve",
        Stage::Esv => "emergency shutdown valve",
        Stage::Spool => "control chamber and spool",
        Stage::Servomotor => "main ports and servomotor",
        Stage::Supply => "oil supply",
        Stage::Sensor => "transducers and clocks",
    }
}

/// Where a stage is on the machine, by its id; the id where there is no such stage.
pub fn stage_words(id: &str) -> &str {
    Stage::with_id(id).map_or(id, |stage| stage_title(stage))
}

/// Where it lies, in ids and in words: the stages of several effects that are named together, else the most probable stage.
pub fn place(diagnosis: &Diagnosis) -> Option<(String, String)> {
    let id = |stage: Stage| stage.id().replace('_', " ");
    if diagnosis.verdict == Verdict::Named && diagnosis.blamed.len() > 1 {
        let stages = || Stage::ALL.into_iter().filter(|stage| diagnosis.blamed.iter().any(|one| one.stage == *stage));
        let joined = |of: &dyn Fn(Stage) -> String| stages().map(of).collect::<Vec<_>>().join(" + ");
        return Some((joined(&id), joined(&|stage| stage_title(stage).to_owned())));
    }
    let stage = diagnosis.stage?;
    let share = diagnosis.stages.iter().find(|(at, _)| *at == stage).map_or(f64::NAN, |(_, share)| *share);
    Some((id(stage), format!("{}, probability {}", stage_title(stage), probability(share))))
}

/// An id as words: of an effect, `unknown` or `none`.
pub fn id_words(id: &str) -> String {
    match id {
        "unknown" => "something outside the catalogue".to_owned(),
        "none" => "no effect".to_owned(),
        id => effects::id_words(id),
    }
}

/// What an effect is, without the full stop: from its documentation, or from its owner's definition.
pub fn cause(diagnosis: &Diagnosis, id: &str) -> String {
    let summary = match effects::find(id) {
        Some(spec) => spec.head().summary,
        None => own(diagnosis, id).unwrap_or_default(),
    };
    let first = summary.split(": ").next().unwrap_or_default().trim_end_matches('.');
    if first.is_empty() { id_words(id) } else { first.to_owned() }
}

fn own(diagnosis: &Diagnosis, id: &str) -> Option<String> {
    let all = diagnosis.fitted.own_effects.iter().chain(&diagnosis.refitted.own_effects);
    all.filter(|own| own.id == id).map(|own| own.doc.clone()).next()
}

/// How an effect shows; empty for an effect of the owner's.
pub fn symptom(id: &str) -> String {
    let Some(head) = effects::find(id).map(effects::EffectSpec::head) else { return String::new() };
    let words: Vec<&str> = head.symptom.split(|c: char| c.is_whitespace() || ".,;:/()|".contains(c)).collect();
    let bare = |symbol: &str| symbol.trim_matches(|c| "`*$".contains(c)).to_owned();
    let meant: Vec<String> = head
        .symbols
        .iter()
        .map(|[symbol, meaning, _]| (bare(symbol), meaning))
        .filter(|(symbol, _)| words.contains(&symbol.as_str()))
        // The meaning ends in the parameter's key, which is not shown here.
        .map(|(symbol, meaning)| format!("{symbol}: {}", meaning.split('`').next().unwrap_or_default().trim()))
        .collect();
    let meant = if meant.is_empty() { String::new() } else { format!(" ({})", meant.join("; ")) };
    let text = match head.symptom.strip_prefix("Without it ") {
        Some(rest) => format!("Symptom: compared with a twin without it, {rest}"),
        None => head.symptom.clone(),
    };
    if meant.is_empty() { text } else { format!("{}{meant}.", text.trim_end_matches('.')) }
}

/// The name of a parameter without its unit's suffix.
pub fn parameter_title(parameter: &Fitted) -> String {
    parameter_words(&parameter.name, parameter.unit)
}

/// A parameter's key as words, without the suffix that names its unit.
pub fn parameter_words(key: &str, unit: &str) -> String {
    let spaced: String = unit.chars().map(|c| if c.is_alphanumeric() { c.to_ascii_lowercase() } else { ' ' }).collect();
    let suffix = spaced.split_whitespace().fold(String::new(), |all, word| all + "_" + word);
    key.strip_suffix(suffix.as_str()).unwrap_or(key).replace('_', " ")
}

/// The unit in which a value is shown: shares, and excesses by a share, in percent.
pub fn shown_unit<'a>(key: &str, unit: &'a str) -> &'a str {
    let is_share = ["_share", "extra_ratio", "_excess"].iter().any(|end| key.ends_with(end));
    if unit == "1" && is_share { "pu" } else { unit }
}

/// A size as words: a sheet's group or an effect, and the parameter; `backlash: play`.
pub fn size_words(of: &str, parameter: &str, unit: &str) -> String {
    format!("{}: {}", id_words(of), parameter_words(parameter, unit))
}

/// A sheet's key, or an effect and its parameter, as words: `main ports: overlap`.
pub fn key_words(key: &str) -> String {
    let Some((of, parameter)) = key.split_once('.') else { return key.replace('_', " ") };
    let of_effect = || effects::find(of)?.parameters.iter().find(|one| one.name == parameter).map(|one| one.unit);
    let unit = govtwin_model::parameters::entry(key).map(|entry| entry.unit).or_else(of_effect).unwrap_or_default();
    size_words(of, parameter, unit)
}

/// A sentence with keys of the sheet and ids of effects replaced by readable names; code between backticks stays.
pub fn in_words(text: &str) -> String {
    let is_part = |c: char| c.is_ascii_alphanumeric() || "_.".contains(c);
    let word = |name: &str| {
        let bare = name.trim_end_matches('.');
        let known = govtwin_model::parameters::entry(bare).map(|_| key_words(bare).replace(':', ""));
        let known = known.or_else(|| effects::find(bare).filter(|_| bare.contains('_')).map(|_| id_words(bare)));
        known.map_or_else(|| name.to_owned(), |words| words + &name[bare.len()..])
    };
    let prose = |part: &str| {
        let mut all = String::new();
        let mut rest = part;
        while let Some(at) = rest.find(is_part) {
            let (before, from) = rest.split_at(at);
            let (name, after) = from.split_at(from.find(|c| !is_part(c)).unwrap_or(from.len()));
            all += before;
            all += &word(name);
            rest = after;
        }
        all + rest
    };
    let parts = text.split('`').enumerate();
    parts.map(|(place, part)| if place % 2 == 1 { part.to_owned() } else { prose(part) }).collect::<Vec<_>>().join("`")
}

/// A value with its interval in the unit that people use for it.
pub fn value(parameter: &Fitted) -> String {
    // One unit for the value and its interval.
    let largest = [parameter.value.low, parameter.value.high]
        .into_iter()
        .fold(parameter.value.value.abs(), |most, end| most.max(end.abs()));
    let (scale, unit) = scaled_unit(largest, shown_unit(&parameter.name, parameter.unit));
    let spread = 0.5 * (parameter.value.high - parameter.value.low).abs() * scale;
    let decimals = if spread > 0.0 && spread.is_finite() { (-spread.log10().floor()).clamp(0.0, 6.0) } else { 3.0 };
    let size = (parameter.value.value * scale).abs();
    let number = |value: f64| {
        if size >= 1.0e5 || (size > 0.0 && size < 1.0e-4) {
            return significant(value * scale, 3);
        }
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped before")]
        fixed(value * scale, decimals as usize)
    };
    let Interval { value, low, high } = parameter.value;
    let space = if unit.is_empty() { "" } else { " " };
    format!("{}{space}{unit} [{}, {}]", number(value), number(low), number(high))
}

/// All parameters of an effect in a line.
pub fn values(parameters: &[Fitted]) -> String {
    let one = |parameter: &Fitted| format!("{} {}", parameter_title(parameter), value(parameter));
    parameters.iter().map(one).collect::<Vec<_>>().join(", ")
}

/// `a`, `a and b`, `a, b and c`.
pub fn listed(words: &[String], joint: &str) -> String {
    match words {
        [] => String::new(),
        [one] => one.clone(),
        [most @ .., last] => format!("{} {joint} {last}", most.join(", ")),
    }
}

/// The verdict's name for people.
pub fn verdict_title(verdict: Verdict) -> &'static str {
    match verdict {
        Verdict::Named => "cause found",
        Verdict::Class => "possible causes",
        Verdict::Unknown => "unknown cause",
        Verdict::NoGap => "no fault found",
        Verdict::NotExcited => "too little movement",
        Verdict::NoSuchUnit => "not a servomotor stage",
    }
}

/// The same of a verdict's id; the id where there is no such verdict.
pub fn verdict_words(id: &str) -> &str {
    Verdict::ALL.into_iter().find(|verdict| verdict.id() == id).map_or(id, |verdict| verdict_title(verdict))
}

fn error(gap: &SignalGap, of: impl Fn(&SignalGap) -> f64) -> String {
    match gap.signal {
        Signal::ControlPressure => format!("{} kPa", significant(of(gap) / 1000.0, 2)),
        _ => format!("{} %", significant(100.0 * of(gap), 2)),
    }
}

/// Whether a signal is a result of the twin: what drives a stage on its own has neither an error nor noise.
pub fn is_judged(gap: &SignalGap) -> bool {
    [gap.noise_floor, gap.delivered, gap.refitted].iter().any(|value| *value != 0.0)
}

/// RMS errors of the twins: with the data sheet, recalibrated, with faults, and of noise alone.
pub fn errors(diagnosis: &Diagnosis) -> String {
    let positions = diagnosis.gap.iter().filter(|gap| gap.signal != Signal::ControlPressure && is_judged(gap));
    let said: Vec<String> = positions
        .map(|gap| {
            let steps: [fn(&SignalGap) -> f64; 4] =
                [|g| g.delivered, |g| g.refitted, |g| g.with_effects, |g| g.noise_floor];
            let [sheet, recalibrated, with_faults, noise] = steps.map(|of| error(gap, of));
            let with_faults = match diagnosis.blamed.len() {
                0 => String::new(),
                1 => format!(", {with_faults} with the fault"),
                _ => format!(", {with_faults} with the faults"),
            };
            let (name, title) = (gap.signal.title().to_lowercase(), diagnosis.setup.sheet_title());
            format!("{name} {sheet} with the {title}, {recalibrated} recalibrated{with_faults} (noise alone {noise})")
        })
        .collect();
    if said.is_empty() { String::new() } else { format!("RMS error: {}.", said.join("; ")) }
}

/// The remaining error in multiples of the noise, signal by signal: 1 is a right twin.
pub fn over_noise(diagnosis: &Diagnosis) -> String {
    let known = |gap: &&SignalGap| gap.noise_floor > 0.0 && gap.signal != Signal::ControlPressure;
    let left = |gap: &SignalGap| if diagnosis.blamed.is_empty() { gap.refitted } else { gap.with_effects };
    let of = |(place, gap): (usize, &SignalGap)| {
        let noise = if place == 0 { " noise alone" } else { "" };
        let times = significant(left(gap) / gap.noise_floor, 2);
        format!("{times} times{noise} in the {}", gap.signal.title().to_lowercase())
    };
    let all: Vec<String> = diagnosis.gap.iter().filter(known).enumerate().map(of).collect();
    if all.is_empty() { String::new() } else { format!("The remaining RMS error is {}.", listed(&all, "and")) }
}

/// What the twin with effects is called beside the recalibrated one; none where it has none.
pub fn improved(diagnosis: &Diagnosis) -> Option<&'static str> {
    let nearest = diagnosis.remainder.as_ref().is_some_and(|one| !one.beside.is_empty());
    if diagnosis.blamed.is_empty() { nearest.then_some("with the nearest causes") } else { Some("with faults") }
}

/// What the causes leave and where: `27 % of the error beyond noise remains: look at the main ports and servomotor; it is largest in …`.
pub fn remains(diagnosis: &Diagnosis) -> Option<String> {
    let one = diagnosis.remainder.as_ref().filter(|one| one.share >= LEAST_REMAINDER)?;
    let stage = one.stage.map(|stage| format!("something else at the {} would explain most of it", stage_title(stage)));
    let largest = one.largest.as_ref().map(|at| {
        let signal = at.signal.title().to_lowercase();
        format!("it is largest in {} from {} to {} s, {signal}", at.recording, fixed(at.from_s, 1), fixed(at.to_s, 1))
    });
    let places: Vec<String> = stage.into_iter().chain(largest).collect();
    let places = if places.is_empty() { String::new() } else { format!(": {}", places.join("; ")) };
    let as_well = if one.says_something_else() && !diagnosis.blamed.is_empty() {
        format!(" Something else is at work as well, with a probability of {}.", percent(one.something_else))
    } else {
        String::new()
    };
    Some(format!("{} of the error beyond noise remains{places}.{as_well}", percent(one.share)))
}

/// A text with a capital letter.
pub fn capital(text: &str) -> String {
    let mut chars = text.chars();
    chars.next().map_or_else(String::new, |first| first.to_uppercase().chain(chars).collect())
}

/// A sentence within another: its first letter small, unless it begins with an abbreviation.
fn lower(text: &str) -> String {
    let mut chars = text.chars();
    match (chars.next(), text.chars().nth(1)) {
        (Some(first), Some(second)) if !second.is_uppercase() => first.to_lowercase().chain(chars).collect(),
        _ => text.to_owned(),
    }
}

/// One of several faults, in a paragraph.
pub fn of_several(diagnosis: &Diagnosis, blame: &Blame) -> String {
    let open = if blame.explained_fraction.leaves_all_open() { "a share that is " } else { "" };
    format!(
        "{} ({}, probability {}): {}. Alone it explains {open}{}. {}",
        capital(&id_words(&blame.id)),
        lower(&cause(diagnosis, &blame.id)),
        probability(blame.probability),
        values(&blame.parameters),
        percents(blame.explained_fraction),
        symptom(&blame.id)
    )
}

/// The note that the named effects are probably not all.
pub fn besides(diagnosis: &Diagnosis) -> Option<String> {
    let named = matches!(diagnosis.verdict, Verdict::Named | Verdict::Class);
    let unknown = diagnosis.ranking.iter().find(|ranked| ranked.id == "unknown" && ranked.probability > 0.5);
    unknown.filter(|_| named).map(|unknown| {
        format!(
            "another cause outside the catalogue is probable ({}): the named effects leave more than noise and equation error.",
            probability(unknown.probability)
        )
    })
}
