"""A peer on Cyclone DDS in the graph of ROS 2: which node its readers and writers belong to, as `rmw_dds_common` tells it.

Who only moves samples needs none of it; a Zenoh bridge carries what a node says that it has. An id takes 24 bytes in Humble and 16 since Iron:
ROS_DISTRO tells which.
"""

import os
from dataclasses import dataclass

from cyclonedds.core import Entity, Policy, Qos
from cyclonedds.idl import IdlStruct
from cyclonedds.idl.types import array, sequence, uint8
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from cyclonedds.util import duration

ID_LEN = 24 if os.environ.get("ROS_DISTRO") == "humble" else 16
KEPT = Qos(Policy.Reliability.Reliable(duration(milliseconds=100)), Policy.Durability.TransientLocal, Policy.History.KeepLast(1))


@dataclass
class Gid(IdlStruct, typename="rmw_dds_common::msg::dds_::Gid_"):
    data: array[uint8, ID_LEN]


@dataclass
class NodeEntitiesInfo(IdlStruct, typename="rmw_dds_common::msg::dds_::NodeEntitiesInfo_"):
    node_namespace: str
    node_name: str
    reader_gid_seq: sequence[Gid]
    writer_gid_seq: sequence[Gid]


@dataclass
class ParticipantEntitiesInfo(IdlStruct, typename="rmw_dds_common::msg::dds_::ParticipantEntitiesInfo_"):
    gid: Gid
    node_entities_info_seq: sequence[NodeEntitiesInfo]


def id_of(entity):
    return Gid(list(entity.guid.bytes) + [0] * (ID_LEN - 16))


def entities(value):
    """All readers and writers in a thing's attributes, lists and tables."""
    if isinstance(value, Entity):
        return [value] if isinstance(value, (DataReader, DataWriter)) else []
    parts = value.values() if isinstance(value, dict) else value if isinstance(value, (list, tuple)) else []
    return [entity for part in parts for entity in entities(part)]


def announce(participant, name, *things):
    """Announces a node that has all readers and writers of `things`; what it returns must be kept."""
    of_node = [entity for thing in things for entity in entities(thing if isinstance(thing, (list, dict)) else vars(thing))]
    ids = [[id_of(entity) for entity in of_node if isinstance(entity, kind)] for kind in (DataReader, DataWriter)]
    writer = DataWriter(participant, Topic(participant, "ros_discovery_info", ParticipantEntitiesInfo), qos=KEPT)
    writer.write(ParticipantEntitiesInfo(id_of(participant), [NodeEntitiesInfo("/", name, *ids)]))
    return writer
