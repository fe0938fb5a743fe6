//! `simulation_interfaces` 2.1: how a simulator is asked for its state, set, stepped and set back.

use serde::{Deserialize, Serialize};

use super::service::{Nothing, carried, services};

/// `simulation_interfaces/msg/Result`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct SimulationResult {
    /// One of the constants here, or of a service.
    pub result: u8,
    /// More in words.
    pub error_message: String,
}

impl SimulationResult {
    /// The simulator does not do that.
    pub const FEATURE_UNSUPPORTED: u8 = 0;
    /// Done.
    pub const OK: u8 = 1;
    /// Not now.
    pub const INCORRECT_STATE: u8 = 3;
    /// It could not be done.
    pub const OPERATION_FAILED: u8 = 4;
    /// Of `SetSimulationState`: it was so already.
    pub const ALREADY_IN_TARGET_STATE: u8 = 101;

    /// Done.
    pub fn ok() -> Self {
        Self { result: Self::OK, error_message: String::new() }
    }

    /// Not done, and why.
    pub fn refused(result: u8, why: impl Into<String>) -> Self {
        Self { result, error_message: why.into() }
    }
}

/// `simulation_interfaces/msg/SimulationState`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct SimulationState {
    /// One of the constants here.
    pub state: u8,
}

impl SimulationState {
    /// It stands at the start.
    pub const STOPPED: u8 = 0;
    /// It runs.
    pub const PLAYING: u8 = 1;
    /// It stands.
    pub const PAUSED: u8 = 2;
    /// It ends.
    pub const QUITTING: u8 = 3;
}

/// `simulation_interfaces/msg/SimulatorFeatures`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct SimulatorFeatures {
    /// What the simulator does.
    pub features: Vec<u16>,
    /// Formats of what can be spawned.
    pub spawn_formats: Vec<String>,
    /// More in words.
    pub custom_info: String,
}

impl SimulatorFeatures {
    /// Some way of setting back.
    pub const SIMULATION_RESET: u16 = 20;
    /// Time is set back.
    pub const SIMULATION_RESET_TIME: u16 = 21;
    /// The state is set back.
    pub const SIMULATION_RESET_STATE: u16 = 22;
    /// The state can be asked for.
    pub const SIMULATION_STATE_GETTING: u16 = 24;
    /// The state can be set.
    pub const SIMULATION_STATE_SETTING: u16 = 25;
    /// It can stand.
    pub const SIMULATION_STATE_PAUSE: u16 = 26;
    /// It can be stepped once.
    pub const STEP_SIMULATION_SINGLE: u16 = 31;
    /// It can be stepped several times.
    pub const STEP_SIMULATION_MULTIPLE: u16 = 32;
    /// It can be stepped by the action `SimulateSteps`, which reports its progress and can be ended early.
    pub const STEP_SIMULATION_ACTION: u16 = 33;
}

/// Response of [`GetSimulatorFeatures`].
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct FeaturesResponse {
    /// The features.
    pub features: SimulatorFeatures,
}

/// Response of [`GetSimulationState`].
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct StateResponse {
    /// The state.
    pub state: SimulationState,
    /// Whether it is known.
    pub result: SimulationResult,
}

/// Request of [`SetSimulationState`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct SetStateRequest {
    /// The state to go to.
    pub state: SimulationState,
}

/// Request of [`StepSimulation`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct StepRequest {
    /// How many steps.
    pub steps: u64,
}

/// Request of [`ResetSimulation`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct ResetRequest {
    /// What to set back, a bit for each.
    pub scope: u8,
}

impl ResetRequest {
    /// The time.
    pub const SCOPE_TIME: u8 = 1;
    /// The state.
    pub const SCOPE_STATE: u8 = 2;
    /// All that there is; so is 0.
    pub const SCOPE_ALL: u8 = 255;
}

/// Response of the services that do something.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct ResultResponse {
    /// What became of it.
    pub result: SimulationResult,
}

services! {
    GetSimulatorFeatures(Nothing, FeaturesResponse) = "simulation_interfaces/srv/GetSimulatorFeatures",
    GetSimulationState(Nothing, StateResponse) = "simulation_interfaces/srv/GetSimulationState",
    SetSimulationState(SetStateRequest, ResultResponse) = "simulation_interfaces/srv/SetSimulationState",
    StepSimulation(StepRequest, ResultResponse) = "simulation_interfaces/srv/StepSimulation",
    ResetSimulation(ResetRequest, ResultResponse) = "simulation_interfaces/srv/ResetSimulation",
}

carried!(FeaturesResponse, StateResponse, SetStateRequest, StepRequest, ResetRequest, ResultResponse);
