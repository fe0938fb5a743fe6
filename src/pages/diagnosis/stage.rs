//! What was fitted of a servomotor stage alone, and what plain models make of it, in words.

use govtwin_diagnosis::result::{
    ComparedModel, Diagnosis, Interval, ModelParameter, Setup, StageFigure, StageOnly, Verdict,
};
use govtwin_diagnosis::words::id_words;
use govtwin_model::number::significant;

/// What was fitted of a stage alone, in a sentence.
pub(crate) fn fitted_stage(diagnosis: &Diagnosis) -> Option<String> {
    let figures = &diagnosis.part.as_ref()?.figures;
    let said: Vec<String> = figures.iter().map(|one| format!("{} {}", one.title, figure_text(one))).collect();
    (!said.is_empty()).then(|| format!("Fitted stage, in the units of the recordings: {}.", said.join("; ")))
}

/// Value, interval and unit of a figure of a fitted stage.
pub fn figure_text(one: &StageFigure) -> String {
    let Interval { value, low, high } = one.value;
    let [value, low, high] = [value, low, high].map(|number| significant(number, 3));
    format!("{value} [{low}, {high}] {}", one.unit)
}

/// The plain model that predicts better than the twin, as an engineer would state it; none where none does.
pub(crate) fn plain_wins(diagnosis: &Diagnosis) -> Option<String> {
    let part = diagnosis.part.as_ref()?;
    let twins = part.models.iter().filter(|model| !model.is_plain);
    let twin = twins.min_by(|a, b| a.held_out.total_cmp(&b.held_out))?;
    plain_beside(part, part.plain_wins.as_ref()?, twin, "A plain model predicts better than the twin.")
}

/// What is left to say beside a plain model that wins, where nothing is named; none where none wins.
pub(crate) fn beside_plain(diagnosis: &Diagnosis) -> Option<String> {
    diagnosis.part.as_ref()?.plain_wins.as_ref()?;
    Some("No fault is named: the catalogue's stage explains the movement less well than that.".to_owned())
}

/// A stage without a fault, of which nothing was known before, and its dead band; none with a data sheet, which may be off.
pub(crate) fn sound_stage(diagnosis: &Diagnosis) -> Option<String> {
    if diagnosis.setup != Setup::StageFree {
        return None;
    }
    let figures = diagnosis.part.iter().flat_map(|part| &part.figures);
    let band = figures.filter(|one| one.id == "dead_band");
    let band: String = band.map(|one| format!(", with a dead band of {},", figure_text(one))).collect();
    Some(format!("No fault found: a stage that is equal in both directions{band} explains the movement."))
}

/// The plain model of the stage's own law that errs less than the twin of the verdict; none where there is none.
pub(crate) fn plain_as_good(diagnosis: &Diagnosis) -> Option<String> {
    let part = diagnosis.part.as_ref()?;
    let blamed: Vec<&str> = diagnosis.blamed.iter().map(|one| one.id.as_str()).collect();
    let effects = match diagnosis.verdict {
        Verdict::Named => blamed.join(" + "),
        Verdict::Class => blamed.first().copied().unwrap_or_default().to_owned(),
        _ => String::new(),
    };
    let twin = part.models.iter().find(|model| !model.is_plain && model.model == effects)?;
    let plain = part.plain_as_good.as_ref()?;
    let settles = part.models.iter().any(|model| model.model == *plain && settling(part, model).is_some());
    let first = if settles {
        "A law of the set point alone predicts no worse."
    } else {
        "The same law more plainly, predicting no worse."
    };
    plain_beside(part, plain, twin, first)
}

/// A plain model beside a twin, after a first sentence.
fn plain_beside(part: &StageOnly, name: &str, twin: &ComparedModel, first: &str) -> Option<String> {
    let plain = part.models.iter().find(|model| model.is_plain && model.model == name)?;
    let told = settling(part, plain).unwrap_or_else(|| format!("{}: {}.", plain.model, parameter_text(plain)));
    let [ours, theirs] = [plain, twin].map(|model| significant(100.0 * model.held_out, 3));
    Some(format!(
        "{first} {} In free runs of {} s over held-out pieces its RMS error is {ours} % of the stroke, that of the \
         stage ({}) {theirs} %.",
        govtwin_diagnosis::words::capital(&told),
        significant(part.free_run_s, 3),
        model_title(twin)
    ))
}

/// A model whose position settles to a line over what drives it, in a sentence; none of another.
fn settling(part: &StageOnly, model: &ComparedModel) -> Option<String> {
    let of = |name: &str| model.parameters.iter().find(|one| one.name == name).map(|one| one.value);
    let (gain, level, lag_s) = (of("gain")?, of("level")?, of("lag")?);
    let number = |value: f64| significant(value, 3);
    let subject = if part.driven_by == "command" { "a position loop: the position" } else { "the position" };
    let sign = if level < 0.0 { "−" } else { "+" };
    let delay = of("delay").filter(|delay_s| *delay_s > 0.0);
    let delay = delay.map_or_else(String::new, |delay_s| format!("a delay of {} s and ", number(delay_s)));
    let limits: Vec<String> = [("rises", of("rate limit, rising")), ("falls", of("rate limit, falling"))]
        .into_iter()
        .filter_map(|(verb, limit)| Some(format!("{verb} by at most {} per second", number(limit?))))
        .collect();
    let play = of("backlash or dead band, full width").map_or_else(String::new, |width| {
        let [half, width] = [0.5 * width, width].map(number);
        format!("; it stops {half} short of that from either side, by backlash or a dead band of {width}")
    });
    let integral = of("integral time")
        .map_or_else(String::new, |time_s| format!(" and integral action (integral time {} s)", number(time_s)));
    let valve = of("lag of the valve")
        .map_or_else(String::new, |time_s| format!(", a lag of {} s of the valve inside the loop", number(time_s)));
    let forward = of("feed-forward of speed").map_or_else(String::new, |share| {
        format!(", and {} % of the command's speed fed forward", number(100.0 * share))
    });
    let limits = if limits.is_empty() { String::new() } else { format!("; it {}", limits.join(" and ")) };
    let derivative = if integral.is_empty() && valve.is_empty() {
        ""
    } else {
        " Derivative action would lengthen the loop's lag and shorten the valve's: it is not told from them."
    };
    Some(format!(
        "{subject} follows {} × {} {sign} {} with {delay}a lag of {} s{integral}{valve}{forward}{limits}{play} (units of the \
         recordings).{derivative}",
        number(gain),
        part.driven_by,
        number(level.abs()),
        number(lag_s)
    ))
}

/// What a model in free runs is called.
pub(crate) fn model_title(model: &ComparedModel) -> String {
    match model.model.as_str() {
        "" => "no effect".to_owned(),
        plain if model.is_plain => plain.to_owned(),
        effects => format!("with {}", id_words(effects)),
    }
}

/// The parameters of a plain model.
pub(crate) fn parameter_text(model: &ComparedModel) -> String {
    let of = |one: &ModelParameter| {
        let [value, low, high] = [one.value, one.ends.0, one.ends.1].map(|value| significant(value, 3));
        let ends = if one.ends.0.is_finite() { format!(" [{low}, {high}]") } else { String::new() };
        format!("{} {value}{ends} {}", one.name, one.unit)
    };
    model.parameters.iter().map(of).collect::<Vec<_>>().join("; ")
}
