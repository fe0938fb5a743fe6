//! The thread that hears: samples are checked and become events, parameter calls are answered.

pub(crate) mod event;
mod input;
mod mapped;
mod order;
mod samples;

use std::cell::{Cell, RefCell};
use std::collections::BTreeMap;
use std::rc::Rc;
use std::sync::Mutex;
use std::thread::Thread;

use futures::channel::mpsc::UnboundedReceiver;
use futures::channel::oneshot;
use futures::stream::{LocalBoxStream, StreamExt, select_all};
use ros2_client::log::LogLevel;
use ros2_client::parameters::raw;
use ros2_client::{Gid, Publisher, Subscription};
use rtrb::{Consumer, Producer};
use serde::de::DeserializeOwned;

use self::event::{NodeEvent, Teller};
use self::input::Input;
use super::bus::{Bus, BusError};
use super::bus_map::InputNames;
use super::bus_map::subscriber::OpenedTopic;
use super::clock;
use super::commanders::Commanders;
use super::core::{InputEvent, NodeInput};
use super::health::Health;
use super::intake::competing_publishers::CompetingPublishers;
use super::intake::stamps::StampWatch;
use super::intake::{Intake, Numbering, Refusal, TopicCounts, TopicGate};
use super::integration::{TimeSource, TimedEvent};
use super::qos;
use super::realtime::{monotonic_ns, wall_ns};
use super::refit::Refit;
use super::services::replies::Replies;
use super::services::simulation::SimulationServices;
use super::services::steps::StepsAction;
use super::services::upkeep::UpkeepServices;
use super::services::{Aftermath, ParameterServices, ServiceContext};
use super::settings::NodeSettings;
use super::tap::Tap;
use govtwin_bag::msg::{Clock, EsvState, FluidPressure, GovernorCommand, Interface, JointState, ServoState};

/// Topic of the state measured on the real unit.
pub(crate) const MEASURED: &str = "plant/servo_state";

/// Everything that the node hears through.
pub(crate) struct Subscriptions {
    native: Option<NativeInputs>,
    joint_commands: Input<JointState>,
    measured: Option<Subscription<ServoState>>,
    clock: Option<Subscription<Clock>>,
    services: (ParameterServices, UpkeepServices, SimulationServices),
    action: StepsAction,
    parameter_events: Publisher<raw::ParameterEvent>,
    /// What nodes say of themselves, where it matters who commands.
    graph: Option<Tap>,
}

/// The inputs in messages of our own types.
struct NativeInputs {
    command: Input<GovernorCommand>,
    esv: Input<EsvState>,
    tank_pressure: Input<FluidPressure>,
}

impl Subscriptions {
    /// Opens all endpoints; the measured state is heard where a residual adapts to it. Where a map says where inputs come from, those of our own
    /// types are not heard.
    ///
    /// # Errors
    /// When DDS refuses one.
    pub(crate) fn open(
        bus: &mut Bus,
        settings: &NodeSettings,
        (adapts, is_mapped, has_commanders): (bool, bool, bool),
    ) -> Result<Self, BusError> {
        let time = settings.pace().time;
        let services =
            (ParameterServices::open(bus)?, UpkeepServices::open(bus)?, SimulationServices::open(bus, time)?);
        Ok(Self {
            services,
            action: StepsAction::open(bus, time)?,
            native: if is_mapped {
                None
            } else {
                Some(NativeInputs {
                    command: Input::open(bus, NodeInput::Command, settings)?,
                    esv: Input::open(bus, NodeInput::Esv, settings)?,
                    tank_pressure: Input::open(bus, NodeInput::TankPressure, settings)?,
                })
            },
            joint_commands: Input::open(bus, NodeInput::Load, settings)?,
            measured: if adapts && !is_mapped { Some(bus.subscribe(MEASURED)?) } else { None },
            clock: if settings.use_sim_time { Some(bus.subscribe_with("/clock", qos::followed())?) } else { None },
            parameter_events: bus.parameter_events()?,
            graph: if has_commanders { Some(bus.tap_graph()?) } else { None },
        })
    }
}

impl Subscriptions {
    /// The action that steps the simulation.
    pub(crate) fn action(&self) -> &StepsAction {
        &self.action
    }

    /// Whether all who set parameters have their responses.
    pub(super) fn is_answered(&self) -> bool {
        self.services.0.is_answered()
    }

    /// What nodes say of themselves, where it matters who commands.
    pub(super) fn graph(&self) -> Option<&Tap> {
        self.graph.as_ref()
    }
}

/// The loop as the listener reaches it.
pub(crate) struct Loop {
    /// Where events go.
    pub events: Producer<TimedEvent>,
    /// Where twins of a changed unit go.
    pub refits: Producer<Box<Refit>>,
    /// Where they come back from.
    pub retired: Consumer<Box<Refit>>,
    /// Its thread, which sleeps until something is pushed where it has no deadline.
    pub thread: Thread,
}

/// What the listener works with.
pub(crate) struct Listener<'a> {
    /// The bus.
    pub bus: &'a Bus,
    /// The loop.
    pub integrator: RefCell<Loop>,
    /// Where words go.
    pub node_events: Teller,
    /// Counts of the inputs, for whoever asks.
    pub counts: &'a Mutex<[TopicCounts; NodeInput::COUNT]>,
    /// What was heard of `/clock`, for whoever watches it.
    pub clock: &'a clock::ClockHeard,
    /// What is wrong with the inputs, for whoever tells of it.
    pub health: &'a Health,
    commanders: Rc<Commanders<'a>>,
    time: Cell<TimeSource>,
    max_stamp_age_ns: Cell<Option<i64>>,
    stamps: RefCell<[StampWatch; NodeInput::COUNT]>,
    /// Stroke of the servomotor, by which metres become pu.
    stroke_m: Cell<f64>,
    names: InputNames,
    /// Topics of a map, as they are subscribed to.
    opened: RefCell<Option<UnboundedReceiver<OpenedTopic>>>,
    /// A trip that the map lets stay was seen.
    esv_latched: Cell<bool>,
    gates: RefCell<[TopicGate; NodeInput::COUNT]>,
    competing: RefCell<[CompetingPublishers<Gid>; NodeInput::COUNT]>,
    senders: RefCell<BTreeMap<Gid, bool>>,
    /// Whether a publisher of inputs is reliable.
    reliable: RefCell<BTreeMap<Gid, bool>>,
    numbers: RefCell<Numbering<Gid>>,
    full: Cell<bool>,
}

/// What arrives through one endpoint, dealt with as it comes.
pub(crate) type Arrivals<'a> = LocalBoxStream<'a, ()>;

/// Hears until told to stop.
pub(crate) fn hear(arrivals: Vec<Arrivals<'_>>, stop: oneshot::Receiver<()>) {
    futures::executor::block_on(select_all(arrivals).take_until(stop).for_each(|()| std::future::ready(())));
}

impl<'a> Listener<'a> {
    /// A listener that has heard nothing yet.
    pub(crate) fn new(
        bus: &'a Bus,
        integrator: Loop,
        node_events: Teller,
        counts: &'a Mutex<[TopicCounts; NodeInput::COUNT]>,
        (clock, health): (&'a clock::ClockHeard, &'a Health),
        commanders: Rc<Commanders<'a>>,
    ) -> Self {
        Self {
            bus,
            integrator: RefCell::new(integrator),
            node_events,
            counts,
            clock,
            health,
            commanders,
            time: Cell::new(TimeSource::Wall),
            max_stamp_age_ns: Cell::new(None),
            stamps: RefCell::default(),
            stroke_m: Cell::new(1.0),
            names: InputNames::new(None),
            opened: RefCell::new(None),
            esv_latched: Cell::new(false),
            gates: RefCell::default(),
            competing: RefCell::default(),
            senders: RefCell::default(),
            reliable: RefCell::default(),
            numbers: RefCell::default(),
            full: Cell::new(false),
        }
    }

    /// The same for inputs that come by a map, from topics as they are subscribed to.
    pub(super) fn with_map(self, names: InputNames, opened: Option<UnboundedReceiver<OpenedTopic>>) -> Self {
        Self { names, opened: RefCell::new(opened), ..self }
    }

    /// All that arrives, dealt with as it comes.
    pub(crate) fn arrivals<'s, 'p: 's>(
        &'s self,
        subscriptions: &'p Subscriptions,
        services: &'s ServiceContext<'s>,
        replies: &'s Replies<'p>,
    ) -> Vec<Arrivals<'s>> {
        self.stroke_m.set(services.store.borrow().unit().parameters.servomotor.stroke_m);
        let settings = services.store.borrow().settings();
        self.time.set(settings.pace().time);
        self.max_stamp_age_ns.set(settings.max_stamp_age_ns());
        let mut streams = Vec::new();
        let (native, joint_commands) = (subscriptions.native.as_ref(), &subscriptions.joint_commands);
        if let Some(clock) = &subscriptions.clock {
            streams.push(self.in_order(native, joint_commands, clock));
        } else {
            streams.push(joint_commands.stream(self).map(|sample| self.asked(sample)).boxed_local());
            let inputs =
                |of: &'p NativeInputs| [self.input(&of.command), self.input(&of.esv), self.input(&of.tank_pressure)];
            streams.extend(native.into_iter().flat_map(inputs));
        }
        streams.extend(self.opened.take().map(|opened| self.mapped(opened)));
        if let Some(measured) = &subscriptions.measured {
            streams.push(measured.async_stream().map(|sample| self.measured(sample)).boxed_local());
        }
        let mut answers = subscriptions.action.answers(services, replies);
        let (parameters, upkeep, simulation) = &subscriptions.services;
        answers.extend(parameters.answers(services));
        answers.extend(upkeep.answers(services));
        answers.extend(simulation.answers(services, replies));
        let events = &subscriptions.parameter_events;
        let follow_up = |stream: LocalBoxStream<'s, Aftermath>| {
            stream.map(move |aftermath| self.follow_up(aftermath, services, events)).boxed_local()
        };
        streams.extend(answers.into_iter().map(follow_up));
        streams
    }

    /// The stream of one input.
    fn input<'s, M: Interface + Intake + DeserializeOwned + 'static>(&'s self, input: &'s Input<M>) -> Arrivals<'s> {
        input.stream(self).map(|sample| self.sample(sample)).boxed_local()
    }

    fn tell(&self, heard: InputEvent) {
        self.tell_stamped(heard, 0);
    }

    /// The same of a sample with a stamp, ns.
    fn tell_stamped(&self, heard: InputEvent, stamp_ns: i64) {
        let mut integrator = self.integrator.borrow_mut();
        let lost = integrator.events.push(TimedEvent { arrived_ns: monotonic_ns(), heard, stamp_ns }).is_err();
        integrator.thread.unpark();
        if lost && !self.full.replace(true) {
            self.say(LogLevel::Error, "the integration thread does not keep up: inputs are lost".to_owned());
        }
    }

    /// Hands a twin of the changed unit to the loop, and takes back those that it exchanged.
    fn hand_over(&self, refit: Box<Refit>, services: &ServiceContext<'_>) {
        self.stroke_m.set(refit.strokes_m[1]);
        let mut integrator = self.integrator.borrow_mut();
        let lost = integrator.refits.push(refit).is_err();
        drop(integrator);
        if lost {
            // The service context asks for no twin where there is no room.
            self.say(LogLevel::Error, "the integration thread takes no changes: the unit stays as it was".to_owned());
        } else {
            self.tell(InputEvent::Refit);
        }
        self.look_for_room(services);
    }

    fn look_for_room(&self, services: &ServiceContext<'_>) {
        let mut integrator = self.integrator.borrow_mut();
        while integrator.retired.pop().is_ok() {}
        services.room_for_twins.set(integrator.refits.slots() > 0);
    }

    fn follow_up(
        &self,
        aftermath: Aftermath,
        services: &ServiceContext<'_>,
        publisher: &Publisher<raw::ParameterEvent>,
    ) {
        self.look_for_room(services);
        for words in aftermath.words {
            self.say(LogLevel::Info, words);
        }
        for (order, ticket) in aftermath.orders {
            self.tell(InputEvent::Order(order, ticket));
        }
        if let Some(refit) = aftermath.refit {
            self.hand_over(refit, services);
        }
        if aftermath.changed.is_empty() {
            return;
        }
        let settings = services.store.borrow().settings();
        self.max_stamp_age_ns.set(settings.max_stamp_age_ns());
        // First to the supervisor, so that whatever comes of them is told in their words.
        self.node_events.tell(NodeEvent::Settings(Box::new(settings)));
        for (input, rule) in NodeInput::ALL.into_iter().zip(settings.policies().rules) {
            self.tell(InputEvent::Rule(input, rule));
        }
        self.tell(InputEvent::PublishPeriod(settings.publish_period_ns()));
        let event = raw::ParameterEvent {
            stamp: ros2_client::builtin_interfaces::Time::from_nanos(wall_ns()),
            node: self.bus.arguments().full_name(),
            new_parameters: Vec::new(),
            changed_parameters: aftermath.changed,
            deleted_parameters: Vec::new(),
        };
        if publisher.publish(event).is_err() {
            self.say(LogLevel::Warn, "a parameter event was lost".to_owned());
        }
    }

    /// The time that stamps are held against, ns; `None` where the model's time is its own, which only its followers share.
    fn shared_time_ns(&self) -> Option<i64> {
        match self.time.get() {
            TimeSource::Wall => Some(wall_ns()),
            TimeSource::Follow => self.clock.time_ns(),
            TimeSource::Own => None,
        }
    }

    /// Holds a sample's stamp against the node's time and the stamps before it, and tells what is wrong with the input.
    fn look_at_stamp(&self, input: NodeInput, stamp_ns: i64) -> Result<(), Refusal> {
        let limits = (self.shared_time_ns(), self.max_stamp_age_ns.get());
        let looked = self.stamps.borrow_mut()[input as usize].take(stamp_ns, monotonic_ns(), limits.0, limits.1);
        let (flags, outcome) = match looked {
            Ok(flags) => (flags, Ok(())),
            Err((flags, refusal)) => (flags, Err(refusal)),
        };
        let competing = self.competing.borrow()[input as usize].compete();
        self.health.set(input, flags | if competing { Health::COMPETING } else { 0 });
        outcome
    }

    /// Whether a sender may command; one that may not is told of once.
    fn may_command(&self, sender: Gid, what: &str) -> bool {
        let may = self.commanders.may(sender);
        if let Some(who) = (!may).then(|| self.commanders.introduce(sender)).flatten() {
            self.say(LogLevel::Warn, format!("{what}: {who} is not among the commanders: what it sends is ignored"));
        }
        may
    }

    fn say(&self, level: LogLevel, words: String) {
        self.node_events.tell(NodeEvent::Said(level, words));
    }
}
