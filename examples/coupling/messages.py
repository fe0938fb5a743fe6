"""The messages between plant and twin as Cyclone DDS types, under the names that ROS 2 gives them on DDS."""

from dataclasses import dataclass

from cyclonedds.idl import IdlStruct
from cyclonedds.idl.types import float64, int32, int64, sequence, uint8, uint32, uint64


@dataclass
class Time(IdlStruct, typename="builtin_interfaces::msg::dds_::Time_"):
    sec: int32
    nanosec: uint32


@dataclass
class Header(IdlStruct, typename="std_msgs::msg::dds_::Header_"):
    stamp: Time
    frame_id: str


@dataclass
class GovernorCommand(IdlStruct, typename="governor_msgs::msg::dds_::GovernorCommand_"):
    header: Header
    opening: float64


@dataclass
class EsvState(IdlStruct, typename="governor_msgs::msg::dds_::EsvState_"):
    header: Header
    state: uint8


@dataclass
class FluidPressure(IdlStruct, typename="sensor_msgs::msg::dds_::FluidPressure_"):
    header: Header
    fluid_pressure: float64
    variance: float64


@dataclass
class JointState(IdlStruct, typename="sensor_msgs::msg::dds_::JointState_"):
    header: Header
    name: sequence[str]
    position: sequence[float64]
    velocity: sequence[float64]
    effort: sequence[float64]


@dataclass
class Result(IdlStruct, typename="simulation_interfaces::msg::dds_::Result_"):
    result: uint8
    error_message: str


# A service call as rmw_cyclonedds lays it out: the caller's half id and a running number, then the call.
@dataclass
class StepRequest(IdlStruct, typename="simulation_interfaces::srv::dds_::StepSimulation_Request_"):
    caller: uint64
    number: int64
    steps: uint64


@dataclass
class StepResponse(IdlStruct, typename="simulation_interfaces::srv::dds_::StepSimulation_Response_"):
    caller: uint64
    number: int64
    result: Result
