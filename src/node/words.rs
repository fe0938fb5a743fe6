//! What happened, said once and plainly.

use ros2_client::log::LogLevel;

use super::core::{NodeInput, Notices, OnStale};
use super::listener::event::NodeEvent;
use super::settings::NodeSettings;

/// NodeEvent in words, with how urgent they are; `settings` follow what changes while the node runs, `labels` are what inputs are called.
pub(crate) fn of(
    node_events: &NodeEvent,
    settings: &mut NodeSettings,
    labels: &[String; NodeInput::COUNT],
) -> Vec<(LogLevel, String)> {
    match node_events {
        NodeEvent::Output(output) => of_tick(output.tick.notices, settings, labels),
        NodeEvent::Said(level, words) => vec![(*level, words.clone())],
        NodeEvent::Settings(new) => {
            *settings = **new;
            Vec::new()
        }
    }
}

/// The news of a tick in words.
fn of_tick(notices: Notices, settings: &NodeSettings, labels: &[String; NodeInput::COUNT]) -> Vec<(LogLevel, String)> {
    let mut said = Vec::new();
    if notices.has(Notices::RESET) {
        let words = "time jumped back, or ahead by more than 10 s: the twin forgot everything and waits for inputs";
        said.push((LogLevel::Warn, words.to_owned()));
    }
    if notices.has(Notices::RESTARTED) {
        said.push((LogLevel::Warn, "the twin was set back, and starts again from what it heard last".to_owned()));
    }
    if notices.has(Notices::REFITTED) {
        let words = "the changed unit took hold between two ticks; a bag does not replay across such a change";
        said.push((LogLevel::Info, words.to_owned()));
    }
    if notices.has(Notices::UNCORRECTED) {
        let words = "the learned residual is of the unit as it was, and ended with it: sim/corrected/* fall silent";
        said.push((LogLevel::Warn, words.to_owned()));
    }
    for input in NodeInput::ALL {
        let topic = &labels[input as usize];
        let policy = settings.policies().rules[input as usize].policy;
        let ([stale_after_s, hold_s], on_stale) = (policy.limits_s(), policy.on_stale);
        if notices.has(Notices::missing(input)) {
            let name = NodeInput::NAMES[input as usize];
            let words = format!(
                "{topic}: nothing heard yet, after {stale_after_s} s; the twin waits for it, unless it is given \
                 `--optional {name}`"
            );
            said.push((LogLevel::Warn, words));
        }
        if notices.has(Notices::stale(input)) {
            let then = match on_stale {
                OnStale::Hold => "its last value is held".to_owned(),
                OnStale::Trip => format!("its last value is held for {hold_s} s, then the ESV trips"),
                OnStale::Stop => format!("its last value is held for {hold_s} s, then the node stops"),
                OnStale::Default => format!("its last value is held for {hold_s} s, then its default is taken"),
            };
            let words = format!("{topic}: nothing heard for {stale_after_s} s; {then}");
            said.push((LogLevel::Warn, words));
        }
        if notices.has(Notices::recovered(input)) {
            said.push((LogLevel::Info, format!("{topic}: heard")));
        }
    }
    if notices.has(Notices::FAIL_SAFE) {
        let has = |choice| settings.policies().rules.iter().any(|rule| rule.policy.on_stale == choice);
        let what = if has(OnStale::Trip) && settings.latch_trip {
            "taken as an ESV trip, which stays until `~/reset_trip` is called (`latch_trip`)"
        } else if has(OnStale::Trip) {
            "taken as an ESV trip until all inputs are back"
        } else if has(OnStale::Stop) {
            "the node stops"
        } else {
            "their defaults are taken until all inputs are back"
        };
        said.push((LogLevel::Error, format!("fail-safe: inputs are missing; {what}")));
    }
    if notices.has(Notices::RELEASED) {
        said.push((LogLevel::Info, "fail-safe released: all inputs are back".to_owned()));
    }
    if notices.has(Notices::DRIFT) {
        let words = "drift: the measured signal has left what twin and residual say; a bounded correction follows it";
        said.push((LogLevel::Warn, words.to_owned()));
    }
    if notices.has(Notices::STARTED) {
        said.push((LogLevel::Info, "the twin runs, from the steady state of its first inputs".to_owned()));
    }
    said
}

#[cfg(test)]
mod tests {
    use super::{LogLevel, NodeEvent, Notices, of, of_tick};
    use crate::core::{Core, NodeInput, OnStale};
    use crate::integration::TickOutput;
    use crate::settings::NodeSettings;
    use govtwin_model::twin::Twin;

    fn labels() -> [String; NodeInput::COUNT] {
        NodeInput::ALL.map(|input| input.topic().to_owned())
    }

    #[test]
    fn a_stale_input_is_named_with_its_limits() {
        let said = of_tick(Notices::stale(NodeInput::Esv), &NodeSettings::default(), &labels());
        let expected = "governor/esv: nothing heard for 2.5 s; its last value is held for 1 s, then the ESV trips";
        assert_eq!(said, [(LogLevel::Warn, expected.to_owned())]);
        assert!(of_tick(Notices::default(), &NodeSettings::default(), &labels()).is_empty());
    }

    #[test]
    fn what_is_set_while_the_node_runs_is_told_from_then_on() {
        let mut settings = NodeSettings::default();
        let mut tick = Core::new(Twin::new(&govtwin_model::params::reference()), settings.policies(), 6.3e6).tick(0, 0);
        tick.notices = Notices::stale(NodeInput::Esv);
        let stale = NodeEvent::Output(Box::new(TickOutput {
            tick,
            publish: false,
            steps_left: 0,
            patient: false,
            overruns: 0,
            worst_lateness_us: 0.0,
        }));
        assert!(of(&stale, &mut settings, &labels())[0].1.contains("held for 1 s, then the ESV trips"));
        let longer = NodeSettings { hold_s: 30.0, ..settings };
        assert!(of(&NodeEvent::Settings(Box::new(longer)), &mut settings, &labels()).is_empty());
        assert!(of(&stale, &mut settings, &labels())[0].1.contains("held for 30 s, then the ESV trips"));
        let holding = NodeSettings { on_stale: OnStale::Hold, ..longer };
        assert!(of(&NodeEvent::Settings(Box::new(holding)), &mut settings, &labels()).is_empty());
        assert!(of(&stale, &mut settings, &labels())[0].1.ends_with("its last value is held"));
    }
}
