//! Actions: goals that take time, by their ids, and `simulation_interfaces/action/SimulateSteps`, in field order.

use serde::{Deserialize, Serialize};

use super::Time;
use super::simulation::SimulationResult;

/// `unique_identifier_msgs/msg/UUID`.
pub type GoalId = [u8; 16];

/// `action_msgs/msg/GoalInfo`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct GoalInfo {
    /// The goal's id.
    pub goal_id: GoalId,
    /// When it was accepted.
    pub stamp: Time,
}

/// `action_msgs/msg/GoalStatus`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct GoalStatus {
    /// The goal.
    pub goal_info: GoalInfo,
    /// One of the constants here.
    pub status: i8,
}

impl GoalStatus {
    /// There is no such goal.
    pub const UNKNOWN: i8 = 0;
    /// It is under way.
    pub const EXECUTING: i8 = 2;
    /// It is to end early.
    pub const CANCELING: i8 = 3;
    /// It was reached.
    pub const SUCCEEDED: i8 = 4;
    /// It ended early, as its caller asked for.
    pub const CANCELED: i8 = 5;
    /// It ended otherwise.
    pub const ABORTED: i8 = 6;
}

/// `action_msgs/msg/GoalStatusArray`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct GoalStatusArray {
    /// All goals that are remembered.
    pub status_list: Vec<GoalStatus>,
}

/// Request of `action_msgs/srv/CancelGoal`: a goal by its id, all up to a time, both, or, where both are 0, all.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct CancelRequest {
    /// Which.
    pub goal_info: GoalInfo,
}

/// Its response.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct CancelResponse {
    /// One of the constants here.
    pub return_code: i8,
    /// Goals that are to end early.
    pub goals_canceling: Vec<GoalInfo>,
}

impl CancelResponse {
    /// Some goals are to end early.
    pub const NONE: i8 = 0;
    /// There is nothing to end early.
    pub const REJECTED: i8 = 1;
    /// There is no such goal.
    pub const UNKNOWN_GOAL: i8 = 2;
    /// It has ended.
    pub const GOAL_TERMINATED: i8 = 3;
}

/// Request of `SimulateSteps_SendGoal`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct SendStepsRequest {
    /// An id that its sender chose.
    pub goal_id: GoalId,
    /// How many steps.
    pub steps: u64,
}

/// Response of `SimulateSteps_SendGoal`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct SendGoalResponse {
    /// Whether the goal is pursued.
    pub accepted: bool,
    /// Since when.
    pub stamp: Time,
}

/// Request of `SimulateSteps_GetResult`, answered once the goal has ended.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct ResultRequest {
    /// Of which goal.
    pub goal_id: GoalId,
}

/// Response of `SimulateSteps_GetResult`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct StepsResult {
    /// One of the constants of [`GoalStatus`].
    pub status: i8,
    /// More of it.
    pub result: SimulationResult,
}

/// `SimulateSteps_FeedbackMessage`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct StepsFeedback {
    /// Of which goal.
    pub goal_id: GoalId,
    /// Steps done.
    pub completed_steps: u64,
    /// Steps to come.
    pub remaining_steps: u64,
}
