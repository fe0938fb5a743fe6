//! `simulation_interfaces` 2.1 and `~/reset`: the simulation asked for its state, set, stepped and set back.
//!
//! What needs the loop is answered by the thread that publishes, after everything that the order led to: whoever has the answer to a step
//! was sent its states before. `~/reset` is a `std_srvs/Trigger`, which every ROS 2 has; `~/reset_simulation` does the same for those who
//! have `simulation_interfaces`.

use futures::stream::LocalBoxStream;

use super::super::bus::{Bus, BusError};
use super::super::control::{Answer, Order, OrderOutcome, RunState};
use super::super::integration::TimeSource;
use super::super::policy::NodeInput;
use super::call::Calls;
use super::replies::Replies;
use super::{Aftermath, ServiceContext};
use govtwin_bag::msg::service::{Nothing, Trigger, TriggerResponse};
use govtwin_bag::msg::simulation::{
    FeaturesResponse, GetSimulationState, GetSimulatorFeatures, ResetRequest, ResetSimulation, ResultResponse,
    SetSimulationState, SetStateRequest, SimulationResult, SimulationState, SimulatorFeatures, StateResponse,
    StepRequest, StepSimulation,
};
use govtwin_model::units::NANOS_PER_SECOND;

/// Most steps of one call: 11 days at 1 kHz.
const MOST_STEPS: u64 = 1_000_000_000;

/// Why a node that follows a clock cannot be stopped or stepped.
const FOLLOWS: &str = "this node follows /clock (use_sim_time): whoever publishes it stops and steps the simulation";

/// The services.
pub(crate) struct SimulationServices {
    time: TimeSource,
    features: Calls,
    get: Calls,
    set: Calls,
    step: Calls,
    reset: Calls,
    trigger: Calls,
    reset_trip: Calls,
}

impl SimulationServices {
    /// Opens the services under the node's name.
    ///
    /// # Errors
    /// When DDS refuses.
    pub(crate) fn open(bus: &mut Bus, time: TimeSource) -> Result<Self, BusError> {
        Ok(Self {
            time,
            features: bus.offer::<GetSimulatorFeatures>("~/get_simulator_features")?,
            get: bus.offer::<GetSimulationState>("~/get_simulation_state")?,
            set: bus.offer::<SetSimulationState>("~/set_simulation_state")?,
            step: bus.offer::<StepSimulation>("~/step_simulation")?,
            reset: bus.offer::<ResetSimulation>("~/reset_simulation")?,
            trigger: bus.offer::<Trigger>("~/reset")?,
            reset_trip: bus.offer::<Trigger>("~/reset_trip")?,
        })
    }

    /// Answers calls as they come, some of them once the loop has done what they ask for.
    pub(crate) fn answers<'a, 's: 'a>(
        &'s self,
        context: &'a ServiceContext<'a>,
        replies: &'a Replies<'s>,
    ) -> Vec<LocalBoxStream<'a, Aftermath>> {
        let time = self.time;
        vec![
            self.features.answer(context, move |_: Nothing, _, _| FeaturesResponse { features: features(time) }),
            self.get.answer(context, |_: Nothing, _, _| {
                let state = SimulationState { state: number(replies.state()) };
                StateResponse { state, result: SimulationResult::ok() }
            }),
            self.set.attend(context, move |request: SetStateRequest, caller, aftermath| {
                let send = move |result| self.set.respond(&caller, &ResultResponse { result });
                order(replies, aftermath, allowed(context, state_order(request.state, time)), send);
            }),
            self.step.attend(context, move |request: StepRequest, caller, aftermath| {
                let send = move |result| self.step.respond(&caller, &ResultResponse { result });
                order(replies, aftermath, allowed(context, step_order(request.steps, time)), send);
            }),
            self.reset.attend(context, move |request: ResetRequest, caller, aftermath| {
                let send = move |result| self.reset.respond(&caller, &ResultResponse { result });
                order(replies, aftermath, allowed(context, reset_order(request.scope, time)), send);
            }),
            self.trigger.attend(context, move |_: Nothing, caller, aftermath| {
                let send = move |result: SimulationResult| {
                    let success = result.result == SimulationResult::OK;
                    let done = "the twin starts again from the steady state of its inputs";
                    let message = if success { done.to_owned() } else { result.error_message };
                    self.trigger.respond(&caller, &TriggerResponse { success, message })
                };
                order(replies, aftermath, allowed(context, Ok(Order::Reset { time: true })), send);
            }),
            self.reset_trip.attend(context, move |_: Nothing, caller, aftermath| {
                let send = move |result: SimulationResult| {
                    let success = result.result == SimulationResult::OK;
                    let done = "the trip ends where all inputs are back";
                    let message = match result.result {
                        SimulationResult::OK => done.to_owned(),
                        SimulationResult::ALREADY_IN_TARGET_STATE => "no trip waits to be reset".to_owned(),
                        _ => result.error_message,
                    };
                    self.reset_trip.respond(&caller, &TriggerResponse { success, message })
                };
                order(replies, aftermath, allowed(context, Ok(Order::ResetTrip)), send);
            }),
        ]
    }
}

/// An order, or its refusal where nobody may change the node.
pub(super) fn allowed(
    context: &ServiceContext<'_>,
    order: Result<Order, SimulationResult>,
) -> Result<Order, SimulationResult> {
    match context.refusal() {
        Some(reason) => Err(SimulationResult::refused(SimulationResult::FEATURE_UNSUPPORTED, reason)),
        None => order,
    }
}

/// Gives an order to the loop, or says at once why not.
fn order<'a>(
    replies: &Replies<'a>,
    aftermath: &mut Aftermath,
    order: Result<Order, SimulationResult>,
    send: impl FnOnce(SimulationResult) -> bool + Send + 'a,
) {
    let order = match order {
        Ok(order) => order,
        Err(refusal) => {
            send(refusal);
            return;
        }
    };
    let reply = move |answer: Answer| {
        send(if let Order::Step { .. } = order { result_of_steps(&answer) } else { result(&answer) });
    };
    if let Some(ticket) = replies.expect(reply) {
        aftermath.words.extend(words(order).map(str::to_owned));
        aftermath.orders.push((order, ticket));
    }
}

/// What an order does, for the log; steps are too many to tell.
fn words(order: Order) -> Option<&'static str> {
    match order {
        Order::Play => Some("a caller lets the simulation play"),
        Order::Pause => Some("a caller pauses the simulation"),
        Order::Stop => Some("a caller stops the simulation and sets it back"),
        Order::Reset { .. } => Some("a caller sets the twin back"),
        Order::ResetTrip => Some("a caller resets the trip of the fail-safe"),
        Order::Quit => Some("a caller ends the node"),
        Order::Step { .. } => None,
    }
}

fn state_order(state: SimulationState, time: TimeSource) -> Result<Order, SimulationResult> {
    let refuse = |result, why: &str| Err(SimulationResult::refused(result, why));
    match state.state {
        SimulationState::QUITTING => Ok(Order::Quit),
        SimulationState::STOPPED..=SimulationState::PAUSED if time == TimeSource::Follow => {
            refuse(SimulationResult::INCORRECT_STATE, FOLLOWS)
        }
        SimulationState::STOPPED => Ok(Order::Stop),
        SimulationState::PLAYING => Ok(Order::Play),
        SimulationState::PAUSED => Ok(Order::Pause),
        _ => refuse(
            SimulationResult::FEATURE_UNSUPPORTED,
            "expected 0 (stopped), 1 (playing), 2 (paused) or 3 (quitting); there are no worlds to load",
        ),
    }
}

pub(super) fn step_order(steps: u64, time: TimeSource) -> Result<Order, SimulationResult> {
    match steps {
        _ if time == TimeSource::Follow => Err(SimulationResult::refused(SimulationResult::INCORRECT_STATE, FOLLOWS)),
        0..=MOST_STEPS => Ok(Order::Step { ticks: steps }),
        _ => {
            let why = format!("{steps} steps: expected at most {MOST_STEPS}");
            Err(SimulationResult::refused(SimulationResult::OPERATION_FAILED, why))
        }
    }
}

fn reset_order(scope: u8, time: TimeSource) -> Result<Order, SimulationResult> {
    let refuse = |why: &str| Err(SimulationResult::refused(SimulationResult::FEATURE_UNSUPPORTED, why));
    let (wants_time, wants_state) = (scope & ResetRequest::SCOPE_TIME != 0, scope & ResetRequest::SCOPE_STATE != 0);
    match (wants_time, wants_state) {
        _ if scope == 0 || scope == ResetRequest::SCOPE_ALL => Ok(Order::Reset { time: true }),
        (false, true) => Ok(Order::Reset { time: false }),
        (true, true) if time == TimeSource::Own => Ok(Order::Reset { time: true }),
        (true, _) if time != TimeSource::Own => refuse("the time is not this node's to set back (see --publish-clock)"),
        (true, _) => refuse("the time is set back together with the state only: expected scope 3, 0 or 255"),
        (false, false) => refuse("nothing is spawned here: expected scope 2 (state), 3 (and time), 0 or 255 (all)"),
    }
}

pub(super) fn result(answer: &Answer) -> SimulationResult {
    let refuse = SimulationResult::refused;
    match answer.outcome {
        OrderOutcome::Done => SimulationResult::ok(),
        OrderOutcome::Already => refuse(SimulationResult::ALREADY_IN_TARGET_STATE, "it is in that state already"),
        OrderOutcome::NotPaused => {
            refuse(SimulationResult::OPERATION_FAILED, "the simulation plays: pause it before you step it")
        }
        OrderOutcome::Busy => refuse(SimulationResult::INCORRECT_STATE, "other callers are before this one"),
        OrderOutcome::Interrupted => {
            refuse(SimulationResult::OPERATION_FAILED, "another call, or the node's end, ended the steps early")
        }
        OrderOutcome::InputsMissing(missing) => {
            let missing: Vec<&str> = NodeInput::NAMES
                .into_iter()
                .zip(missing)
                .filter(|(_, is_missing)| *is_missing)
                .map(|(name, _)| name)
                .collect();
            let why = format!(
                "no new sample of {} came within steps.timeout; nothing was stepped (`sim/status` has the stamps in force)",
                missing.join(", ")
            );
            SimulationResult::refused(SimulationResult::OPERATION_FAILED, why)
        }
    }
}

/// The same of steps that were done, with the stamps of the inputs that they used.
pub(super) fn result_of_steps(answer: &Answer) -> SimulationResult {
    let result = result(answer);
    if answer.outcome != OrderOutcome::Done || answer.stamps_ns.iter().all(|stamp_ns| *stamp_ns == 0) {
        return result;
    }
    let stamps = NodeInput::NAMES.into_iter().zip(answer.stamps_ns).filter(|(_, stamp_ns)| *stamp_ns != 0);
    let stamps: Vec<String> = stamps
        .map(|(name, stamp_ns)| format!("{name} {}.{:09}", stamp_ns / NANOS_PER_SECOND, stamp_ns % NANOS_PER_SECOND))
        .collect();
    SimulationResult { error_message: format!("stamps used: {}", stamps.join(", ")), ..result }
}

fn number(state: RunState) -> u8 {
    match state {
        RunState::Stopped => SimulationState::STOPPED,
        RunState::Playing => SimulationState::PLAYING,
        RunState::Paused => SimulationState::PAUSED,
    }
}

fn features(time: TimeSource) -> SimulatorFeatures {
    use SimulatorFeatures as F;
    let mut features = vec![F::SIMULATION_RESET, F::SIMULATION_RESET_STATE, F::SIMULATION_STATE_GETTING];
    if time == TimeSource::Own {
        features.push(F::SIMULATION_RESET_TIME);
    }
    if time != TimeSource::Follow {
        features.extend([F::SIMULATION_STATE_SETTING, F::SIMULATION_STATE_PAUSE]);
        features.extend([F::STEP_SIMULATION_SINGLE, F::STEP_SIMULATION_MULTIPLE, F::STEP_SIMULATION_ACTION]);
    }
    features.sort_unstable();
    let custom_info = format!(
        "govtwin {}: servo system of a hydro-turbine governor; simulation_interfaces 2.1; a step is one tick of `rate`",
        env!("CARGO_PKG_VERSION")
    );
    SimulatorFeatures { features, spawn_formats: Vec::new(), custom_info }
}

#[cfg(test)]
mod tests {
    use super::{Order, SimulationResult, SimulationState, TimeSource, features, reset_order, state_order, step_order};

    #[test]
    fn orders_are_those_that_the_time_allows() {
        let state = |state, time| state_order(SimulationState { state }, time);
        assert_eq!(state(2, TimeSource::Wall), Ok(Order::Pause));
        assert_eq!(state(3, TimeSource::Follow), Ok(Order::Quit));
        let refused = |order: Result<Order, SimulationResult>| order.unwrap_err().result;
        assert_eq!(refused(state(2, TimeSource::Follow)), SimulationResult::INCORRECT_STATE);
        assert_eq!(refused(state(5, TimeSource::Own)), SimulationResult::FEATURE_UNSUPPORTED);
        assert_eq!(step_order(5, TimeSource::Wall), Ok(Order::Step { ticks: 5 }));
        // The first half of an id read as a number, as a call in the other layout would be.
        assert_eq!(refused(step_order(0x1122_3344_5566_7788, TimeSource::Own)), SimulationResult::OPERATION_FAILED);
    }

    #[test]
    fn a_reset_is_of_what_there_is() {
        for (scope, time, expected) in [
            (0, TimeSource::Wall, Some(true)),
            (255, TimeSource::Follow, Some(true)),
            (2, TimeSource::Own, Some(false)),
            (3, TimeSource::Own, Some(true)),
            (3, TimeSource::Wall, None),
            (1, TimeSource::Own, None),
            (4, TimeSource::Own, None),
        ] {
            assert_eq!(reset_order(scope, time).ok(), expected.map(|time| Order::Reset { time }), "{scope} {time:?}");
        }
    }

    #[test]
    fn what_is_offered_is_what_the_time_allows() {
        assert_eq!(features(TimeSource::Own).features, [20, 21, 22, 24, 25, 26, 31, 32, 33]);
        assert_eq!(features(TimeSource::Wall).features, [20, 22, 24, 25, 26, 31, 32, 33]);
        assert_eq!(features(TimeSource::Follow).features, [20, 22, 24]);
    }
}
