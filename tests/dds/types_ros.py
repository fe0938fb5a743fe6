"""The messages of a servo bench as Cyclone DDS types, under the names that ROS 2 gives them on DDS."""

import sys
from dataclasses import dataclass
from pathlib import Path

from cyclonedds.idl import IdlStruct
from cyclonedds.idl.types import array, float64, int8, int64, sequence, uint8, uint16, uint32, uint64

sys.path.append(str(Path(__file__).parents[2] / "examples/coupling"))
from messages import (  # noqa: E402, F401
    EsvState,
    FluidPressure,
    GovernorCommand,
    Header,
    JointState,
    StepRequest,
    StepResponse,
    Time,
)
from messages import Result as SimulationResult  # noqa: E402, F401


@dataclass
class ServoState(IdlStruct, typename="governor_msgs::msg::dds_::ServoState_"):
    header: Header
    spool_position: float64
    servomotor_position: float64
    pilot_valve_position: float64
    control_pressure: float64


@dataclass
class TwinStatus(IdlStruct, typename="governor_msgs::msg::dds_::TwinStatus_"):
    header: Header
    state: uint8
    command: uint8
    esv: uint8
    tank_pressure: uint8
    load: uint8
    command_clamped: bool
    residual_off: bool
    command_stamp: Time
    esv_stamp: Time
    tank_pressure_stamp: Time
    load_stamp: Time
    health: uint8


@dataclass
class KeyValue(IdlStruct, typename="diagnostic_msgs::msg::dds_::KeyValue_"):
    key: str
    value: str


@dataclass
class DiagnosticStatus(IdlStruct, typename="diagnostic_msgs::msg::dds_::DiagnosticStatus_"):
    level: uint8
    name: str
    message: str
    hardware_id: str
    values: sequence[KeyValue]


@dataclass
class DiagnosticArray(IdlStruct, typename="diagnostic_msgs::msg::dds_::DiagnosticArray_"):
    header: Header
    status: sequence[DiagnosticStatus]


@dataclass
class FaultSize(IdlStruct, typename="governor_msgs::msg::dds_::FaultSize_"):
    stamp: Time
    process: str
    effect: str
    parameter: str
    unit: str
    value: float64
    low: float64
    high: float64
    named: bool
    mean_before: float64
    growth: float64
    shrinkage: float64
    limit: float64
    moved: bool


@dataclass
class UnitVerdict(IdlStruct, typename="governor_msgs::msg::dds_::UnitVerdict_"):
    header: Header
    process: str
    duration: float64
    verdict: str
    closure: float64
    sizes: sequence[FaultSize]
    warnings: sequence[str]
    processes: uint32


@dataclass
class Clock(IdlStruct, typename="rosgraph_msgs::msg::dds_::Clock_"):
    clock: Time


@dataclass
class ParameterValue(IdlStruct, typename="rcl_interfaces::msg::dds_::ParameterValue_"):
    type: uint8
    bool_value: bool
    integer_value: int64
    double_value: float64
    string_value: str
    byte_array_value: sequence[uint8]
    bool_array_value: sequence[bool]
    integer_array_value: sequence[int64]
    double_array_value: sequence[float64]
    string_array_value: sequence[str]


@dataclass
class Parameter(IdlStruct, typename="rcl_interfaces::msg::dds_::Parameter_"):
    name: str
    value: ParameterValue


@dataclass
class SetParametersResult(IdlStruct, typename="rcl_interfaces::msg::dds_::SetParametersResult_"):
    successful: bool
    reason: str


# A service call as rmw_cyclonedds lays it out: the caller's half id and a running number, then the call.
@dataclass
class GetParametersRequest(IdlStruct, typename="rcl_interfaces::srv::dds_::GetParameters_Request_"):
    caller: uint64
    number: int64
    names: sequence[str]


@dataclass
class GetParametersResponse(IdlStruct, typename="rcl_interfaces::srv::dds_::GetParameters_Response_"):
    caller: uint64
    number: int64
    values: sequence[ParameterValue]


@dataclass
class SetParametersRequest(IdlStruct, typename="rcl_interfaces::srv::dds_::SetParameters_Request_"):
    caller: uint64
    number: int64
    parameters: sequence[Parameter]


@dataclass
class SetParametersResponse(IdlStruct, typename="rcl_interfaces::srv::dds_::SetParameters_Response_"):
    caller: uint64
    number: int64
    results: sequence[SetParametersResult]


@dataclass
class ListParametersRequest(IdlStruct, typename="rcl_interfaces::srv::dds_::ListParameters_Request_"):
    caller: uint64
    number: int64
    prefixes: sequence[str]
    depth: uint64


# The result's two members stand where the struct that holds them in ROS 2 stands.
@dataclass
class ListParametersResponse(IdlStruct, typename="rcl_interfaces::srv::dds_::ListParameters_Response_"):
    caller: uint64
    number: int64
    names: sequence[str]
    prefixes: sequence[str]


@dataclass
class FloatingPointRange(IdlStruct, typename="rcl_interfaces::msg::dds_::FloatingPointRange_"):
    from_value: float64
    to_value: float64
    step: float64


@dataclass
class IntegerRange(IdlStruct, typename="rcl_interfaces::msg::dds_::IntegerRange_"):
    from_value: int64
    to_value: int64
    step: uint64


@dataclass
class ParameterDescriptor(IdlStruct, typename="rcl_interfaces::msg::dds_::ParameterDescriptor_"):
    name: str
    type: uint8
    description: str
    additional_constraints: str
    read_only: bool
    dynamic_typing: bool
    floating_point_range: sequence[FloatingPointRange]
    integer_range: sequence[IntegerRange]


@dataclass
class DescribeParametersRequest(IdlStruct, typename="rcl_interfaces::srv::dds_::DescribeParameters_Request_"):
    caller: uint64
    number: int64
    names: sequence[str]


@dataclass
class DescribeParametersResponse(IdlStruct, typename="rcl_interfaces::srv::dds_::DescribeParameters_Response_"):
    caller: uint64
    number: int64
    descriptors: sequence[ParameterDescriptor]


# A request without fields carries one member without meaning.
@dataclass
class TriggerRequest(IdlStruct, typename="std_srvs::srv::dds_::Trigger_Request_"):
    caller: uint64
    number: int64
    structure_needs_at_least_one_member: uint8


@dataclass
class TriggerResponse(IdlStruct, typename="std_srvs::srv::dds_::Trigger_Response_"):
    caller: uint64
    number: int64
    success: bool
    message: str


@dataclass
class SimulatorFeatures(IdlStruct, typename="simulation_interfaces::msg::dds_::SimulatorFeatures_"):
    features: sequence[uint16]
    spawn_formats: sequence[str]
    custom_info: str


@dataclass
class FeaturesRequest(IdlStruct, typename="simulation_interfaces::srv::dds_::GetSimulatorFeatures_Request_"):
    caller: uint64
    number: int64
    structure_needs_at_least_one_member: uint8


@dataclass
class FeaturesResponse(IdlStruct, typename="simulation_interfaces::srv::dds_::GetSimulatorFeatures_Response_"):
    caller: uint64
    number: int64
    features: SimulatorFeatures


@dataclass
class GetStateRequest(IdlStruct, typename="simulation_interfaces::srv::dds_::GetSimulationState_Request_"):
    caller: uint64
    number: int64
    structure_needs_at_least_one_member: uint8


@dataclass
class GetStateResponse(IdlStruct, typename="simulation_interfaces::srv::dds_::GetSimulationState_Response_"):
    caller: uint64
    number: int64
    state: uint8
    result: SimulationResult


@dataclass
class SetStateRequest(IdlStruct, typename="simulation_interfaces::srv::dds_::SetSimulationState_Request_"):
    caller: uint64
    number: int64
    state: uint8


@dataclass
class SetStateResponse(IdlStruct, typename="simulation_interfaces::srv::dds_::SetSimulationState_Response_"):
    caller: uint64
    number: int64
    result: SimulationResult


@dataclass
class ResetRequest(IdlStruct, typename="simulation_interfaces::srv::dds_::ResetSimulation_Request_"):
    caller: uint64
    number: int64
    scope: uint8


@dataclass
class ResetResponse(IdlStruct, typename="simulation_interfaces::srv::dds_::ResetSimulation_Response_"):
    caller: uint64
    number: int64
    result: SimulationResult


@dataclass
class LoggerLevel(IdlStruct, typename="rcl_interfaces::msg::dds_::LoggerLevel_"):
    name: str
    level: uint32


@dataclass
class SetLoggerLevelsRequest(IdlStruct, typename="rcl_interfaces::srv::dds_::SetLoggerLevels_Request_"):
    caller: uint64
    number: int64
    levels: sequence[LoggerLevel]


@dataclass
class SetLoggerLevelsResponse(IdlStruct, typename="rcl_interfaces::srv::dds_::SetLoggerLevels_Response_"):
    caller: uint64
    number: int64
    results: sequence[SetParametersResult]


@dataclass
class GetLoggerLevelsRequest(IdlStruct, typename="rcl_interfaces::srv::dds_::GetLoggerLevels_Request_"):
    caller: uint64
    number: int64
    names: sequence[str]


@dataclass
class GetLoggerLevelsResponse(IdlStruct, typename="rcl_interfaces::srv::dds_::GetLoggerLevels_Response_"):
    caller: uint64
    number: int64
    levels: sequence[LoggerLevel]


@dataclass
class SetParametersAtomicallyRequest(IdlStruct, typename="rcl_interfaces::srv::dds_::SetParametersAtomically_Request_"):
    caller: uint64
    number: int64
    parameters: sequence[Parameter]


@dataclass
class SetParametersAtomicallyResponse(IdlStruct, typename="rcl_interfaces::srv::dds_::SetParametersAtomically_Response_"):
    caller: uint64
    number: int64
    result: SetParametersResult


@dataclass
class FieldType(IdlStruct, typename="type_description_interfaces::msg::dds_::FieldType_"):
    type_id: uint8
    capacity: uint64
    string_capacity: uint64
    nested_type_name: str


@dataclass
class Field(IdlStruct, typename="type_description_interfaces::msg::dds_::Field_"):
    name: str
    type: FieldType
    default_value: str


@dataclass
class IndividualTypeDescription(IdlStruct, typename="type_description_interfaces::msg::dds_::IndividualTypeDescription_"):
    type_name: str
    fields: sequence[Field]


@dataclass
class TypeSource(IdlStruct, typename="type_description_interfaces::msg::dds_::TypeSource_"):
    type_name: str
    encoding: str
    raw_file_contents: str


@dataclass
class TypeKeyValue(IdlStruct, typename="type_description_interfaces::msg::dds_::KeyValue_"):
    key: str
    value: str


@dataclass
class TypeRequest(IdlStruct, typename="type_description_interfaces::srv::dds_::GetTypeDescription_Request_"):
    caller: uint64
    number: int64
    type_name: str
    type_hash: str
    include_type_sources: bool


@dataclass
class TypeResponse(IdlStruct, typename="type_description_interfaces::srv::dds_::GetTypeDescription_Response_"):
    caller: uint64
    number: int64
    successful: bool
    failure_reason: str
    type_description: IndividualTypeDescription
    referenced_type_descriptions: sequence[IndividualTypeDescription]
    type_sources: sequence[TypeSource]
    extra_information: sequence[TypeKeyValue]


Id = array[uint8, 16]


@dataclass
class GoalInfo(IdlStruct, typename="action_msgs::msg::dds_::GoalInfo_"):
    goal_id: Id
    stamp: Time


@dataclass
class GoalStatus(IdlStruct, typename="action_msgs::msg::dds_::GoalStatus_"):
    goal_info: GoalInfo
    status: int8


@dataclass
class GoalStatusArray(IdlStruct, typename="action_msgs::msg::dds_::GoalStatusArray_"):
    status_list: sequence[GoalStatus]


@dataclass
class CancelRequest(IdlStruct, typename="action_msgs::srv::dds_::CancelGoal_Request_"):
    caller: uint64
    number: int64
    goal_info: GoalInfo


@dataclass
class CancelResponse(IdlStruct, typename="action_msgs::srv::dds_::CancelGoal_Response_"):
    caller: uint64
    number: int64
    return_code: int8
    goals_canceling: sequence[GoalInfo]


@dataclass
class SendGoalRequest(IdlStruct, typename="simulation_interfaces::action::dds_::SimulateSteps_SendGoal_Request_"):
    caller: uint64
    number: int64
    goal_id: Id
    steps: uint64


@dataclass
class SendGoalResponse(IdlStruct, typename="simulation_interfaces::action::dds_::SimulateSteps_SendGoal_Response_"):
    caller: uint64
    number: int64
    accepted: bool
    stamp: Time


@dataclass
class GetResultRequest(IdlStruct, typename="simulation_interfaces::action::dds_::SimulateSteps_GetResult_Request_"):
    caller: uint64
    number: int64
    goal_id: Id


@dataclass
class GetResultResponse(IdlStruct, typename="simulation_interfaces::action::dds_::SimulateSteps_GetResult_Response_"):
    caller: uint64
    number: int64
    status: int8
    result: SimulationResult


@dataclass
class Feedback(IdlStruct, typename="simulation_interfaces::action::dds_::SimulateSteps_FeedbackMessage_"):
    goal_id: Id
    completed_steps: uint64
    remaining_steps: uint64
