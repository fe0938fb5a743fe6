#!/usr/bin/env python3
"""The first call of clients that call as soon as they see the service, from a participant that is new each time: every one is answered.

Usage: first_call.py GOVTWIN FOLDER   (needs PyPI `cyclonedds` 11; ROS_DOMAIN_ID picks the domain; logs go to FOLDER)
CALLS is how many (50). Exits 0 when everything was as it should be, 1 otherwise, 77 without cyclonedds.
"""

import os
import sys
import time

from bench import (BuiltinDataReader, BuiltinTopicDcpsPublication, BuiltinTopicDcpsSubscription, DOMAIN, Policy, RELIABLE, check, matched, wait_for, whole,
                   FAILED)
from cyclonedds.domain import DomainParticipant
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
import types_ros as ros
from faults import Node

# `rcl_interfaces__srv__GetParameters__TYPE_HASH` of the headers that rosidl_generator_c makes, and those of request and response.
GET_PARAMETERS = ("bf9803d5c74cf989a5de3e0c2e99444599a627c7ff75f97b8c05b01003675cbc",
                  "135a9e1c3d7cebef792f6687d7ddf99949b21a0bd9a320d863a9110a3f5cf4d6",
                  "9fa773b46e39cc5d02db6224d8fd520bb9caeeffc2b27c96c1e59431baba9f2a")
CALLS = int(os.environ.get("CALLS", "50"))
SERVICES = [
    ("get_parameters", ros.GetParametersRequest, ros.GetParametersResponse, (["rate"],)),
    ("step_simulation", ros.StepRequest, ros.StepResponse, (1,)),
    ("get_simulation_state", ros.GetStateRequest, ros.GetStateResponse, (0,)),
]


def first_call(number):
    """Seconds until the answer of a new client's first call; None where there was none."""
    name, request, response, fields = SERVICES[number % len(SERVICES)]
    participant = DomainParticipant(DOMAIN)
    reply = DataReader(participant, Topic(participant, f"rr/govtwin/{name}Reply", response), qos=RELIABLE)
    call = DataWriter(participant, Topic(participant, f"rq/govtwin/{name}Request", request), qos=RELIABLE)

    until = time.monotonic() + 10
    while not (matched(call) and matched(reply)) and time.monotonic() < until:
        time.sleep(0.0002)
    begin = time.monotonic()
    call.write(request(0x0102030405060708, number, *fields))
    while time.monotonic() < begin + 2:
        if any(sample.number == number for sample in whole(reply.take(20))):
            return time.monotonic() - begin
        time.sleep(0.0005)
    return None


def announced():
    """What the ends of `get_parameters` say of themselves, requests first."""
    participant = DomainParticipant(DOMAIN)
    said = {}
    readers = [BuiltinDataReader(participant, kind) for kind in (BuiltinTopicDcpsSubscription, BuiltinTopicDcpsPublication)]

    def look():
        for end in (end for reader in readers for end in whole(reader.take(1000))):
            if end.topic_name.startswith(("rq/govtwin/get_parametersR", "rr/govtwin/get_parametersR")) and Policy.Userdata in end.qos:
                said[end.topic_name[:2]] = bytes(end.qos[Policy.Userdata].data).decode()
        return len(said) == 2

    wait_for(look, 10)
    return [said.get(half, "") for half in ("rq", "rr")]


def main():
    node = Node(sys.argv[1], os.path.join(sys.argv[2], "first_call.txt"), "--paused", "--publish-clock")
    try:
        time.sleep(1.0)
        said = announced()
        right = [f"typehash=RIHS01_{half};sertypehash=RIHS01_{GET_PARAMETERS[0]};" for half in GET_PARAMETERS[1:]]
        check("a service announces the hashes of its types, as ROS 2 generates them", said == right, f"({said})")
        took = [first_call(number) for number in range(CALLS)]
        answered = [seconds for seconds in took if seconds is not None]
        check(f"{CALLS} first calls of new clients are answered", len(answered) == CALLS,
              f"({len(answered)} answered, the slowest after {1e3 * max(answered, default=0):.0f} ms)")
    finally:
        check("the node ends in order", node.end())
    print(f"{len(FAILED)} failed")
    return 1 if FAILED else 0


if __name__ == "__main__":
    sys.exit(main())
