//! The history of one unit: a line of JSON for each process, and the charts of all sizes over it.

use serde::{Deserialize, Serialize};

use crate::result::{Diagnosis, Fitted, Verdict};
use crate::trend::{ChartPoint, SizeEstimate, chart, limit};
use crate::words::{capital, id_words, parameter_words, shown_unit, size_words};
use govtwin_model::parameters::ENTRIES;
use govtwin_model::provenance;
use govtwin_model::recording::Process;

/// The schema of a line.
pub const SCHEMA: &str = "govtwin-watch/1";

/// One parameter of one effect, as one process shows it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ProcessSize {
    /// The effect.
    pub effect: String,
    /// Its parameter.
    pub parameter: String,
    /// The parameter's unit.
    pub unit: String,
    /// Value.
    pub value: f64,
    /// Interval of nine in ten.
    pub ci90: [f64; 2],
    /// Whether the verdict names the effect; otherwise it was fitted alone, for the sake of its history.
    pub named: bool,
}

/// What one process showed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ProcessEntry {
    /// [`SCHEMA`].
    pub schema: String,
    /// Digest of the process's rows: no process is entered twice.
    pub digest: String,
    /// The bag that it was cut from.
    pub bag: String,
    /// Whether bag or folder state that it was simulated.
    #[serde(default)]
    pub synthetic: bool,
    /// The origin that bag or folder state.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub origin: Option<String>,
    /// When it began, ns since 1970.
    pub time_ns: i64,
    /// How long it is, s.
    pub duration_s: f64,
    /// `startup`, `load_increase`, `shutdown` or `load_rejection`.
    pub process: String,
    /// The verdict's word, or `not_diagnosed`.
    pub verdict: String,
    /// Share of the gap that the effects close; null where there is none.
    #[serde(rename = "closure")]
    pub explained_fraction: Option<f64>,
    /// Sizes of effects.
    pub sizes: Vec<ProcessSize>,
    /// What a reader must know, such as why there is no diagnosis.
    pub notes: Vec<String>,
    /// What was wrong with this process when it was entered, in sentences.
    pub warnings: Vec<String>,
    /// The program that entered it.
    pub program: String,
}

/// One size over all processes.
#[derive(Clone, Debug, PartialEq)]
pub struct Course {
    /// The effect.
    pub effect: String,
    /// Its parameter.
    pub parameter: String,
    /// The parameter's unit.
    pub unit: String,
    /// Indices of the entries that have it.
    pub entries: Vec<usize>,
    /// The estimates there.
    pub estimates: Vec<SizeEstimate>,
    /// The chart over them.
    pub points: Vec<ChartPoint>,
    /// The limit of its sums, standard deviations.
    pub limit: f64,
}

/// A line that is no entry.
#[derive(Debug, thiserror::Error)]
#[error("line {line}: {reason}")]
pub struct HistoryError {
    /// Counted from 1.
    pub line: usize,
    /// Why.
    pub reason: String,
}

/// Reads a history. A last line without its end was being written when the process was killed: it is left out, and the result is `true`.
///
/// # Errors
/// Where any other line is no entry of this schema.
pub fn read(text: &str) -> Result<(Vec<ProcessEntry>, bool), HistoryError> {
    let (whole, torn) = match text.rsplit_once('\n') {
        Some((whole, rest)) => (whole, !rest.trim().is_empty()),
        None => ("", !text.trim().is_empty()),
    };
    let mut entries = vec![];
    for (i, line) in whole.lines().enumerate().filter(|(_, line)| !line.trim().is_empty()) {
        let wrong = |reason: String| HistoryError { line: i + 1, reason };
        let entry: ProcessEntry = serde_json::from_str(line).map_err(|error| wrong(error.to_string()))?;
        if entry.schema != SCHEMA {
            return Err(wrong(format!("expected the schema {SCHEMA}, found `{}`", entry.schema)));
        }
        entries.push(entry);
    }
    Ok((entries, torn))
}

/// A history as text.
///
/// # Errors
/// Where a number has no place in JSON.
pub fn write(entries: &[ProcessEntry]) -> Result<String, serde_json::Error> {
    entries.iter().map(|entry| Ok(serde_json::to_string(entry)? + "\n")).collect()
}

/// The sizes that a diagnosis shows: of what it names, and of effects in `followed`, whose history goes on where they were fitted alone.
pub fn sizes(diagnosis: &Diagnosis, followed: &[String]) -> Vec<ProcessSize> {
    let of = |effect: &str, fitted: &Fitted, named: bool| ProcessSize {
        effect: effect.to_owned(),
        parameter: fitted.name.rsplit('.').next().unwrap_or_default().to_owned(),
        unit: fitted.unit.to_owned(),
        value: fitted.value.value,
        ci90: [fitted.value.low, fitted.value.high],
        named,
    };
    let is_named = diagnosis.verdict == Verdict::Named;
    let mut sizes: Vec<ProcessSize> = vec![];
    for blame in &diagnosis.blamed {
        if is_named || followed.contains(&blame.id) {
            sizes.extend(blame.parameters.iter().map(|fitted| of(&blame.id, fitted, is_named)));
        }
    }
    for id in followed.iter().filter(|id| diagnosis.blamed.iter().all(|blame| blame.id != **id)) {
        let alone = diagnosis.tried.iter().find(|tried| tried.ids.len() == 1 && tried.ids[0] == *id);
        let effect = |fitted: &&Fitted| !ENTRIES.iter().any(|entry| entry.key == fitted.name);
        let own = alone.iter().flat_map(|tried| tried.parameters.iter().filter(effect));
        sizes.extend(own.map(|fitted| of(id, fitted, false)));
    }
    let known = |size: &ProcessSize| size.value.is_finite() && size.ci90.iter().all(|end| end.is_finite());
    sizes.retain(known);
    sizes
}

/// Effects that any entry names.
pub fn followed(entries: &[ProcessEntry]) -> Vec<String> {
    let mut ids: Vec<String> = vec![];
    for size in entries.iter().flat_map(|entry| &entry.sizes).filter(|size| size.named) {
        if !ids.contains(&size.effect) {
            ids.push(size.effect.clone());
        }
    }
    ids
}

/// The course of every size, each process compared with those of its kind, with so many processes between two false alarms of each.
pub fn courses(entries: &[ProcessEntry], between_false_alarms: f64) -> Vec<Course> {
    let mut order: Vec<usize> = (0..entries.len()).collect();
    order.sort_by_key(|&i| entries[i].time_ns);
    let mut courses: Vec<Course> = vec![];
    for i in order {
        for size in &entries[i].sizes {
            let same = |course: &&mut Course| course.effect == size.effect && course.parameter == size.parameter;
            let place = courses.iter_mut().find(same);
            let group = group(&entries[i].process);
            let estimate = SizeEstimate { size: size.value, low: size.ci90[0], high: size.ci90[1], group };
            if let Some(course) = place {
                course.entries.push(i);
                course.estimates.push(estimate);
            } else {
                courses.push(Course {
                    effect: size.effect.clone(),
                    parameter: size.parameter.clone(),
                    unit: size.unit.clone(),
                    entries: vec![i],
                    estimates: vec![estimate],
                    points: vec![],
                    limit: limit(between_false_alarms),
                });
            }
        }
    }
    for course in &mut courses {
        course.points = chart(&course.estimates, between_false_alarms);
    }
    courses
}

/// The origins of the processes that bags and folders state, each once.
pub fn origins(entries: &[ProcessEntry]) -> Vec<&str> {
    provenance::origins(entries.iter().map(|entry| (entry.synthetic, entry.origin.as_deref())))
}

/// The kinds of process, by which sizes differ although nothing moves: a process shows a fault by those of its movements that it has.
fn group(process: &str) -> usize {
    Process::ALL.iter().position(|kind| kind.id() == process).unwrap_or(Process::ALL.len())
}

impl Course {
    /// The kind of process of an estimate, as a word of the history.
    pub fn kind(&self, k: usize) -> &'static str {
        Process::ALL.get(self.estimates[k].group).map_or("process", |kind| kind.id())
    }

    /// The same for people.
    fn kind_words(&self, k: usize) -> &'static str {
        Process::ALL.get(self.estimates[k].group).map_or("process", |kind| kind.title())
    }

    /// The size by words: the fault and, without its unit, the parameter.
    pub fn title(&self) -> String {
        size_words(&self.effect, &self.parameter, &self.unit)
    }

    /// The warning that it has moved; none if it has not.
    pub fn warning(&self) -> Option<String> {
        let (point, last) = (self.points.last()?, self.estimates.last()?);
        let since = point.since.filter(|_| point.alarm)?;
        let verb = if point.sums.is_growth() { "has grown" } else { "has shrunk" };
        let unit = shown_unit(&self.parameter, &self.unit);
        let quantity = |value: f64| govtwin_model::number::quantity(value, unit);
        let count = self.estimates.len() - since;
        Some(format!(
            "{} {verb}: the {} is {} ({} to {}) in the last {}, earlier it was {} there; {}",
            capital(&id_words(&self.effect)),
            parameter_words(&self.parameter, &self.unit),
            quantity(last.size),
            quantity(last.low),
            quantity(last.high),
            self.kind_words(self.estimates.len() - 1),
            quantity(point.mean),
            if count == 1 {
                "the change began with this process".to_owned()
            } else {
                format!("the change began {count} processes ago")
            },
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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

    #[test]
    fn a_history_reads_back_and_a_torn_line_is_left_out() {
        let entries: Vec<ProcessEntry> = (0..3).map(|i| entry(i, 2e-3)).collect();
        let text = write(&entries).unwrap();
        assert_eq!(read(&text).unwrap(), (entries.clone(), false));
        let torn = &text[..text.len() - 20];
        assert_eq!(read(torn).unwrap(), (entries[..2].to_vec(), true));
        assert_eq!(read("").unwrap(), (vec![], false));
        let error = read("{}\n").unwrap_err().to_string();
        assert!(error.starts_with("line 1: missing field"), "{error}");
        let other = text.replace(SCHEMA, "govtwin-watch/9");
        assert!(read(&other).unwrap_err().to_string().contains("expected the schema govtwin-watch/1"));
    }

    #[test]
    fn a_size_that_grows_is_told_with_its_interval_and_one_that_stays_is_not() {
        let wiggle = |i: i64| 2e-5 * ((i * 7 % 5) as f64 - 2.0);
        let still: Vec<ProcessEntry> = (0..30).map(|i| entry(i, 2e-3 + wiggle(i))).collect();
        assert!(courses(&still, 1000.0)[0].warning().is_none());
        let grows: Vec<ProcessEntry> =
            (0..30).map(|i| entry(i, 2e-3 + wiggle(i) + 2e-5 * (i - 15).max(0) as f64)).collect();
        let said = courses(&grows, 1000.0)[0].warning().unwrap();
        assert!(said.starts_with("Backlash has grown: the play is 0.2"), "{said}");
        assert!(
            said.contains(" in the last start-up, earlier it was ") && said.contains("the change began 1"),
            "{said}"
        );
        assert_eq!(followed(&grows), ["backlash"]);
        // Order in the file does not matter: bags may come late.
        let mut late = grows.clone();
        late.swap(3, 20);
        assert_eq!(courses(&late, 1000.0)[0].warning().unwrap(), said);
    }
}
