//! The ladder of a replay: what a refit, a named effect and a learned residual each leave of the gap, process by process.
//!
//! A black box that is trained on all processes may look as good as the effect that it hides. On a process that was left out of its
//! training the two part: an effect is a law and carries over, what trees learned elsewhere may not.

use serde::Serialize;

use super::figures::RecordingGroup;
use crate::recording::Process;
use crate::signal::Signal;

/// One rung: a unit, or a learned residual on top of one.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Rung {
    /// What tables call it.
    pub title: String,
    /// The model's file, where it is a residual; `null` for a unit alone.
    pub model: Option<String>,
    /// Ids of processes that were left out of the residual's training.
    pub unseen: Vec<String>,
    /// Process by process, those that occur.
    pub processes: Vec<RecordingGroup>,
    /// Everything.
    pub overall: RecordingGroup,
}

/// All rungs, the unit as given first, then units, then residuals.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Ladder {
    /// Id of the signal that is evaluated.
    pub signal: &'static str,
    /// The rungs.
    pub rungs: Vec<Rung>,
    /// The findings, in sentences.
    pub findings: Vec<String>,
}

impl Rung {
    /// Mean absolute error of a process, or overall; the coefficient's unit is the signal's.
    pub fn mae(&self, process: Option<Process>, signal: Signal) -> Option<f64> {
        let group = match process {
            Some(process) => self.processes.iter().find(|group| group.process == Some(process.id()))?,
            None => &self.overall,
        };
        group.of(signal).map(|figures| figures.mae).filter(|mae| mae.is_finite())
    }

    fn has_not_seen(&self, process: Process) -> bool {
        self.unseen.iter().any(|id| id == process.id())
    }
}

impl Ladder {
    /// A ladder with its findings.
    pub fn new(signal: Signal, rungs: Vec<Rung>) -> Self {
        let findings = Process::ALL.into_iter().filter_map(|process| finding(signal, &rungs, process)).collect();
        Self { signal: signal.id(), rungs, findings }
    }

    /// The signal that is evaluated.
    pub fn judged(&self) -> Signal {
        Signal::with_id(self.signal).unwrap_or(Signal::SpoolPosition)
    }

    /// The processes that occur, in their usual order.
    pub fn processes(&self) -> Vec<Process> {
        let first = self.rungs.first();
        let occurs = |process: &Process| {
            first.is_some_and(|rung| rung.processes.iter().any(|group| group.process == Some(process.id())))
        };
        Process::ALL.into_iter().filter(occurs).collect()
    }
}

/// The finding of a process that a residual was not trained on: the best unit's reduction beside that of the residual.
fn finding(signal: Signal, rungs: &[Rung], process: Process) -> Option<String> {
    let delivered = rungs.first()?.mae(Some(process), signal)?;
    let units = rungs.iter().skip(1).filter(|rung| rung.model.is_none());
    let rated = units.filter_map(|rung| Some((rung, rung.mae(Some(process), signal)?)));
    let (unit, of_unit) = rated.min_by(|a, b| a.1.total_cmp(&b.1))?;
    let reduction = |mae: f64| 100.0 * (1.0 - mae / delivered);
    let mut said = vec![];
    for boxed in rungs.iter().filter(|rung| rung.model.is_some() && rung.has_not_seen(process)) {
        let mae = boxed.mae(Some(process), signal)?;
        let verdict = if mae > delivered {
            "it makes the twin worse in this process"
        } else if mae > 1.25 * of_unit {
            "what it learned in other processes does not replace the better unit"
        } else if mae < 0.8 * of_unit {
            "it corrects an error that the better unit does not"
        } else {
            "the two are about equal"
        };
        said.push(format!("“{}” removes {:.0} % of the error: {verdict}", boxed.title, reduction(mae)));
    }
    (!said.is_empty()).then(|| {
        format!(
            "{} was left out of training. There “{}” removes {:.0} % of the error; {}.",
            capitalised(process.title()),
            unit.title,
            reduction(of_unit),
            said.join("; ")
        )
    })
}

fn capitalised(words: &str) -> String {
    let mut letters = words.chars();
    letters.next().map_or_else(String::new, |first| first.to_uppercase().chain(letters).collect())
}

#[cfg(test)]
mod tests {
    use super::{Ladder, Rung};
    use crate::recording::Process;
    use crate::replay::figures::RecordingGroup;
    use crate::replay::figures::SignalFigures;
    use crate::signal::Signal;

    fn group(process: Option<&'static str>, mae: f64) -> RecordingGroup {
        let figures = SignalFigures {
            name: Signal::SpoolPosition.id(),
            unit: "pu",
            stands_in: false,
            rows: 10,
            left_out: 0,
            mae,
            rmse: mae,
            r2: 0.5,
            bias: 0.0,
            max_abs: mae,
        };
        RecordingGroup { process, recordings: 1, signals: vec![figures] }
    }

    fn rung(title: &str, model: bool, [startup, rejection]: [f64; 2]) -> Rung {
        Rung {
            title: title.into(),
            model: model.then(|| "m.residual".into()),
            unseen: if model { vec!["load_rejection".into()] } else { vec![] },
            processes: vec![group(Some("startup"), startup), group(Some("load_rejection"), rejection)],
            overall: group(None, 0.5 * (startup + rejection)),
        }
    }

    #[test]
    fn only_the_process_left_out_of_training_tells_a_law_from_a_memory() {
        let of = |boxed: [f64; 2]| {
            let rungs =
                vec![rung("a", false, [0.04, 0.04]), rung("b", false, [0.01, 0.01]), rung("a + m", true, boxed)];
            Ladder::new(Signal::SpoolPosition, rungs)
        };
        let ladder = of([0.009, 0.03]);
        assert_eq!(ladder.processes(), [Process::Startup, Process::LoadRejection]);
        assert_eq!(ladder.findings.len(), 1);
        let said = &ladder.findings[0];
        assert!(said.starts_with("Load rejection was left out of training. There “b” removes 75 %"), "{said}");
        assert!(
            said.contains("“a + m” removes 25 % of the error: what it learned in other processes does not replace"),
            "{said}"
        );
        assert!(of([0.009, 0.05]).findings[0].contains("makes the twin worse in this process"));
        assert!(of([0.009, 0.0105]).findings[0].contains("about equal"));
        assert!(of([0.009, 0.002]).findings[0].contains("corrects an error that the better unit does not"));
        let rungs = ladder.rungs[..2].to_vec();
        assert!(Ladder::new(Signal::SpoolPosition, rungs).findings.is_empty());
    }
}
