//! REP-2016 type hashes of all that a node opens: messages, the halves of services, services as a whole, and the parts of actions.
//!
//! A service is, for its hash, a type of three fields: request, response, and the event by which both are told. An action is two services and a message.

use govtwin_bag::msg::definition::{DefinitionError, closure_with, text_of};
use govtwin_bag::msg::type_hash::hash_of;

/// A type's name and its text.
type Text = (&'static str, &'static str);

macro_rules! standard {
    ($($name:literal . $kind:literal),+ $(,)?) => {
        &[$(($name, include_str!(concat!("../../msg/standard/", $name, ".", $kind)))),+]
    };
}

/// Messages that only services and actions are made of.
const MESSAGES: &[Text] = standard![
    "action_msgs/msg/GoalInfo" . "msg",
    "action_msgs/msg/GoalStatus" . "msg",
    "action_msgs/msg/GoalStatusArray" . "msg",
    "rcl_interfaces/msg/FloatingPointRange" . "msg",
    "rcl_interfaces/msg/IntegerRange" . "msg",
    "rcl_interfaces/msg/ListParametersResult" . "msg",
    "rcl_interfaces/msg/ParameterDescriptor" . "msg",
    "rcl_interfaces/msg/SetParametersResult" . "msg",
    "service_msgs/msg/ServiceEventInfo" . "msg",
    "unique_identifier_msgs/msg/UUID" . "msg",
];

const SERVICES: &[Text] = standard![
    "action_msgs/srv/CancelGoal" . "srv",
    "rcl_interfaces/srv/DescribeParameters" . "srv",
    "rcl_interfaces/srv/GetLoggerLevels" . "srv",
    "rcl_interfaces/srv/GetParameterTypes" . "srv",
    "rcl_interfaces/srv/GetParameters" . "srv",
    "rcl_interfaces/srv/ListParameters" . "srv",
    "rcl_interfaces/srv/SetLoggerLevels" . "srv",
    "rcl_interfaces/srv/SetParameters" . "srv",
    "rcl_interfaces/srv/SetParametersAtomically" . "srv",
    "simulation_interfaces/srv/GetSimulationState" . "srv",
    "simulation_interfaces/srv/GetSimulatorFeatures" . "srv",
    "simulation_interfaces/srv/ResetSimulation" . "srv",
    "simulation_interfaces/srv/SetSimulationState" . "srv",
    "simulation_interfaces/srv/StepSimulation" . "srv",
    "std_srvs/srv/Trigger" . "srv",
    "type_description_interfaces/srv/GetTypeDescription" . "srv",
];

const ACTIONS: &[Text] = standard!["simulation_interfaces/action/SimulateSteps" . "action"];

/// The line between the parts of a service or an action.
const SEPARATOR: &str = "---\n";

/// Hash of a message, of a service, or of a part of a service or action; none of one whose text the program does not carry.
pub(crate) fn hash(type_name: &str) -> Option<String> {
    closure_with(type_name, &text).ok().map(|closure| hash_of(&closure))
}

/// The text of a type.
fn text(type_name: &str) -> Result<String, DefinitionError> {
    let message = text_of(type_name).ok().or_else(|| of(MESSAGES, type_name));
    let text = message.map(str::to_owned).or_else(|| part_of_service(type_name)).or_else(|| part_of_action(type_name));
    text.ok_or_else(|| DefinitionError::Unknown(type_name.to_owned()))
}

fn of(texts: &'static [Text], type_name: &str) -> Option<&'static str> {
    texts.iter().find(|(name, _)| *name == type_name).map(|(_, text)| *text)
}

/// A service, its request, its response or its event.
fn part_of_service(type_name: &str) -> Option<String> {
    if service(type_name).is_some() {
        let fields = ["Request request", "Response response", "Event event"]
            .map(|field| format!("{type_name}_{field}_message\n"));
        return Some(fields.concat());
    }
    let (name, part) = type_name.rsplit_once('_')?;
    let [request, response] = service(name)?;
    match part {
        "Request" => Some(request),
        "Response" => Some(response),
        "Event" => Some(format!(
            "service_msgs/ServiceEventInfo info\n{name}_Request[<=1] request\n{name}_Response[<=1] response\n"
        )),
        _ => None,
    }
}

/// Request and response of a service, or of one of the two services of an action.
fn service(type_name: &str) -> Option<[String; 2]> {
    if let Some(text) = of(SERVICES, type_name) {
        let (request, response) = text.split_once(SEPARATOR)?;
        return Some([request, response].map(str::to_owned));
    }
    let (name, part) = type_name.rsplit_once('_')?;
    action(name)?;
    let by_id = "unique_identifier_msgs/UUID goal_id\n";
    match part {
        "SendGoal" => {
            Some([format!("{by_id}{name}_Goal goal\n"), "bool accepted\nbuiltin_interfaces/Time stamp\n".to_owned()])
        }
        "GetResult" => Some([by_id.to_owned(), format!("int8 status\n{name}_Result result\n")]),
        _ => None,
    }
}

/// Goal, result or feedback of an action, or the message that carries its feedback.
fn part_of_action(type_name: &str) -> Option<String> {
    let (name, part) = type_name.rsplit_once('_')?;
    let parts = action(name)?.split(SEPARATOR).collect::<Vec<_>>();
    let index = match part {
        "Goal" => 0,
        "Result" => 1,
        "Feedback" => 2,
        "FeedbackMessage" => return Some(format!("unique_identifier_msgs/UUID goal_id\n{name}_Feedback feedback\n")),
        _ => return None,
    };
    parts.get(index).map(|text| (*text).to_owned())
}

fn action(type_name: &str) -> Option<&'static str> {
    #[cfg(test)]
    if type_name == "example_interfaces/action/Fibonacci" {
        return Some("int32 order\n---\nint32[] sequence\n---\nint32[] sequence\n");
    }
    of(ACTIONS, type_name)
}

#[cfg(test)]
mod tests {
    use super::{ACTIONS, SERVICES, hash};

    #[test]
    fn hashes_are_those_that_ros_generates() {
        // From the headers that rosidl_generator_c makes of these packages, `…__TYPE_HASH`.
        for (name, expected) in [
            ("service_msgs/msg/ServiceEventInfo", "41bcbbe07a75c9b52bc96bfd5c24d7f0fc0a08c0cb7921b3373c5732345a6f45"),
            ("rcl_interfaces/srv/GetParameters", "bf9803d5c74cf989a5de3e0c2e99444599a627c7ff75f97b8c05b01003675cbc"),
            (
                "rcl_interfaces/srv/GetParameters_Request",
                "135a9e1c3d7cebef792f6687d7ddf99949b21a0bd9a320d863a9110a3f5cf4d6",
            ),
            (
                "rcl_interfaces/srv/GetParameters_Response",
                "9fa773b46e39cc5d02db6224d8fd520bb9caeeffc2b27c96c1e59431baba9f2a",
            ),
            (
                "rcl_interfaces/srv/GetParameters_Event",
                "84eeb9247b09067c35bd8750d5c8555b700e394a616737c4624f15ae02e64c4d",
            ),
            ("rcl_interfaces/srv/SetParameters", "56eed9a67e169f9cb6c1f987bc88f868c14a8fc9f743a263bc734c154015d7e0"),
            (
                "rcl_interfaces/srv/SetParameters_Request",
                "130d46386b7e84ea9ecf60608a4d83cbe5e5cb7c6cc5b712b7a4e3a6c254e932",
            ),
            ("std_srvs/srv/Trigger", "eeff2cd6fa5ad9d27cdf4dec64818317839b62f212a91e6b5304b634b2062c5f"),
            ("std_srvs/srv/Trigger_Request", "d010825374ce8918e72bfd826c82603e60f45419e932ea976f807b74a863a199"),
            ("action_msgs/srv/CancelGoal", "573d8b0a534451d7bc2ac8c5ffde8ac14b8593b7001175d0cd6516dcbeb8689a"),
            ("action_msgs/srv/CancelGoal_Request", "3d3c84653c1f96918086887e1dcb236faec88b81a5b14fd4cf4840065bcdf8af"),
            (
                "example_interfaces/action/Fibonacci_SendGoal",
                "d1a57fb2a4afe8c21e34fb10db206f16ce6729b28531141472df92277c55b557",
            ),
            (
                "example_interfaces/action/Fibonacci_SendGoal_Request",
                "3d088942b413247db536576f0286768c6be8fcd5d0c9a5d544f359fba090a238",
            ),
        ] {
            assert_eq!(hash(name), Some(format!("RIHS01_{expected}")), "{name}");
        }
    }

    #[test]
    fn every_service_and_action_has_hashes_and_a_stranger_none() {
        for (name, _) in SERVICES {
            let parts = ["", "_Request", "_Response", "_Event"].map(|part| hash(&format!("{name}{part}")));
            assert!(parts.iter().all(Option::is_some), "{name}: {parts:?}");
        }
        for (name, _) in ACTIONS {
            let parts =
                ["_SendGoal", "_GetResult_Response", "_FeedbackMessage"].map(|part| hash(&format!("{name}{part}")));
            assert!(parts.iter().all(Option::is_some), "{name}: {parts:?}");
        }
        assert_eq!((hash("other/srv/Unknown_Request"), hash("other/srv/Unknown")), (None, None));
    }
}
