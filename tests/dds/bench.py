#!/usr/bin/env python3
"""A bench on Cyclone DDS against a running `govtwin run`: it commands, listens, asks, and watches the node go.

Usage: bench.py GOVTWIN [LOG]   (the binary; needs PyPI `cyclonedds` 11; ROS_DOMAIN_ID picks the domain)
Exits 0 when everything was as it should be, 1 otherwise, 77 where cyclonedds is missing.
"""

import math
import os
import signal
import subprocess
import sys
import tempfile
import time

try:
    from cyclonedds.builtin import BuiltinDataReader, BuiltinTopicDcpsPublication, BuiltinTopicDcpsSubscription
    from cyclonedds.core import InstanceState, Policy, Qos
    from cyclonedds.domain import DomainParticipant
    from cyclonedds.pub import DataWriter
    from cyclonedds.sub import DataReader
    from cyclonedds.topic import Topic
    from cyclonedds.util import duration
except ImportError as error:
    print(f"skipped: PyPI cyclonedds is not there ({error}); `pip install cyclonedds`")
    sys.exit(77)

import types_ros as ros

DOMAIN = int(os.environ.get("ROS_DOMAIN_ID", "0"))
RELIABLE = Qos(Policy.Reliability.Reliable(duration(milliseconds=100)), Policy.History.KeepLast(10))
BEST_EFFORT = Qos(Policy.Reliability.BestEffort, Policy.History.KeepLast(10))
# Ten seconds of states: a peer that is late itself still has them all.
COUNTED = Qos(Policy.Reliability.BestEffort, Policy.History.KeepLast(1000))
# Until a process that was asked to end has ended; it takes some tenths of a second, and what a disk makes of its files.
ENDS_S = 30


def end_process(process):
    """Asks a process to end, and kills it where it does not."""
    process.terminate()
    try:
        process.wait(ENDS_S)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()


def matched(end):
    """How many ends of others a writer or a reader is matched with."""
    found = end.get_matched_subscriptions if isinstance(end, DataWriter) else end.get_matched_publications
    while True:
        try:
            return len(found())
        except IndexError:
            # One more was matched while PyPI's cyclonedds had their number and not yet their list.
            pass


BARE_LOOP = """
import signal, sys, time
lost_s, last = 0.0, time.monotonic()
def end(*_):
    print(lost_s)
    sys.exit()
signal.signal(signal.SIGTERM, end)
while True:
    time.sleep(0.001)
    at = time.monotonic()
    lost_s, last = lost_s + (at - last if at - last > 0.05 else 0.0), at
"""


class Machine:
    """A bare loop of 1 ms beside what is tested: how long the machine kept it waiting, 50 ms or more at a time."""

    def __enter__(self):
        self.process = subprocess.Popen([sys.executable, "-c", BARE_LOOP], stdout=subprocess.PIPE, text=True)
        return self

    def __exit__(self, *_):
        self.process.terminate()
        self.lost_s = float(self.process.communicate(timeout=ENDS_S)[0] or 0)


def now():
    ns = time.time_ns()
    return ros.Header(ros.Time(ns // 10**9, ns % 10**9), "bench")


def stamp_ns(header):
    return header.stamp.sec * 10**9 + header.stamp.nanosec


def whole(samples):
    """Those that carry data; the others only tell that a writer went."""
    return [sample for sample in samples if sample.sample_info.valid_data]


class Bench:
    """A peer."""

    def __init__(self):
        # No function here knows the bench itself: it goes with the last name for it, and its participant with it.
        participant = self.participant = DomainParticipant(DOMAIN)
        topics = {}

        def topic(name, kind):
            if name not in topics:
                topics[name] = Topic(participant, name, kind)
            return topics[name]

        def writer(name, kind, qos=RELIABLE):
            return DataWriter(participant, topic(name, kind), qos=qos)

        def reader(name, kind, qos=BEST_EFFORT):
            return DataReader(participant, topic(name, kind), qos=qos)

        self.reader = reader
        self.command = writer("rt/governor/command", ros.GovernorCommand)
        self.esv = writer("rt/governor/esv", ros.EsvState)
        self.pressure = writer("rt/governor/tank_pressure", ros.FluidPressure)
        self.state = reader("rt/sim/servo_state", ros.ServoState, COUNTED)
        self.reliable_state = reader("rt/sim/servo_state", ros.ServoState, RELIABLE)
        self.joints = reader("rt/sim/joint_states", ros.JointState)
        self.get_call = writer("rq/govtwin/get_parametersRequest", ros.GetParametersRequest)
        self.get_reply = reader("rr/govtwin/get_parametersReply", ros.GetParametersResponse, RELIABLE)
        self.set_call = writer("rq/govtwin/set_parametersRequest", ros.SetParametersRequest)
        self.set_reply = reader("rr/govtwin/set_parametersReply", ros.SetParametersResponse, RELIABLE)
        self.list_call = writer("rq/govtwin/list_parametersRequest", ros.ListParametersRequest)
        self.list_reply = reader("rr/govtwin/list_parametersReply", ros.ListParametersResponse, RELIABLE)
        self.describe_call = writer("rq/govtwin/describe_parametersRequest", ros.DescribeParametersRequest)
        self.describe_reply = reader("rr/govtwin/describe_parametersReply", ros.DescribeParametersResponse, RELIABLE)
        self.publications = BuiltinDataReader(self.participant, BuiltinTopicDcpsPublication)
        self.own = {self.participant.guid}

    def drive(self, seconds, opening, esv=1, rate=100):
        """Commands at `rate` and collects what comes back."""
        states, joints = [], []
        steps = int(seconds * rate)
        begin = time.monotonic()
        for step in range(steps):
            self.command.write(ros.GovernorCommand(now(), opening))
            if step % 10 == 0:
                self.pressure.write(ros.FluidPressure(now(), 6.3e6, 0.0))
            if step % 50 == 0:
                self.esv.write(ros.EsvState(now(), esv))
            states += whole(self.state.take(100))
            joints += whole(self.joints.take(100))
            time.sleep(max(0.0, begin + (step + 1) / rate - time.monotonic()))
        return states, joints

    def ask(self, call, reply, request, seconds=5.0):
        until = time.monotonic() + seconds
        while time.monotonic() < until:
            call.write(request)
            pause = time.monotonic() + 0.5
            while time.monotonic() < pause:
                for sample in reply.take(10):
                    if (sample.caller, sample.number) == (request.caller, request.number):
                        return sample
                time.sleep(0.01)
        return None

    def is_met(self):
        """Whether the node is matched with all that it needs to be driven, and to be seen."""
        return all(map(matched, (self.command, self.esv, self.pressure, self.state, self.joints)))

    def endpoints_of(self, topic):
        """Writers of others on a topic, by type, as discovery knows them now."""
        samples = self.publications.read(1000)
        return [s.type_name for s in samples if s.topic_name == topic and s.participant_key not in self.own
                and s.sample_info.instance_state == InstanceState.Alive]


FAILED = []


def check(what, right, detail=""):
    print(f"{'ok  ' if right else 'FAIL'} {what} {detail}")
    if not right:
        FAILED.append(what)


def run_cases(folder, *cases):
    """Runs those of the cases that CASES names, or all, with the program and the folder, and ends."""
    named = {case.__name__: case for case in cases}
    for name in os.environ.get("CASES", " ".join(named)).split():
        print(f"-- {name}: {named[name].__doc__}")
        named[name](sys.argv[1], folder)
    print(f"{len(FAILED)} failed")
    sys.exit(1 if FAILED else 0)


def wait_for(condition, seconds):
    until = time.monotonic() + seconds
    while time.monotonic() < until:
        if condition():
            return True
        time.sleep(0.05)
    return condition()


def main():
    binary = sys.argv[1]
    bench = Bench()
    log = open(sys.argv[2], "w+") if len(sys.argv) > 2 else tempfile.TemporaryFile("w+")
    node = subprocess.Popen([binary, "run", "--stale-after", "1.5", "--hold", "0.5", "--auto-reset"], stderr=log, stdout=log)
    try:
        announced = wait_for(lambda: bench.endpoints_of("rt/sim/servo_state"), 15)
        check("the node is announced under ROS 2 names", announced
              and bench.endpoints_of("rt/sim/servo_state") == ["governor_msgs::msg::dds_::ServoState_"])
        wait_for(bench.is_met, 15)

        states, joints = bench.drive(2.0, 0.30)
        check("states arrive at about 100 Hz", 120 <= len(states) <= 260, f"({len(states)} in 2 s)")
        last = states[-1]
        check("the servomotor stands at the first command", abs(last.servomotor_position - 0.30) < 2e-3,
              f"({last.servomotor_position:.5f})")
        check("stamps rise", all(stamp_ns(b.header) > stamp_ns(a.header) for a, b in zip(states, states[1:])))

        states, joints = bench.drive(4.0, 0.50)
        moved = [s.servomotor_position for s in states]
        check("a step is followed to the new opening", abs(moved[-1] - 0.50) < 2e-3 and moved[0] < 0.32,
              f"({moved[0]:.4f} -> {moved[-1]:.4f})")
        check("the spool opened on the way", max(s.spool_position for s in states) > 0.05)
        joint = joints[-1]
        check("joint states name and place the joints in metres", joint.name == ["spool", "servomotor"]
              and math.isclose(joint.position[1], 0.60 * moved[-1], rel_tol=1e-2), f"({joint.position})")
        check("a reliable reader is served too", len(bench.reliable_state.take(1000)) > 0)

        # What cannot be is refused.
        for opening in (math.nan, math.inf, 42.0):
            bench.command.write(ros.GovernorCommand(now(), opening))
        states, _ = bench.drive(0.5, 0.50)
        check("NaN, infinity and 42 leave the servomotor where it is", abs(states[-1].servomotor_position - 0.5) < 2e-3)

        reply = bench.ask(bench.get_call, bench.get_reply,
                          ros.GetParametersRequest(0x1122334455667788, 1, ["hold", "unit.servomotor.stroke_m", "no"]))
        check("a Cyclone caller gets parameters", reply is not None and [v.double_value for v in reply.values[:2]] == [0.5, 0.6]
              and reply.values[2].type == 0, "" if reply else "(no reply)")
        value = lambda number: ros.ParameterValue(3, False, 0, number, "", [], [], [], [], [])
        request = ros.SetParametersRequest(0x1122334455667788, 2, [
            ros.Parameter("hold", value(0.7)), ros.Parameter("hold", value(-1.0)), ros.Parameter("rate", value(10.0))])
        reply = bench.ask(bench.set_call, bench.set_reply, request)
        check("a set is done, out of range and read-only are refused with reasons", reply is not None
              and [r.successful for r in reply.results] == [True, False, False]
              and "read-only" in reply.results[2].reason, "" if reply is None else f"({reply.results[1].reason})")

        states, _ = bench.drive(3.0, 0.50, esv=0)
        check("an ESV trip closes", states[-1].servomotor_position < 0.3, f"({states[-1].servomotor_position:.4f})")
        states, _ = bench.drive(4.0, 0.50)
        check("and it opens again", states[-1].servomotor_position > 0.45)

        bench.state.take(1000)
        time.sleep(4.0)
        states = bench.state.take(1000)
        check("silence trips the ESV", states and states[-1].servomotor_position < 0.45
              if states else False, f"({states[-1].servomotor_position:.4f})" if states else "")

        bench.drive(0.5, 0.50)
        stranger = DomainParticipant(DOMAIN)
        foreign = DataWriter(stranger, Topic(stranger, "rt/governor/command", ros.FluidPressure), qos=RELIABLE)
        # Cyclone itself does not match it to the node; the node must say why nothing comes.
        foreign.write(ros.FluidPressure(now(), 0.0, 0.0))
        states, _ = bench.drive(5.0, 0.50)
        check("a sender of another type disturbs nothing", abs(states[-1].servomotor_position - 0.5) < 2e-3,
              f"({states[-1].servomotor_position:.4f})")

        node.send_signal(signal.SIGINT)
        begin = time.monotonic()
        gone = wait_for(lambda: not bench.endpoints_of("rt/sim/servo_state"), ENDS_S)
        check("its endpoints vanish at SIGINT", gone, f"({time.monotonic() - begin:.2f} s)")
        check("it ends with exit code 0", node.wait(ENDS_S) == 0)
    finally:
        if node.poll() is None:
            node.kill()
            node.wait()
    log.seek(0)
    text = log.read()
    for words in ("fail-safe: inputs are missing", "not a finite number", "out of range", "governor/esv: heard", "a sender publishes `sensor_msgs/msg/FluidPressure`"):
        check(f"it said: {words}", words in text)
    if FAILED:
        print(text)
    print(f"{len(FAILED)} failed")
    return 1 if FAILED else 0


if __name__ == "__main__":
    sys.exit(main())
