//! `/diagnostics`: the node's health once a second, as ROS 2 monitors read it.

use serde::{Deserialize, Serialize};

use super::control::RunState;
use super::core::{NodeInput, Policies};
use super::health::{Health, HealthFlags};
use super::intake::{Refusal, TopicCounts};
use super::integration::TickOutput;
use govtwin_bag::msg::Header;
use govtwin_model::units::seconds_from_nanos;

/// Full name of [`DiagnosticArray`].
pub const TYPE_NAME: &str = "diagnostic_msgs/msg/DiagnosticArray";

/// `diagnostic_msgs/msg/KeyValue`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct KeyValue {
    /// What.
    pub key: String,
    /// How much.
    pub value: String,
}

/// `diagnostic_msgs/msg/DiagnosticStatus`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct DiagnosticStatus {
    /// 0 ok, 1 warning, 2 error, 3 stale.
    pub level: u8,
    /// Component.
    pub name: String,
    /// One line.
    pub message: String,
    /// Device.
    pub hardware_id: String,
    /// Figures.
    pub values: Vec<KeyValue>,
}

impl DiagnosticStatus {
    /// The state of a node's part.
    pub(super) fn new(node: &str, part: &str, level: u8, message: String, values: Vec<(&str, String)>) -> Self {
        Self {
            level,
            name: format!("{node}: {part}"),
            message,
            hardware_id: String::new(),
            values: values.into_iter().map(|(key, value)| KeyValue { key: key.to_owned(), value }).collect(),
        }
    }
}

/// `diagnostic_msgs/msg/DiagnosticArray`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct DiagnosticArray {
    /// When.
    pub header: Header,
    /// Components.
    pub status: Vec<DiagnosticStatus>,
}

/// How time goes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct TimeKeeping {
    /// Whether the simulation runs.
    pub state: RunState,
    /// Of a `/clock` that is followed: how bad, and what.
    pub clock: Option<(u8, &'static str)>,
    /// Of a bag that is written: how bad, and what.
    pub bag: Option<(u8, &'static str)>,
    /// What is wrong with inputs and node.
    pub health: HealthFlags,
}

/// The health of one second.
///
/// An input that is stale by its policy is an error with its age, whatever the policy makes of it. Refused samples
/// are a warning in the one report after them: `reported` are the counts of the report before.
pub(crate) fn compile(
    node: &str,
    time_ns: i64,
    newest: Option<&TickOutput>,
    policies: &Policies,
    counts: &[TopicCounts; NodeInput::COUNT],
    reported: &[TopicCounts; NodeInput::COUNT],
    course: TimeKeeping,
) -> DiagnosticArray {
    let TimeKeeping { state, clock, bag, health } = course;
    let mut status = Vec::new();
    let mut add = |part: &str, level, message: String, values| {
        status.push(DiagnosticStatus::new(node, part, level, message, values));
    };
    let is_stale = |input: NodeInput, age_ns: i64| age_ns > policies.rules[input as usize].policy.stale_after_ns;
    let (level, message) = match newest.map(|output| &output.tick) {
        _ if state != RunState::Playing => (0, "the simulation stands, until it is played or stepped"),
        Some(tick) if tick.latched => (2, "fail-safe: the trip stays until ~/reset_trip is called"),
        Some(tick) if tick.fail_safe => (2, "fail-safe: inputs are missing"),
        Some(tick) if tick.estimate.is_some() => {
            let of = |input: NodeInput| tick.ages_ns[input as usize].is_some_and(|age_ns| is_stale(input, age_ns));
            let silent = NodeInput::ALL.into_iter().any(of);
            if silent { (1, "running on the last value of silent inputs") } else { (0, "running") }
        }
        _ => (3, "waiting for inputs"),
    };
    let figures = newest.map_or_else(Vec::new, |output| {
        vec![
            ("overruns", output.overruns.to_string()),
            ("worst wake-up lateness [us]", format!("{:.1}", output.worst_lateness_us)),
        ]
    });
    add("integration", level, message.to_owned(), figures);
    for input in NodeInput::ALL {
        let (counts, reported) = (counts[input as usize], reported[input as usize]);
        let age_ns = newest.and_then(|output| output.tick.ages_ns[input as usize]);
        let mut values = vec![
            ("samples used", counts.used.to_string()),
            ("source restarts", counts.restarts.to_string()),
            ("samples lost on the way", counts.lost.to_string()),
        ];
        values.extend(age_ns.map(|age_ns| ("age [s]", seconds_text(age_ns))));
        values.extend(Refusal::ALL.iter().map(|&refusal| (refusal.words(), counts.refused(refusal).to_string())));
        let told = health.of(input).unwrap_or((0, "heard"));
        let (level, message) = match (age_ns, counts.all_refused().saturating_sub(reported.all_refused())) {
            (Some(age_ns), _) if is_stale(input, age_ns) => (2, format!("silent for {} s", seconds_text(age_ns))),
            _ if told.0 > 1 => (told.0, told.1.to_owned()),
            (_, refused @ 1..) => (1, format!("samples refused since the last report: {refused}")),
            (Some(_), 0) => (told.0, told.1.to_owned()),
            (None, 0) if !policies.rules[input as usize].required => {
                (0, "nothing heard; its default is taken".to_owned())
            }
            (None, 0) => (3, "nothing heard".to_owned()),
        };
        add(input.topic(), level, message, values);
    }
    let name = (health.node & Health::NAME_TAKEN != 0).then_some((2, "another node has this node's name"));
    let ignored = "others than the commanders send inputs or call for changes: they are ignored";
    let commanders = (health.node & Health::IGNORED != 0).then_some((1, ignored));
    for (part, told) in [("/clock", clock), ("bag", bag), ("name", name), ("commanders", commanders)] {
        if let Some((level, message)) = told {
            add(part, level, message.to_owned(), Vec::new());
        }
    }
    DiagnosticArray { header: Header::at(time_ns), status }
}

fn seconds_text(time_ns: i64) -> String {
    format!("{:.1}", seconds_from_nanos(time_ns))
}

#[cfg(test)]
mod tests {
    use super::{DiagnosticArray, RunState, TimeKeeping, compile};
    use crate::core::{Core, InputEvent, NodeInput, OnStale, Policy, Tick};
    use crate::intake::{Refusal, TopicCounts, TopicGate};
    use crate::integration::TickOutput;
    use govtwin_model::frame::EsvState;
    use govtwin_model::twin::Twin;

    const SECOND_NS: i64 = 1_000_000_000;
    const NO_LOAD: (u8, &str) = (0, "nothing heard; its default is taken");

    fn policy(on_stale: OnStale) -> Policy {
        Policy { stale_after_ns: 2 * SECOND_NS, hold_ns: SECOND_NS, on_stale }
    }

    /// A core that heard all inputs at 0 s.
    fn core(on_stale: OnStale) -> Core {
        let mut core = Core::new(Twin::new(&govtwin_model::params::reference()), policy(on_stale), 6.3e6);
        for heard in [InputEvent::Command(0.4), InputEvent::Esv(EsvState::Normal), InputEvent::TankPressure(6.3e6)] {
            core.hear(heard, 0);
        }
        core
    }

    fn report(
        tick: Tick,
        counts: &[TopicCounts; NodeInput::COUNT],
        reported: &[TopicCounts; NodeInput::COUNT],
    ) -> DiagnosticArray {
        let newest =
            TickOutput { tick, publish: true, steps_left: 0, patient: false, overruns: 0, worst_lateness_us: 0.0 };
        compile("/govtwin", 5, Some(&newest), &policy(OnStale::Hold).into(), counts, reported, TimeKeeping::default())
    }

    /// The report of a node that heard nothing.
    fn silent(keeping: TimeKeeping) -> DiagnosticArray {
        let none = <[_; NodeInput::COUNT]>::default();
        compile("/govtwin", 5, None, &policy(OnStale::Trip).into(), &none, &none, keeping)
    }

    fn said(array: &DiagnosticArray) -> Vec<(u8, &str)> {
        array.status.iter().map(|status| (status.level, status.message.as_str())).collect()
    }

    #[test]
    fn silence_is_stale_and_every_part_is_there() {
        let array = silent(TimeKeeping { clock: Some((2, "missing")), ..TimeKeeping::default() });
        assert_eq!(array.status.len(), 6);
        assert!(array.status[..4].iter().all(|status| status.level == 3));
        assert_eq!((array.status[4].level, array.status[5].level), (0, 2), "a load need not come, a clock must");
        assert_eq!(array.status[1].name, "/govtwin: governor/command");
    }

    #[test]
    fn an_input_that_fell_silent_is_an_error_with_its_age_even_where_it_is_held() {
        let none = <[_; NodeInput::COUNT]>::default();
        let mut core = core(OnStale::Hold);
        assert_eq!(
            said(&report(core.tick(0, 0), &none, &none)),
            [(0, "running"), (0, "heard"), (0, "heard"), (0, "heard"), NO_LOAD]
        );
        let hour_ns = 3600 * SECOND_NS;
        core.hear(InputEvent::Esv(EsvState::Normal), hour_ns);
        core.hear(InputEvent::TankPressure(6.3e6), hour_ns);
        let array = report(core.tick(SECOND_NS, hour_ns), &none, &none);
        let expected = [
            (1, "running on the last value of silent inputs"),
            (2, "silent for 3600.0 s"),
            (0, "heard"),
            (0, "heard"),
            NO_LOAD,
        ];
        assert_eq!(said(&array), expected);
        assert!(array.status[1].values.iter().any(|value| value.key == "age [s]" && value.value == "3600.0"));
    }

    #[test]
    fn a_fail_safe_is_told_until_it_ends_or_time_starts_anew() {
        let none = <[_; NodeInput::COUNT]>::default();
        let mut core = core(OnStale::Trip);
        let tripped = report(core.tick(4 * SECOND_NS, 4 * SECOND_NS), &none, &none);
        assert_eq!(said(&tripped)[0], (2, "fail-safe: inputs are missing"));
        core.reset();
        assert_eq!(said(&report(core.tick(0, 0), &none, &none))[0], (3, "waiting for inputs"));
    }

    #[test]
    fn a_simulation_that_stands_is_told_as_such() {
        let array = silent(TimeKeeping { state: RunState::Paused, ..TimeKeeping::default() });
        assert_eq!(said(&array)[0], (0, "the simulation stands, until it is played or stepped"));
    }

    #[test]
    fn a_refused_sample_warns_in_one_report() {
        let mut core = core(OnStale::Hold);
        let mut gate = TopicGate::default();
        gate.refuse(Refusal::OutOfRange);
        let none = <[TopicCounts; NodeInput::COUNT]>::default();
        let mut counts = none;
        counts[0] = gate.counts();
        let tick = core.tick(0, 0);
        assert_eq!(said(&report(tick, &counts, &none))[1], (1, "samples refused since the last report: 1"));
        assert_eq!(said(&report(tick, &counts, &counts))[1], (0, "heard"));
    }
}
