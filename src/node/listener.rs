//! The thread that hears: samples are checked and become events, parameter calls are answered.

pub mod news;

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::sync::Mutex;

use futures::channel::oneshot;
use futures::stream::{LocalBoxStream, StreamExt, select_all};
use ros2_client::log::LogLevel;
use ros2_client::parameters::raw;
use ros2_client::{Gid, MessageInfo, Publisher, ReadError, Subscription};
use rtrb::Producer;

use self::news::{News, Teller};
use super::bus::{Bus, BusError};
use super::core::{Heard, Input};
use super::environment::Environment;
use super::intake::{Counts, Gate, Intake, Numbering, Refusal};
use super::integration::Event;
use super::parameters::Store;
use super::realtime::{monotonic_ns, wall_ns};
use super::services::{Aftermath, Desk, ParameterServices};
use super::settings::Settings;
use crate::msg::{Clock, EsvState, FluidPressure, GovernorCommand, Interface, ServoState};

/// Topic of the state measured on the real unit.
pub const MEASURED: &str = "plant/servo_state";

/// A measured position beyond this is no position, pu of stroke.
const FARTHEST_PU: f64 = 10.0;

/// Everything that the node hears through.
pub struct Ears {
    command: Subscription<GovernorCommand>,
    esv: Subscription<EsvState>,
    tank_pressure: Subscription<FluidPressure>,
    measured: Option<Subscription<ServoState>>,
    clock: Option<Subscription<Clock>>,
    services: Vec<ParameterServices>,
    parameter_events: Publisher<raw::ParameterEvent>,
}

impl Ears {
    /// Opens all endpoints; the measured state is heard where a residual adapts to it.
    ///
    /// # Errors
    /// When DDS refuses one.
    pub fn open(bus: &mut Bus, environment: &Environment, settings: &Settings, adapts: bool) -> Result<Self, BusError> {
        let services = environment.service_mappings.iter().map(|&mapping| ParameterServices::open(bus, mapping));
        let services = services.collect::<Result<_, _>>()?;
        Ok(Self {
            services,
            command: bus.subscribe(Input::Command.topic())?,
            esv: bus.subscribe(Input::Esv.topic())?,
            tank_pressure: bus.subscribe(Input::TankPressure.topic())?,
            measured: if adapts { Some(bus.subscribe(MEASURED)?) } else { None },
            clock: if settings.use_sim_time { Some(bus.subscribe("/clock")?) } else { None },
            parameter_events: bus.parameter_events()?,
        })
    }
}

/// What the listener works with.
pub struct Listener<'a> {
    /// The bus.
    pub bus: &'a Bus,
    /// Where events go.
    pub events: RefCell<Producer<Event>>,
    /// Where words go.
    pub news: Teller,
    /// Counts of the inputs, for whoever asks.
    pub counts: &'a Mutex<[Counts; 3]>,
    gates: RefCell<[Gate; 3]>,
    senders: RefCell<BTreeMap<Gid, bool>>,
    numbers: RefCell<Numbering<Gid>>,
    full: RefCell<bool>,
}

/// What one arrival asks for once it was looked at.
enum Arrival {
    Done,
    Answered(Aftermath),
}

impl<'a> Listener<'a> {
    /// A listener that has heard nothing yet.
    #[must_use]
    pub fn new(bus: &'a Bus, events: Producer<Event>, news: Teller, counts: &'a Mutex<[Counts; 3]>) -> Self {
        Self {
            bus,
            events: RefCell::new(events),
            news,
            counts,
            gates: RefCell::default(),
            senders: RefCell::default(),
            numbers: RefCell::default(),
            full: RefCell::new(false),
        }
    }

    /// Hears until told to stop.
    pub fn run(&self, ears: &Ears, store: Store, environment: &Environment, stop: oneshot::Receiver<()>) {
        let desk = Desk::new(store, &environment.service_mappings);
        let mut streams: Vec<LocalBoxStream<'_, Arrival>> =
            vec![self.input(&ears.command), self.input(&ears.esv), self.input(&ears.tank_pressure)];
        if let Some(measured) = &ears.measured {
            let samples = measured.async_stream().map(|sample| {
                self.measured(sample);
                Arrival::Done
            });
            streams.push(samples.boxed_local());
        }
        if let Some(clock) = &ears.clock {
            let ticks = clock.async_stream().map(|sample| {
                if let Some(time_ns) = sample.ok().and_then(|(clock, _)| clock.clock.nanos()) {
                    self.tell(Heard::Clock(time_ns));
                }
                Arrival::Done
            });
            streams.push(ticks.boxed_local());
        }
        for services in &ears.services {
            let answers = services.answers(&desk).into_iter();
            streams.extend(answers.map(|answers| answers.map(Arrival::Answered).boxed_local()));
        }
        let mut arrivals = select_all(streams).take_until(stop);
        futures::executor::block_on(async {
            while let Some(arrival) = arrivals.next().await {
                if let Arrival::Answered(aftermath) = arrival {
                    self.follow_up(&aftermath, &desk, &ears.parameter_events);
                }
            }
        });
    }

    /// The stream of one input.
    fn input<'s, M: Interface + Intake + 'static>(
        &'s self,
        subscription: &'s Subscription<M>,
    ) -> LocalBoxStream<'s, Arrival> {
        let samples = subscription.async_stream().map(|sample| {
            self.sample(sample);
            Arrival::Done
        });
        samples.boxed_local()
    }

    /// Checks one sample and passes it on.
    fn sample<M: Interface + Intake>(&self, sample: Result<(M, MessageInfo), ReadError>) {
        let input = M::INPUT;
        let mut gates = self.gates.borrow_mut();
        let gate = &mut gates[input as usize];
        if let Ok((_, info)) = &sample {
            gate.miss(self.numbers.borrow_mut().take(info.publisher_gid(), info.sequence_number()));
        }
        let refused = match sample {
            Err(ReadError::Deserialization { .. }) => Some((Refusal::Undecodable, gate.refuse(Refusal::Undecodable))),
            Err(error) => {
                self.say(LogLevel::Warn, format!("{}: {error}", input.topic()));
                None
            }
            Ok((_, info)) if self.is_foreign(info.publisher_gid(), M::TYPE_NAME) => {
                gate.refuse(Refusal::ForeignType);
                None
            }
            Ok((message, _)) => match message.check(gate) {
                Ok(heard) => {
                    self.tell(heard);
                    None
                }
                Err(refusal) => Some((refusal, gate.counts().refused(refusal) == 1)),
            },
        };
        if let Some((refusal, true)) = refused {
            let words = format!("{}: a sample was refused: {}; more are only counted", input.topic(), refusal.words());
            self.say(LogLevel::Warn, words);
        }
        if let Ok(mut counts) = self.counts.lock() {
            counts[input as usize] = gate.counts();
        }
    }

    /// Passes a measured state on; one that cannot be is left out, since the adaptation lives well without it.
    fn measured(&self, sample: Result<(ServoState, MessageInfo), ReadError>) {
        let Ok((state, info)) = sample else { return };
        let [spool_pu, servomotor_pu] = [state.spool_position, state.servomotor_position]
            .map(|position_pu| if position_pu.abs() <= FARTHEST_PU { position_pu } else { f64::NAN });
        if !self.is_foreign(info.publisher_gid(), ServoState::TYPE_NAME) {
            self.tell(Heard::Measured { spool_pu, servomotor_pu });
        }
    }

    /// Whether a sender announced another type than ours; asked once for each sender.
    fn is_foreign(&self, sender: Gid, expected: &str) -> bool {
        if let Some(&foreign) = self.senders.borrow().get(&sender) {
            return foreign;
        }
        // Not listed yet: believed, and asked again at its next sample.
        let Some((_, found)) = self.bus.writers().remove(&sender) else { return false };
        let foreign = found != expected;
        self.senders.borrow_mut().insert(sender, foreign);
        foreign
    }

    fn tell(&self, heard: Heard) {
        let lost = self.events.borrow_mut().push(Event { arrived_ns: monotonic_ns(), heard }).is_err();
        if lost && !self.full.replace(true) {
            self.say(LogLevel::Error, "the integration thread does not keep up: inputs are lost".to_owned());
        }
    }

    fn follow_up(&self, aftermath: &Aftermath, desk: &Desk, publisher: &Publisher<raw::ParameterEvent>) {
        for words in &aftermath.words {
            self.say(LogLevel::Info, words.clone());
        }
        if aftermath.changed.is_empty() {
            return;
        }
        let settings = desk.store.borrow().settings();
        // First to the keeper, so that whatever comes of them is told in their words.
        self.news.tell(News::Settings(settings));
        for (input, rule) in Input::ALL.into_iter().zip(settings.policies().rules) {
            self.tell(Heard::Rule(input, rule));
        }
        self.tell(Heard::PublishPeriod(settings.publish_period_ns()));
        let event = raw::ParameterEvent {
            stamp: ros2_client::builtin_interfaces::Time::from_nanos(wall_ns()),
            node: self.bus.arguments().full_name(),
            new_parameters: Vec::new(),
            changed_parameters: aftermath.changed.clone(),
            deleted_parameters: Vec::new(),
        };
        if publisher.publish(event).is_err() {
            self.say(LogLevel::Warn, "a parameter event was lost".to_owned());
        }
    }

    fn say(&self, level: LogLevel, words: String) {
        self.news.tell(News::Said(level, words));
    }
}
