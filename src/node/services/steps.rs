//! The action `simulation_interfaces/action/SimulateSteps`: so many steps, with word of how far they are, ended early where its caller asks for it.

use std::collections::VecDeque;
use std::sync::Mutex;

use futures::stream::LocalBoxStream;
use ros2_client::Publisher;

use super::super::bus::{Bus, BusError};
use super::super::control::{Answer, Order, OrderOutcome};
use super::super::integration::TimeSource;
use super::super::qos;
use super::super::realtime::{monotonic_ns, wall_ns};
use super::call::{Caller, Calls};
use super::replies::Replies;
use super::simulation::{allowed, result_of_steps, step_order};
use super::{Aftermath, ServiceContext};
use govtwin_bag::msg;
use govtwin_bag::msg::action::{
    CancelRequest, CancelResponse, GoalId, GoalInfo, GoalStatus, GoalStatusArray, ResultRequest, SendGoalResponse,
    SendStepsRequest, StepsFeedback, StepsResult,
};
use govtwin_bag::msg::simulation::SimulationResult;

/// Goals that are remembered once they ended.
const REMEMBERED: usize = 16;

/// Callers who wait for the result of one goal.
const MOST_WAITING: usize = 64;

/// Word of how far the steps are goes out so far apart, ns.
const FEEDBACK_NS: i64 = 50_000_000;

/// The action's services and topics.
pub(crate) struct StepsAction {
    time: TimeSource,
    goal: Calls,
    cancel: Calls,
    result: Calls,
    feedback: Publisher<StepsFeedback>,
    status: Publisher<GoalStatusArray>,
    goals: Mutex<Goals<Caller>>,
}

impl StepsAction {
    /// Opens the action under the node's name.
    ///
    /// # Errors
    /// When DDS refuses.
    pub(crate) fn open(bus: &mut Bus, time: TimeSource) -> Result<Self, BusError> {
        const TYPE: &str = "simulation_interfaces/action/SimulateSteps";
        let at = |part: &str| format!("~/simulate_steps/_action/{part}");
        let feedback = format!("{TYPE}_FeedbackMessage");
        Ok(Self {
            time,
            goal: bus.calls(&at("send_goal"), &format!("{TYPE}_SendGoal"))?,
            cancel: bus.calls(&at("cancel_goal"), "action_msgs/srv/CancelGoal")?,
            result: bus.calls(&at("get_result"), &format!("{TYPE}_GetResult"))?,
            feedback: bus.publish(&at("feedback"), &feedback)?,
            status: bus.publish_as(&at("status"), ("action_msgs/msg/GoalStatusArray", None), qos::kept())?,
            goals: Mutex::default(),
        })
    }

    /// Answers calls as they come, that for a result once the goal has ended.
    pub(crate) fn answers<'a, 's: 'a>(
        &'s self,
        context: &'a ServiceContext<'a>,
        replies: &'a Replies<'s>,
    ) -> Vec<LocalBoxStream<'a, Aftermath>> {
        vec![
            self.goal.attend(context, move |request: SendStepsRequest, caller, aftermath| {
                let stamp = msg::Time::from_nanos(wall_ns());
                let order = allowed(context, step_order(request.steps, self.time));
                let accepted = self.pursue((request, order), stamp, replies, aftermath);
                self.goal.respond(&caller, &SendGoalResponse { accepted, stamp });
            }),
            self.cancel.attend(context, move |request: CancelRequest, caller, aftermath| {
                if context.refusal().is_some() {
                    self.cancel.respond(
                        &caller,
                        &CancelResponse { return_code: CancelResponse::REJECTED, ..CancelResponse::default() },
                    );
                    return;
                }
                let response = self.with(|goals| goals.cancel(&request.goal_info)).unwrap_or_default();
                if !response.goals_canceling.is_empty() {
                    // To pause ends the steps, and nothing else: the simulation stands already.
                    if let Some(ticket) = replies.expect(|_| {}) {
                        aftermath.orders.push((Order::Pause, ticket));
                    }
                    self.tell();
                }
                self.cancel.respond(&caller, &response);
            }),
            self.result.attend(context, move |request: ResultRequest, caller, _| {
                let known = self.with(|goals| goals.ask(request.goal_id, caller)).unwrap_or_default();
                if let Some(response) = known {
                    self.result.respond(&caller, &response);
                }
            }),
        ]
    }

    /// Takes a goal in, where there can be one.
    fn pursue<'s>(
        &'s self,
        (request, order): (SendStepsRequest, Result<Order, SimulationResult>),
        stamp: msg::Time,
        replies: &Replies<'s>,
        aftermath: &mut Aftermath,
    ) -> bool {
        let SendStepsRequest { goal_id, steps } = request;
        let order = match order {
            Ok(order) => order,
            Err(refusal) => {
                aftermath.words.push(format!("a goal of simulate_steps is refused: {}", refusal.error_message));
                return false;
            }
        };
        if !self.with(|goals| goals.accept(GoalInfo { goal_id, stamp }, steps)).unwrap_or(false) {
            aftermath
                .words
                .push("a goal of simulate_steps is refused: another one is under way, or had its id".to_owned());
            return false;
        }
        self.tell();
        if let Some(ticket) = replies.expect(move |answer: Answer| self.finish(goal_id, &answer)) {
            aftermath.orders.push((order, ticket));
        }
        true
    }

    /// A goal has ended: its status is told, then its result to all who wait for it.
    fn finish(&self, goal_id: GoalId, answer: &Answer) {
        let Some((response, waiting)) = self.with(|goals| goals.finish(goal_id, answer)).flatten() else { return };
        self.tell();
        for caller in waiting {
            self.result.respond(&caller, &response);
        }
    }

    /// Says how far the steps are that are under way, now and then and at their end.
    pub(crate) fn progress(&self, steps_left: u64) {
        let feedback = self.with(|goals| goals.progress(steps_left, monotonic_ns())).flatten();
        if let Some(feedback) = feedback {
            // Nobody may be listening; the next one comes soon.
            let _ = self.feedback.publish(feedback);
        }
    }

    fn tell(&self) {
        if let Some(statuses) = self.with(|goals| goals.statuses()) {
            let _ = self.status.publish(statuses);
        }
    }

    fn with<T>(&self, act: impl FnOnce(&mut Goals<Caller>) -> T) -> Option<T> {
        self.goals.lock().ok().map(|mut goals| act(&mut goals))
    }
}

/// A goal, and who waits for its result.
#[derive(Debug)]
struct Goal<C> {
    info: GoalInfo,
    steps: u64,
    status: i8,
    result: SimulationResult,
    waiting: Vec<C>,
}

/// The goal under way and those before it; `C` is who waits for a result.
#[derive(Debug)]
struct Goals<C> {
    all: VecDeque<Goal<C>>,
    told_ns: i64,
}

impl<C> Default for Goals<C> {
    fn default() -> Self {
        Self { all: VecDeque::new(), told_ns: 0 }
    }
}

impl<C> Goal<C> {
    fn is_under_way(&self) -> bool {
        self.status <= GoalStatus::CANCELING
    }
}

impl<C> Goals<C> {
    /// Takes a goal in, unless another one is under way or had its id.
    fn accept(&mut self, info: GoalInfo, steps: u64) -> bool {
        if self.all.iter().any(|goal| goal.is_under_way() || goal.info.goal_id == info.goal_id) {
            return false;
        }
        if self.all.len() > REMEMBERED {
            self.all.pop_front();
        }
        let (status, result) = (GoalStatus::EXECUTING, SimulationResult::default());
        self.all.push_back(Goal { info, steps, status, result, waiting: Vec::new() });
        true
    }

    fn under_way(&mut self) -> Option<&mut Goal<C>> {
        self.all.back_mut().filter(|goal| goal.is_under_way())
    }

    /// Ends a goal; gives its result and who waits for it.
    fn finish(&mut self, goal_id: GoalId, answer: &Answer) -> Option<(StepsResult, Vec<C>)> {
        let goal = self.under_way().filter(|goal| goal.info.goal_id == goal_id)?;
        goal.status = match answer.outcome {
            OrderOutcome::Done => GoalStatus::SUCCEEDED,
            OrderOutcome::Interrupted if goal.status == GoalStatus::CANCELING => GoalStatus::CANCELED,
            _ => GoalStatus::ABORTED,
        };
        goal.result = result_of_steps(answer);
        let response = StepsResult { status: goal.status, result: goal.result.clone() };
        Some((response, std::mem::take(&mut goal.waiting)))
    }

    /// Who is to end early, by the rules of `action_msgs/srv/CancelGoal`.
    fn cancel(&mut self, asked: &GoalInfo) -> CancelResponse {
        let refuse = |return_code| CancelResponse { return_code, goals_canceling: Vec::new() };
        let (none, ever) = (GoalId::default(), msg::Time::default());
        let by_id = asked.goal_id != none;
        let known = self.all.iter().find(|goal| goal.info.goal_id == asked.goal_id).map(Goal::is_under_way);
        if by_id && asked.stamp == ever && known != Some(true) {
            let ended = known.is_some();
            return refuse(if ended { CancelResponse::GOAL_TERMINATED } else { CancelResponse::UNKNOWN_GOAL });
        }
        let time = |stamp: &msg::Time| (stamp.sec, stamp.nanosec);
        let is_meant = |info: &GoalInfo| {
            (by_id && info.goal_id == asked.goal_id)
                || (!by_id && asked.stamp == ever)
                || (asked.stamp != ever && time(&info.stamp) <= time(&asked.stamp))
        };
        match self.under_way().filter(|goal| is_meant(&goal.info)) {
            Some(goal) => {
                goal.status = GoalStatus::CANCELING;
                CancelResponse { return_code: CancelResponse::NONE, goals_canceling: vec![goal.info] }
            }
            None => refuse(CancelResponse::REJECTED),
        }
    }

    /// The result of a goal; `None` where the caller waits for its end.
    fn ask(&mut self, goal_id: GoalId, caller: C) -> Option<StepsResult> {
        let Some(goal) = self.all.iter_mut().find(|goal| goal.info.goal_id == goal_id) else {
            let why = "there is no such goal, or it ended long ago";
            let result = SimulationResult::refused(SimulationResult::OPERATION_FAILED, why);
            return Some(StepsResult { status: GoalStatus::UNKNOWN, result });
        };
        if goal.is_under_way() {
            if goal.waiting.len() < MOST_WAITING {
                goal.waiting.push(caller);
            }
            return None;
        }
        Some(StepsResult { status: goal.status, result: goal.result.clone() })
    }

    /// How far the goal under way is, where that is to be told now.
    fn progress(&mut self, steps_left: u64, now_ns: i64) -> Option<StepsFeedback> {
        let since_ns = now_ns - self.told_ns;
        let goal = self.under_way()?;
        if since_ns < FEEDBACK_NS && steps_left > 0 {
            return None;
        }
        let completed_steps = goal.steps.saturating_sub(steps_left);
        let feedback = StepsFeedback { goal_id: goal.info.goal_id, completed_steps, remaining_steps: steps_left };
        self.told_ns = now_ns;
        Some(feedback)
    }

    fn statuses(&self) -> GoalStatusArray {
        let status = |goal: &Goal<C>| GoalStatus { goal_info: goal.info, status: goal.status };
        GoalStatusArray { status_list: self.all.iter().map(status).collect() }
    }
}

#[cfg(test)]
mod tests {
    use super::{Answer, CancelResponse, GoalInfo, GoalStatus, Goals, OrderOutcome, REMEMBERED, StepsFeedback};
    use crate::control::RunState;
    use crate::policy::NodeInput;
    use govtwin_bag::msg::Time;

    fn answer(outcome: OrderOutcome) -> Answer {
        Answer { ticket: 1, outcome, state: RunState::Paused, stamps_ns: [0; NodeInput::COUNT] }
    }

    fn info(id: u8, sec: i32) -> GoalInfo {
        GoalInfo { goal_id: [id; 16], stamp: Time { sec, nanosec: 0 } }
    }

    #[test]
    fn a_goal_is_pursued_alone_and_its_result_goes_to_all_who_wait() {
        let mut goals = Goals::default();
        assert!(goals.accept(info(1, 5), 100));
        assert!(!goals.accept(info(2, 6), 100), "one at a time");
        assert_eq!(goals.ask([1; 16], "a"), None);
        assert_eq!(goals.ask([1; 16], "b"), None);
        let (result, waiting) = goals.finish([1; 16], &answer(OrderOutcome::Done)).unwrap();
        assert_eq!((result.status, waiting), (GoalStatus::SUCCEEDED, vec!["a", "b"]));
        assert_eq!(goals.ask([1; 16], "late").unwrap(), result);
        assert_eq!(goals.ask([9; 16], "c").unwrap().status, GoalStatus::UNKNOWN);
        assert!(!goals.accept(info(1, 7), 1), "an id is for one goal");
        for id in 10..50 {
            assert!(goals.accept(info(id, 8), 1) && goals.finish([id; 16], &answer(OrderOutcome::Done)).is_some());
        }
        assert_eq!(goals.statuses().status_list.len(), REMEMBERED + 1);
    }

    #[test]
    fn goals_end_early_by_id_by_time_or_all_at_once() {
        let code = |asked: GoalInfo| {
            let mut goals = Goals::<()>::default();
            goals.accept(info(1, 5), 100);
            let response = goals.cancel(&asked);
            let ended = goals.finish([1; 16], &answer(OrderOutcome::Interrupted)).unwrap().0.status;
            assert_eq!(ended, if response.return_code == 0 { GoalStatus::CANCELED } else { GoalStatus::ABORTED });
            assert_eq!(goals.cancel(&info(1, 0)).return_code, CancelResponse::GOAL_TERMINATED);
            response.return_code
        };
        for asked in [info(1, 0), info(0, 0), info(0, 5), info(3, 9)] {
            assert_eq!(code(asked), CancelResponse::NONE, "{asked:?}");
        }
        assert_eq!(code(info(2, 0)), CancelResponse::UNKNOWN_GOAL);
        assert_eq!(code(info(0, 4)), CancelResponse::REJECTED, "it came later");
    }

    #[test]
    fn progress_is_told_now_and_then_and_at_the_end() {
        let mut goals = Goals::<()>::default();
        assert_eq!(goals.progress(3, 1_000_000_000), None);
        goals.accept(info(1, 5), 100);
        let told = |completed_steps| StepsFeedback {
            goal_id: [1; 16],
            completed_steps,
            remaining_steps: 100 - completed_steps,
        };
        assert_eq!(goals.progress(90, 1_000_000_000), Some(told(10)));
        assert_eq!(goals.progress(80, 1_010_000_000), None);
        assert_eq!(goals.progress(70, 1_060_000_000), Some(told(30)));
        assert_eq!(goals.progress(0, 1_060_000_001), Some(told(100)));
    }
}
