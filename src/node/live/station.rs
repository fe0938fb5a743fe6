//! One unit's node before it runs: its bus, its endpoints, its loop.

use std::path::Path;
use std::sync::Mutex;
use std::sync::atomic::AtomicU8;

use futures::channel::mpsc;
use ros2_client::log::LogLevel;
use ros2_client::{ParameterValue, Publisher};

use super::super::bus::{Bus, BusError};
use super::super::bus_map::InputNames;
use super::super::bus_map::subscriber::{MapSubscriber, OpenedTopic};
use super::super::clock::ClockHeard;
use super::super::commanders::AllowList;
use super::super::control::RunState;
use super::super::core::{Core, NodeInput};
use super::super::diagnostics::{self, DiagnosticArray};
use super::super::health::Health;
use super::super::intake::TopicCounts;
use super::super::integration::{Ends, Integrator};
use super::super::journal::{Journal, Names};
use super::super::listener::Subscriptions;
use super::super::publishers::Publishers;
use super::super::refit::Refit;
use super::super::settings::NodeSettings;
use super::super::startup;
use super::kept::Kept;
use super::{NodeError, NodeResidual, RunOptions, Say};
use govtwin_correction::corrector::Corrector;
use govtwin_correction::model::{Model, ModelError};
use govtwin_correction::rate;
use govtwin_correction::row::Opening;
use govtwin_correction::shipped;
use govtwin_model::parameters::Unit;
use govtwin_model::units::nanos_from_seconds;

/// What the threads share of a unit.
pub(super) struct Station {
    // Dropped in this order: endpoints first, then the node, then, with the last one, the participant. Peers see each of them go.
    pub(super) subscriptions: Subscriptions,
    pub(super) publishers: Publishers,
    pub(super) bus: Bus,
    pub(super) settings: NodeSettings,
    pub(super) clock: ClockHeard,
    pub(super) health: Health,
    pub(super) least: AtomicU8,
    pub(super) counts: Mutex<[TopicCounts; NodeInput::COUNT]>,
}

/// What each thread takes for itself.
pub(super) struct Parts {
    pub(super) health: Publisher<DiagnosticArray>,
    pub(super) allowed: AllowList,
    pub(super) integrator: Integrator,
    pub(super) ends: Ends,
    pub(super) subscriber: Option<MapSubscriber>,
    pub(super) opened: Option<mpsc::UnboundedReceiver<OpenedTopic>>,
    pub(super) names: InputNames,
}

impl Station {
    /// Opens a unit's node, beside another one of this process where there is one.
    pub(super) fn open(
        options: &RunOptions,
        kept: &Kept,
        beside: Option<&Bus>,
        say: Say<'_>,
    ) -> Result<(Self, Parts), NodeError> {
        let (settings, unit) = (kept.store.settings(), kept.store.unit().clone());
        let commanders = match kept.store.value("commanders") {
            ParameterValue::String(names) => names,
            _ => String::new(),
        };
        let allowed = AllowList::parse(&commanders).map_err(NodeError::Parameter)?;
        let corrector = corrector((kept.residual(options), options.adapt), &unit, settings.rate_hz, say)?;
        for remark in options.environment.remarks.iter().chain(&options.arguments.remarks) {
            say(LogLevel::Warn, remark);
        }
        if settings.use_sim_time && settings.paused {
            let words =
                "start_paused does nothing: a node that follows /clock (use_sim_time) stands until the clock goes";
            say(LogLevel::Warn, words);
        }
        let arguments = options.arguments.clone();
        let mut bus = match beside {
            Some(bus) => bus.beside(arguments)?,
            None => Bus::open(&options.environment, arguments)?,
        };
        if options.read_only {
            say(LogLevel::Info, "read-only: callers may ask, and change nothing; inputs are taken");
        }
        if !allowed.is_empty() {
            let words = format!(
                "commanders: {commanders}; what others send is ignored, and they change nothing. Names and ids are what senders say of \
                 themselves: without DDS Security they prove nothing"
            );
            say(LogLevel::Info, &words);
        }
        for (level, words) in startup::words(&bus, &options.environment, &settings, options.map.as_ref()) {
            say(level, &words);
        }
        // All endpoints are made before anything runs: announcements in a burst later may be lost.
        let is_mapped = options.map.is_some();
        let wants = (options.adapt, is_mapped, !allowed.is_empty());
        let subscriptions = Subscriptions::open(&mut bus, &settings, wants)?;
        let (subscriber, opened) = match &options.map {
            Some(map) => {
                let (way, opened) = mpsc::unbounded();
                let arguments = options.arguments.helper("map");
                (Some(MapSubscriber::new(bus.beside(arguments)?, map, way)?), Some(opened))
            }
            None => (None, None),
        };
        let publishers = Publishers::open(&mut bus, corrector.as_ref().map(Corrector::signal), settings.publish_clock)?;
        let health = bus.publish("/diagnostics", diagnostics::TYPE_NAME)?;
        let core = Core::of_refit(Refit::new(&unit), settings.policies())
            .with_corrector(corrector)
            .latching(settings.latch_trip);
        let (integrator, ends) = Integrator::new(core, settings.pace(), 0);
        let integrator = integrator.awaiting(settings.awaited());
        let station = Self {
            subscriptions,
            publishers,
            bus,
            settings,
            clock: ClockHeard::default(),
            health: Health::default(),
            least: AtomicU8::new(kept.least),
            counts: Mutex::default(),
        };
        let names = InputNames::new(options.map.as_ref());
        Ok((station, Parts { health, allowed, integrator, ends, subscriber, opened, names }))
    }

    /// The state in which its simulation begins.
    pub(super) fn begins(&self) -> RunState {
        if self.settings.pace().paused { RunState::Paused } else { RunState::Playing }
    }

    /// Begins a bag.
    pub(super) fn journal(&self, folder: &Path) -> Result<Journal, NodeError> {
        Ok(Journal::create(folder, &names(&self.bus)?)?)
    }
}

/// The learned residual, where there is one and it is of this unit.
fn corrector(
    (residual, adapts): (&NodeResidual, bool),
    unit: &Unit,
    rate_hz: f64,
    say: Say<'_>,
) -> Result<Option<Corrector>, ModelError> {
    let ready = |model: &Model| {
        model.check(unit, Opening::Simulated)?;
        rate::check_spacing(model, nanos_from_seconds(1.0 / rate_hz))?;
        let corrector = Corrector::new(model)?;
        if adapts { corrector.adapting(model) } else { Ok(corrector) }
    };
    match residual {
        NodeResidual::None => Ok(None),
        NodeResidual::Given(model) => {
            let corrector = ready(model)?;
            say(LogLevel::Info, &format!("the residual was {}", rate::assumed(model)));
            Ok(Some(corrector))
        }
        NodeResidual::Shipped => {
            let Some(model) = shipped::of(unit) else { return Ok(None) };
            let name = shipped::NAME;
            let (corrector, words) = match ready(&model) {
                Ok(corrector) => {
                    let assumed = rate::assumed(&model);
                    (
                        Some(corrector),
                        format!("sim/corrected/servo_state by {name}, `--residual none` for none; {assumed}"),
                    )
                }
                Err(error) => (None, format!("{name} is not used: {error}")),
            };
            say(LogLevel::Info, &words);
            Ok(corrector)
        }
    }
}

fn names(bus: &Bus) -> Result<Names, BusError> {
    let resolve = |topic: &str| bus.arguments().resolve(topic);
    let [command, esv, tank_pressure, load] = NodeInput::ALL.map(NodeInput::topic);
    Ok(Names {
        inputs: [resolve(command)?, resolve(esv)?, resolve(tank_pressure)?, resolve(load)?],
        servo_state: resolve("sim/servo_state")?,
        joint_states: resolve("sim/joint_states")?,
    })
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::AtomicBool;

    use super::super::super::arguments::Arguments;
    use super::super::super::environment::Environment;
    use super::super::run;
    use super::{NodeError, NodeResidual, NodeSettings, RunOptions};

    #[test]
    fn a_unit_that_a_file_may_not_describe_does_not_run_either() {
        let words = ["-p", "unit.distributing_valve.control_volume_m3:=1e-6"].map(str::to_owned);
        let options = RunOptions {
            environment: Environment::read(|_| None).unwrap(),
            arguments: Arguments::parse(&words, "govtwin").unwrap(),
            map: None,
            unit: govtwin_model::params::reference(),
            residual: NodeResidual::None,
            adapt: false,
            settings: NodeSettings::default(),
            read_only: false,
            commanders: String::new(),
            duration: None,
            bag: None,
        };
        let stop = AtomicBool::new(true);
        match run(&options, &stop, &mut |_, _| {}) {
            Err(NodeError::Parameter(reason)) => assert!(reason.contains("the control chamber would hold"), "{reason}"),
            other => panic!("{other:?}"),
        }
    }
}
