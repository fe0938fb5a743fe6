//! What a watched unit shows, as messages: verdict and sizes of faults for programs, and `/diagnostics` for monitors.

use ros2_client::{Publisher, WriteError};

use super::bus::{Bus, BusError};
use super::diagnostics::{self, DiagnosticArray, DiagnosticStatus};
use super::process_recorder::{Hearing, Listening};
use super::realtime::wall_ns;
use govtwin_bag::msg::{FaultSize, Header, Interface, Time, UnitVerdict};
use govtwin_diagnosis::watch::history::{Course, ProcessEntry, ProcessSize};
use govtwin_diagnosis::words::shown_unit;
use govtwin_model::number::quantity;

/// Where the verdict is published.
pub(crate) const TOPIC: &str = "~/verdict";

/// What the counts of samples are called, in the order of [`Stream::ALL`](govtwin_bag::Stream::ALL).
const SAMPLES: [&str; 4] = ["command samples", "esv samples", "tank_pressure samples", "servo_state samples"];

/// What the history shows after the process that was entered last; none before the first.
pub fn verdict(unit: &str, entries: &[ProcessEntry], courses: &[Course]) -> Option<UnitVerdict> {
    let newest = entries.last()?;
    let size = |course: &Course| -> Option<FaultSize> {
        let (last, point) = (course.estimates.last()?, course.points.last()?);
        let entry = entries.get(*course.entries.last()?)?;
        let of_course = |size: &&ProcessSize| size.effect == course.effect && size.parameter == course.parameter;
        Some(FaultSize {
            stamp: Time::from_nanos(entry.time_ns),
            process: entry.process.clone(),
            effect: course.effect.clone(),
            parameter: course.parameter.clone(),
            unit: course.unit.clone(),
            value: last.size,
            low: last.low,
            high: last.high,
            named: entry.sizes.iter().find(of_course).is_some_and(|size| size.named),
            mean_before: point.mean,
            growth: point.sums.growth,
            shrinkage: point.sums.shrinkage,
            limit: course.limit,
            moved: point.alarm,
        })
    };
    Some(UnitVerdict {
        header: Header { stamp: Time::from_nanos(newest.time_ns), frame_id: unit.to_owned() },
        process: newest.process.clone(),
        duration: newest.duration_s,
        verdict: newest.verdict.clone(),
        closure: newest.explained_fraction.unwrap_or(f64::NAN),
        sizes: courses.iter().filter_map(size).collect(),
        warnings: courses.iter().filter_map(Course::warning).collect(),
        processes: u32::try_from(entries.len()).unwrap_or(u32::MAX),
    })
}

/// The report of one second: what is heard, where anything is listened to; the verdict; and each size that is followed.
pub(crate) fn report(
    node: &str,
    unit: &str,
    time_ns: i64,
    verdict: Option<&UnitVerdict>,
    listening: Option<&Listening>,
) -> DiagnosticArray {
    let status = |part: &str, level: u8, message: String, values: Vec<(&str, String)>| DiagnosticStatus {
        hardware_id: unit.to_owned(),
        ..DiagnosticStatus::new(node, part, level, message, values)
    };
    let mut all = vec![];
    if let Some(heard) = listening {
        let (level, message) = match heard.hearing {
            _ if heard.left_out > 0 => (1, format!("processes not recorded, or not to their end: {}", heard.left_out)),
            Hearing::Nothing => (3, "no measured state is heard".to_owned()),
            Hearing::Rest => (0, "the unit rests".to_owned()),
            Hearing::Process => (0, "a process is being recorded".to_owned()),
        };
        let mut values = vec![
            ("processes recorded", heard.processes.to_string()),
            ("recordings that wait to be diagnosed", heard.waiting.to_string()),
            ("samples lost on the way", heard.lost.to_string()),
        ];
        for (key, (came, refused)) in SAMPLES.into_iter().zip(heard.samples) {
            let value = if refused > 0 { format!("{came}, of which refused {refused}") } else { came.to_string() };
            values.push((key, value));
        }
        all.push(status("listening", level, message, values));
    }
    let Some(said) = verdict else {
        all.push(status("verdict", 0, "no process has been diagnosed yet".to_owned(), vec![]));
        return DiagnosticArray { header: Header::at(time_ns), status: all };
    };
    let message = match said.warnings.first() {
        Some(first) => first.clone(),
        None => format!("{} in {}; no size has moved", said.verdict, said.process),
    };
    let mut values = vec![
        ("verdict", said.verdict.clone()),
        ("process", said.process.clone()),
        ("processes in the history", said.processes.to_string()),
    ];
    if said.closure.is_finite() {
        values.push(("closed share of the gap", format!("{:.3}", said.closure)));
    }
    all.push(status("verdict", u8::from(!said.warnings.is_empty()), message, values));
    for size in &said.sizes {
        let of = |value: f64| quantity(value, shown_unit(&size.parameter, &size.unit));
        let message = if size.moved {
            let verb = if size.growth >= size.shrinkage { "has grown" } else { "has shrunk" };
            format!("{verb}: {}, {} before", of(size.value), of(size.mean_before))
        } else {
            format!("{}: stays", of(size.value))
        };
        let values = vec![
            ("value", of(size.value)),
            ("interval of nine in ten", format!("{} to {}", of(size.low), of(size.high))),
            ("mean before", of(size.mean_before)),
            ("sum for growth [sd]", format!("{:.2}", size.growth)),
            ("sum for shrinkage [sd]", format!("{:.2}", size.shrinkage)),
            ("limit of the sums [sd]", format!("{:.2}", size.limit)),
            ("process", size.process.clone()),
            ("named by the verdict", size.named.to_string()),
        ];
        all.push(status(&format!("{}.{}", size.effect, size.parameter), u8::from(size.moved), message, values));
    }
    DiagnosticArray { header: Header::at(time_ns), status: all }
}

/// Publishes verdict and diagnostics.
pub struct Herald {
    verdict: Publisher<UnitVerdict>,
    health: Publisher<DiagnosticArray>,
    node: String,
    unit: String,
    newest: Option<UnitVerdict>,
    untold: Option<UnitVerdict>,
}

impl Herald {
    /// Opens both publishers.
    ///
    /// # Errors
    /// When DDS refuses one.
    pub fn open(bus: &mut Bus, unit: &str) -> Result<Self, BusError> {
        Ok(Self {
            verdict: bus.publish_kept(TOPIC, UnitVerdict::TYPE_NAME)?,
            health: bus.publish("/diagnostics", diagnostics::TYPE_NAME)?,
            node: bus.arguments().full_name(),
            unit: unit.to_owned(),
            newest: None,
            untold: None,
        })
    }

    /// Takes a new verdict, which goes out with the next second.
    pub fn take(&mut self, verdict: UnitVerdict) {
        self.newest = Some(verdict.clone());
        self.untold = Some(verdict);
    }

    /// Publishes what is due once a second. What DDS does not take goes out a second later.
    pub fn second(&mut self, listening: Option<&Listening>) {
        if let Some(verdict) = self.untold.take()
            && let Err(WriteError::WouldBlock { data }) = self.verdict.publish(verdict)
        {
            self.untold = Some(data);
        }
        let report = report(&self.node, &self.unit, wall_ns(), self.newest.as_ref(), listening);
        // A report that is lost is followed by another.
        let _ = self.health.publish(report);
    }
}

#[cfg(test)]
mod tests {
    use super::{Hearing, Listening, report, verdict};
    use govtwin_bag::msg::Time;
    use govtwin_diagnosis::watch::history::{ProcessEntry, ProcessSize, SCHEMA, courses};

    fn entries(count: u32, play_pu: impl Fn(u32) -> f64) -> Vec<ProcessEntry> {
        let entry = |i: u32| {
            let value = play_pu(i) + 2e-5 * (f64::from(i * 7 % 5) - 2.0);
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
                digest: i.to_string(),
                bag: "a".into(),
                synthetic: false,
                origin: None,
                time_ns: 1_000_000_000 * i64::from(i),
                duration_s: 40.0,
                process: "startup".into(),
                verdict: "named".into(),
                explained_fraction: None,
                sizes: vec![size],
                notes: vec![],
                warnings: vec![],
                program: "govtwin".into(),
            }
        };
        (0..count).map(entry).collect()
    }

    #[test]
    fn a_size_that_moved_is_in_the_message_and_warns_in_diagnostics() {
        let entries = entries(30, |i| 2e-3 + 2e-5 * f64::from(i.saturating_sub(15)));
        let said = verdict("unit3", &entries, &courses(&entries, 1000.0)).unwrap();
        assert_eq!((said.header.frame_id.as_str(), said.verdict.as_str(), said.processes), ("unit3", "named", 30));
        assert_eq!(said.header.stamp, Time { sec: 29, nanosec: 0 });
        assert!(said.closure.is_nan() && said.warnings[0].starts_with("Backlash has grown"));
        let size = &said.sizes[0];
        assert!(size.moved && size.named && size.growth >= size.limit && size.mean_before < size.low);
        assert!((size.value - 2.28e-3).abs() < 5e-5 && size.low < size.value && size.value < size.high);
        let array = report("/govtwin_watch", "unit3", 5, Some(&said), None);
        let shown: Vec<_> = array.status.iter().map(|status| (status.name.as_str(), status.level)).collect();
        assert_eq!(shown, [("/govtwin_watch: verdict", 1), ("/govtwin_watch: backlash.play_pu", 1)]);
        assert!(array.status.iter().all(|status| status.hardware_id == "unit3"));
        let value = |key: &str| array.status[1].values.iter().find(|one| one.key == key).unwrap().value.clone();
        assert!(
            value("interval of nine in ten").contains(" to ") && value("limit of the sums [sd]").parse::<f64>().is_ok()
        );
    }

    #[test]
    fn a_size_that_stays_is_ok_and_one_that_the_newest_process_does_not_show_keeps_its_own_time() {
        assert_eq!(verdict("unit3", &[], &[]), None);
        let mut entries = entries(21, |_| 2e-3);
        entries[20].sizes.clear();
        let said = verdict("unit3", &entries, &courses(&entries, 1000.0)).unwrap();
        assert_eq!((said.header.stamp.sec, said.sizes[0].stamp.sec, said.sizes[0].moved), (20, 19, false));
        let heard = Listening { hearing: Hearing::Rest, lost: 3, ..Listening::default() };
        let array = report("/w", "unit3", 5, Some(&said), Some(&heard));
        let levels: Vec<u8> = array.status.iter().map(|status| status.level).collect();
        assert_eq!(levels, [0, 0, 0]);
        assert!(array.status[0].values.iter().any(|one| one.key == "samples lost on the way" && one.value == "3"));
    }

    #[test]
    fn silence_is_stale_and_a_process_that_was_not_recorded_warns() {
        let array = report("/w", "u", 5, None, Some(&Listening::default()));
        assert_eq!((array.status[0].level, array.status[1].message.as_str()), (3, "no process has been diagnosed yet"));
        let left_out = Listening { left_out: 1, ..Listening::default() };
        assert_eq!(report("/w", "u", 5, None, Some(&left_out)).status[0].level, 1);
    }
}
