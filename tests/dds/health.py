#!/usr/bin/env python3
"""What goes wrong with inputs and node shows in `sim/status` and `/diagnostics` while it lasts: two commanders, stamps that are old, stand still or are far
off, a second node of the same name, a trip that stays until it is reset.

Usage: health.py GOVTWIN FOLDER   (needs PyPI `cyclonedds` 11; ROS_DOMAIN_ID picks the domain; logs go to FOLDER)
Exits 0 when everything was as it should be, 1 otherwise, 77 without cyclonedds.
"""

import os
import sys
import time

from bench import BEST_EFFORT, DOMAIN, RELIABLE, check, matched, now, wait_for, whole, FAILED
from cyclonedds.domain import DomainParticipant
from cyclonedds.pub import DataWriter
from cyclonedds.topic import Topic
import types_ros as ros
from faults import Node
from simulate import Driver

COMPETING, STAMP_OLD, STAMP_STANDS, STAMP_FAR, NAME_TAKEN, LATCHED = 1, 2, 4, 8, 16, 32


class Watcher(Driver):
    """A bench that also reads `sim/status` and `/diagnostics`."""

    SERVICES = {**Driver.SERVICES, "reset_trip": (ros.TriggerRequest, ros.TriggerResponse)}

    def __init__(self):
        super().__init__()
        self.status = self.reader("rt/sim/status", ros.TwinStatus)
        self.diagnostics = self.reader("rt/diagnostics", ros.DiagnosticArray)

    def run(self, seconds, header=now, opening=0.4, esv=True):
        """Commands with these headers; returns flags of the last states, and the words of `/diagnostics` by part."""
        begin, flags, words = time.monotonic(), 0, {}
        self.status.take(1000), self.diagnostics.take(1000)
        step = 0
        while time.monotonic() < begin + seconds:
            self.command.write(ros.GovernorCommand(header(), opening))
            if step % 10 == 0:
                self.pressure.write(ros.FluidPressure(now(), 6.3e6, 0.0))
                if esv:
                    self.esv.write(ros.EsvState(now(), 1))
            for status in whole(self.status.take(1000)):
                flags = status.health
            for array in whole(self.diagnostics.take(100)):
                words.update({status.name.split(": ")[-1]: (status.level, status.message) for status in array.status})
            step += 1
            time.sleep(0.01)
        return flags, words


def shifted(seconds):
    header = now()
    return ros.Header(ros.Time(header.stamp.sec + seconds, header.stamp.nanosec), "bench")


def main():
    binary, folder = sys.argv[1:]
    node = Node(binary, os.path.join(folder, "health.txt"), "--latch", "--hold", "0.5")
    peer = Watcher()
    second = None
    try:
        peer.matched()
        flags, words = peer.run(2.5)
        check("nothing is wrong at first", flags == 0, f"({flags}, {words})")
        rival = DomainParticipant(DOMAIN)
        other = DataWriter(rival, Topic(rival, "rt/governor/command", ros.GovernorCommand), qos=RELIABLE)
        wait_for(lambda: matched(other), 10)

        def two():
            other.write(ros.GovernorCommand(now(), 0.2))
            return now()

        flags, words = peer.run(2.5, two)
        check("two commanders show while they last", flags & COMPETING and words["governor/command"][0] == 2, f"({flags}, {words.get('governor/command')})")
        del other, rival
        flags, _ = peer.run(3.5)
        check("and no longer", flags & COMPETING == 0, f"({flags})")
        flags, words = peer.run(2.5, lambda: shifted(-3600))
        check("stamps of another clock show", flags & STAMP_FAR and words["governor/command"][0] == 1, f"({flags}, {words.get('governor/command')})")
        still = now()
        flags, words = peer.run(3.5, lambda: still)
        check("a stamp that stands still shows", flags & STAMP_STANDS and words["governor/command"][0] == 2, f"({flags}, {words.get('governor/command')})")
        flags, _ = peer.run(1.5)
        check("and no longer", flags == 0, f"({flags})")
        second = Node(binary, os.path.join(folder, "health_2.txt"))
        flags, words = peer.run(5.0)
        check("a second node of the name shows", flags & NAME_TAKEN and words.get("name", (0,))[0] == 2, f"({flags}, {words.get('name')})")
        check("the second node ends in order", second.end())
        second = None
        peer.run(4.0)
        time.sleep(3.0)
        flags, words = peer.run(2.5)
        check("a trip stays when the inputs are back", flags & LATCHED and "reset_trip" in words["integration"][1], f"({flags}, {words.get('integration')})")
        reply = peer.call("reset_trip", 0)
        check("an operator resets it", reply is not None and reply.success)
        peer.states()
        flags, _ = peer.run(6.0)
        states = peer.states()
        check("and the twin follows again", flags == 0 and states and abs(states[-1].servomotor_position - 0.4) < 2e-3, f"({flags})")
        reply = peer.call("reset_trip", 0)
        check("there is nothing more to reset", reply is not None and not reply.success)
    finally:
        if second is not None:
            second.end()
        check("the node ends in order", node.end())
    node = Node(binary, os.path.join(folder, "health_age.txt"), "--max-stamp-age", "0.5")
    peer = Watcher()
    try:
        peer.matched()
        peer.run(2.0)
        flags, words = peer.run(4.5, lambda: shifted(-2))
        check("old stamps are refused, and the fail-safe acts", flags & STAMP_OLD and words["integration"][0] == 2, f"({flags}, {words.get('governor/command')}, {words.get('integration')})")
        flags, _ = peer.run(2.0)
        check("fresh ones are taken again", flags == 0, f"({flags})")
    finally:
        check("the node ends in order", node.end())
    print(f"{len(FAILED)} failed")
    return 1 if FAILED else 0


if __name__ == "__main__":
    sys.exit(main())
