//! What a node says of itself when it starts: name, domain, topics with types and units, rates, real-time state.

use ros2_client::log::LogLevel;

use super::bus::Bus;
use super::bus_map::BusMap;
use super::environment::{Distribution, Environment};
use super::integration::TimeSource;
use super::policy::{NodeInput, OnStale};
use super::realtime::{carrier, claim_transport, lock_memory};
use super::settings::NodeSettings;
use super::transport;
use govtwin_bag::msg::{EsvState, FluidPressure, GovernorCommand, Interface, JointState, ServoState, TwinStatus};

/// Type and unit of each input.
pub(super) const INPUTS: [(&str, &str); NodeInput::COUNT] = [
    (GovernorCommand::TYPE_NAME, "pu"),
    (EsvState::TYPE_NAME, "0 shutdown, 1 normal"),
    (FluidPressure::TYPE_NAME, "Pa gauge"),
    (JointState::TYPE_NAME, "servomotor: m, N"),
];

/// Topic, type and units of what is published at the state's rate.
const OUTPUTS: [(&str, &str, &str); 3] = [
    ("sim/servo_state", ServoState::TYPE_NAME, "pu, Pa"),
    ("sim/joint_states", JointState::TYPE_NAME, "m, m/s"),
    ("sim/status", TwinStatus::TYPE_NAME, "flags"),
];

/// The node's name, transport, topics and rates.
pub(crate) fn words(
    bus: &Bus,
    environment: &Environment,
    settings: &NodeSettings,
    map: Option<&BusMap>,
) -> Vec<(LogLevel, String)> {
    let name = bus.arguments().full_name();
    let networks = match environment.only_networks.as_deref() {
        None => "all networks".to_owned(),
        Some(addresses) if addresses.iter().all(std::net::IpAddr::is_loopback) => "this machine only".to_owned(),
        Some(addresses) => {
            let addresses: Vec<String> = addresses.iter().map(ToString::to_string).collect();
            format!("networks of {}", addresses.join(", "))
        }
    };
    let built_for = Distribution::of_build().words();
    let (domain, lease_s) = (environment.domain, environment.lease.as_secs_f64());
    let level = if transport::is_repaired() { LogLevel::Info } else { LogLevel::Warn };
    let mut lines = vec![
        (LogLevel::Info, format!("node {name} for {built_for}, DDS domain {domain}, {networks}, lease {lease_s} s")),
        (level, transport::DESCRIPTION.to_owned()),
    ];
    let full = |topic: &str| bus.arguments().resolve(topic).unwrap_or_else(|_| topic.to_owned());
    for input in NodeInput::ALL {
        let (type_name, unit) = INPUTS[input as usize];
        let rule = settings.policies().rules[input as usize];
        let [stale_after_s, hold_s] = rule.policy.limits_s();
        let need = if rule.required { "required" } else { "optional" };
        let then = match rule.policy.on_stale {
            OnStale::Hold => "held for ever".to_owned(),
            other => format!("held {hold_s} s, then {}", other.name()),
        };
        let what = match map.and_then(|map| map.words(input)) {
            Some(words) => words,
            None => format!("hears {}: {type_name} [{unit}]", full(input.topic())),
        };
        lines.push((LogLevel::Info, format!("{what}, {need}, stale after {stale_after_s} s, {then}")));
    }
    let outputs = OUTPUTS.map(|(topic, type_name, units)| format!("{}: {type_name} [{units}]", full(topic)));
    lines.push((LogLevel::Info, format!("publishes at {} Hz {}", settings.publish_rate_hz, outputs.join("; "))));
    let time = match (settings.pace().time, settings.paused) {
        (TimeSource::Follow, _) => "/clock as it comes",
        (TimeSource::Wall, false) => "the machine's clock",
        (TimeSource::Own, false) => "its own clock from 0, published as /clock",
        (TimeSource::Wall, true) => "the machine's clock, once it is played or stepped",
        (TimeSource::Own, true) => "its own clock from 0, published as /clock, once it is played or stepped",
    };
    lines.push((
        LogLevel::Info,
        format!(
            "integrates at {} Hz on {time}; serves {}/reset, parameters, logger levels, types, simulation_interfaces",
            settings.rate_hz, name
        ),
    ));
    lines
}

/// Locks the memory and raises the transport's threads; says how that went.
pub(crate) fn claim(priority: u8) -> [(LogLevel, String); 2] {
    let memory = match lock_memory() {
        Ok(()) => (LogLevel::Info, "memory locked".to_owned()),
        Err(error) => (
            LogLevel::Warn,
            format!(
                "memory not locked: {error}; a page fault may delay the loop (allow it with `ulimit -l`, CAP_IPC_LOCK or root)"
            ),
        ),
    };
    [memory, raise(priority)]
}

/// Raises the threads of the transport and says how that went.
fn raise(priority: u8) -> (LogLevel, String) {
    let middle = carrier(priority);
    let low = carrier(middle);
    match claim_transport(priority) {
        (_, 0) if priority == 0 => (LogLevel::Info, "no thread asks for real time".to_owned()),
        (found, raised) if raised == found && found > 0 => (
            LogLevel::Info,
            format!("SCHED_FIFO: integration {priority}; transport, hearing and publishing {middle}; discovery {low}"),
        ),
        (found, raised) => (
            LogLevel::Warn,
            format!("{raised} of {found} threads of the transport are real-time; other programs may delay samples"),
        ),
    }
}
