#!/usr/bin/env python3
"""What a stranger can do to a node, in each mode: sends inputs, a clock and calls for every change, and compares with the table of docs/ros2.md.

Usage: strangers.py GOVTWIN FOLDER   (needs PyPI `cyclonedds` 11; ROS_DOMAIN_ID picks the domain; logs go to FOLDER)
With a list of commanders one of them, `/governor` in the graph of ROS, commands beside the stranger and is heard.
Exits 0 when everything was as it should be, 1 otherwise, 77 without cyclonedds.
"""

import os
import re
import sys
import time

from bench import DOMAIN, RELIABLE, check, matched, wait_for, whole, FAILED
from cyclonedds.domain import DomainParticipant
from cyclonedds.pub import DataWriter
from cyclonedds.topic import Topic
import types_ros as ros
from faults import Node
from graph import announce
from simulate import Driver, double, result

HERE = os.path.dirname(os.path.abspath(__file__))
MODES = {
    "default": (),
    "`--read-only`": ("--read-only",),
    "`--commanders /governor`": ("--commanders", "/governor"),
}
FOLLOW = ("--ros-args", "-p", "use_sim_time:=true")
IGNORED = 64
# Nanoseconds by which a stamp is known again.
MARK = 123_456_789
# A clock that nobody else tells, s.
ELSEWHERE_S = 77_000


def header():
    return ros.Header(ros.Time(int(time.time()), MARK), "stranger")


class Stranger(Driver):
    """One that sends what it likes, outside the graph of ROS."""

    SERVICES = {
        **Driver.SERVICES,
        "reset_trip": (ros.TriggerRequest, ros.TriggerResponse),
        "simulate_steps/_action/send_goal": (ros.SendGoalRequest, ros.SendGoalResponse),
    }

    def __init__(self):
        super().__init__()
        self.status = self.reader("rt/sim/status", ros.TwinStatus)
        self.diagnostics = self.reader("rt/diagnostics", ros.DiagnosticArray)

    def statuses(self):
        return whole(self.status.take(10000))

    def sends(self, expected=frozenset(), flag=0):
        """Which inputs were taken of what it sends, and the flags meanwhile: for a while, and longer where what is expected is not there yet."""
        self.matched()
        self.statuses()
        taken, flags = set(), 0
        begin = time.monotonic()
        while time.monotonic() < begin + (2.5 if expected <= taken and flags & flag == flag else 30):
            self.command.write(ros.GovernorCommand(header(), 0.77))
            self.esv.write(ros.EsvState(header(), 0))
            self.pressure.write(ros.FluidPressure(header(), 5.9e6, 0.0))
            self.joint_commands.write(ros.JointState(header(), ["servomotor"], [], [], [1.0e5]))
            for status in self.statuses():
                flags |= status.health
                stamps = {"command": status.command_stamp, "ESV": status.esv_stamp, "tank pressure": status.tank_pressure_stamp,
                          "load": status.load_stamp}
                taken |= {name for name, stamp in stamps.items() if stamp.nanosec == MARK}
            time.sleep(0.005)
        return taken, flags

    def tells_time(self, expected):
        """Whether the twin follows a clock of its own making; what is expected is waited for."""
        writer = DataWriter(self.participant, Topic(self.participant, "rt/clock", ros.Clock), qos=RELIABLE)
        wait_for(lambda: matched(writer), 10)
        seconds, begin = 0, time.monotonic()
        while time.monotonic() < begin + (30 if expected and seconds < ELSEWHERE_S else 2):
            for step in range(20):
                writer.write(ros.Clock(ros.Time(ELSEWHERE_S, 10_000_000 * step)))
                self.command.write(ros.GovernorCommand(header(), 0.77))
                self.esv.write(ros.EsvState(header(), 1))
                self.pressure.write(ros.FluidPressure(header(), 5.9e6, 0.0))
                time.sleep(0.005)
            seconds = max([seconds] + [status.header.stamp.sec for status in self.statuses()])
        return seconds >= ELSEWHERE_S


def calls(stranger):
    """The calls for a change, each with whether it was granted; to end the node comes last."""
    return {
        "parameters": lambda: stranger.ask(
            stranger.set_call, stranger.set_reply, ros.SetParametersRequest(0x0102030405060708, 1, [ros.Parameter("hold", double(0.6))])).results[0].successful,
        "parameters, all at once": lambda: stranger.call("set_parameters_atomically", [ros.Parameter("hold", double(0.7))]).result.successful,
        "logger level": lambda: stranger.call("set_logger_levels", [ros.LoggerLevel("govtwin", 20)]).results[0].successful,
        "pause": lambda: result(stranger.call("set_simulation_state", 2)) == 1,
        "step": lambda: result(stranger.call("step_simulation", 1)) == 1,
        "goal": lambda: stranger.call("simulate_steps/_action/send_goal", [7] * 16, 1).accepted,
        "play": lambda: result(stranger.call("set_simulation_state", 1)) == 1,
        "reset": lambda: stranger.call("reset", 0).success,
        "reset of all": lambda: result(stranger.call("reset_simulation", 0)) == 1,
        "reset of a trip": lambda: "only the commanders" not in (words := stranger.call("reset_trip", 0).message) and "read-only" not in words,
        "questions": lambda: stranger.call("get_simulation_state", 0) is not None,
        "end of the node": lambda: result(stranger.call("set_simulation_state", 3)) == 1,
    }


class Governor:
    """The commander: a node in the graph of ROS."""

    def __init__(self):
        self.participant = DomainParticipant(DOMAIN)
        topic = lambda name, kind: Topic(self.participant, name, kind)
        self.command = DataWriter(self.participant, topic("rt/governor/command", ros.GovernorCommand), qos=RELIABLE)
        self.esv = DataWriter(self.participant, topic("rt/governor/esv", ros.EsvState), qos=RELIABLE)
        self.pressure = DataWriter(self.participant, topic("rt/governor/tank_pressure", ros.FluidPressure), qos=RELIABLE)
        self.listed = announce(self.participant, "governor", self)

    def commands(self, status):
        """Whether it is heard, once the graph lists it."""
        heard, until = set(), time.monotonic() + 30
        while 42 not in heard and time.monotonic() < until:
            stamp = ros.Header(ros.Time(int(time.time()), 42), "governor")
            self.command.write(ros.GovernorCommand(stamp, 0.4))
            self.esv.write(ros.EsvState(stamp, 1))
            self.pressure.write(ros.FluidPressure(stamp, 6.3e6, 0.0))
            heard |= {one.command_stamp.nanosec for one in whole(status.take(1000))}
            time.sleep(0.01)
        return 42 in heard


def table():
    """The table of the document: for each thing to do, each mode's answer."""
    with open(os.path.join(HERE, "..", "..", "docs", "ros2.md")) as file:
        text = file.read()
    rows = [[cell.strip() for cell in line.strip("|\n").split("|")] for line in text.split("## What a stranger can do")[1].split("\n## ")[0].splitlines()
            if line.startswith("|")]
    modes = rows[0][1:]
    return {(deed.strip(), mode): re.match(r"yes", answer) is not None for row in rows[2:] for deed in row[0].split(";")
            for mode, answer in zip(modes, row[1:])}


def main():
    binary, folder = sys.argv[1:]
    found, expected = {}, table()
    for number, (mode, options) in enumerate(MODES.items()):
        node = Node(binary, os.path.join(folder, f"strangers_{number}.txt"), "--optional", "esv", "tank_pressure", "--hold", "60", *options)
        stranger = Stranger()
        try:
            has_list, inputs = "--commanders" in options, ("command", "ESV", "tank pressure", "load")
            taken, flags = stranger.sends({name for name in inputs if expected.get((name, mode))}, IGNORED if has_list else 0)
            found |= {(name, mode): name in taken for name in inputs}
            check(f"{mode}: what is ignored shows in sim/status", bool(flags & IGNORED) == has_list, f"({flags})")
            if has_list:
                governor = Governor()
                stranger.statuses()
                check("a commander is heard beside the stranger", governor.commands(stranger.status))
                words = {}
                stranger.sends()
                wait_for(lambda: words.update({one.name.split(": ")[-1]: one.message for array in whole(stranger.diagnostics.take(100)) for one in array.status})
                         or "commanders" in words, 15)
                check("and in /diagnostics", "ignored" in words.get("commanders", ""), f"({words})")
            for name, call in calls(stranger).items():
                try:
                    found[name, mode] = bool(call())
                except AttributeError:
                    check(f"{mode}: {name} is answered", False)
        finally:
            node.end()
            stranger = call = None
        follower = Node(binary, os.path.join(folder, f"strangers_clock_{number}.txt"), "--optional", "esv", "tank_pressure", *options, *FOLLOW)
        try:
            found["clock of a follower", mode] = Stranger().tells_time(expected.get(("clock of a follower", mode)))
        finally:
            follower.end()
    check("the table names every deed in every mode", set(expected) == set(found), f"({set(expected) ^ set(found)})")
    differing = {key: found[key] for key in set(expected) & set(found) if expected[key] != found[key]}
    check("what a stranger can do is what docs/ros2.md says", not differing, f"({differing})")
    print(f"{len(FAILED)} failed")
    return 1 if FAILED else 0


if __name__ == "__main__":
    sys.exit(main())
