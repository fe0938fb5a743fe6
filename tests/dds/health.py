#!/usr/bin/env python3
"""What goes wrong with inputs and node shows in `sim/status` and `/diagnostics` while it lasts: two commanders, stamps that are old, stand still or are far
off, a second node of the same name, a trip that stays until it is reset.

Usage: health.py GOVTWIN FOLDER   (needs PyPI `cyclonedds` 11; ROS_DOMAIN_ID picks the domain; logs go to FOLDER)
Exits 0 when everything was as it should be, 1 otherwise, 77 without cyclonedds.
"""

import os
import sys
import time

from bench import DOMAIN, RELIABLE, check, matched, now, wait_for, whole, FAILED
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

    def run(self, until, header=now, seconds=30):
        """Commands with these headers until flags and words are so; returns whether they came to be so, flags of the last states, and words by part."""
        begin, flags, words, is_so = time.monotonic(), None, {}, False
        self.status.take(1000), self.diagnostics.take(1000)
        step = 0
        while time.monotonic() < begin + seconds and not is_so:
            self.command.write(ros.GovernorCommand(header(), 0.4))
            if step % 10 == 0:
                self.pressure.write(ros.FluidPressure(now(), 6.3e6, 0.0))
                self.esv.write(ros.EsvState(now(), 1))
            for status in whole(self.status.take(1000)):
                flags = status.health
            for array in whole(self.diagnostics.take(100)):
                words.update({status.name.split(": ")[-1]: (status.level, status.message) for status in array.status})
            is_so = flags is not None and bool(words) and bool(until(flags, words))
            step += 1
            time.sleep(0.01)
        return is_so, flags, words

    def shows(self, what, condition, header=now):
        """Checks that flags and words come to be so."""
        is_so, flags, words = self.run(condition, header)
        check(what, is_so, f"({flags}, { {part: said for part, said in words.items() if said[0] > 0} })")


def fine(flags, words):
    return flags == 0


def shows(flag, part, level=2, says=""):
    """What a flag and the level of a part of `/diagnostics` say, both at once."""
    return lambda flags, words: flags & flag and words.get(part, (0,))[0] == level and says in words[part][1]


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
        peer.shows("nothing is wrong at first", fine)
        rival = DomainParticipant(DOMAIN)
        other = DataWriter(rival, Topic(rival, "rt/governor/command", ros.GovernorCommand), qos=RELIABLE)
        wait_for(lambda: matched(other), 10)

        def two():
            other.write(ros.GovernorCommand(now(), 0.2))
            return now()

        peer.shows("two commanders show while they last", shows(COMPETING, "governor/command"), two)
        del other, rival
        peer.shows("and no longer", fine)
        peer.shows("stamps of another clock show", shows(STAMP_FAR, "governor/command", 1), lambda: shifted(-3600))
        still = now()
        peer.shows("a stamp that stands still shows", shows(STAMP_STANDS, "governor/command"), lambda: still)
        peer.shows("and no longer", fine)
        second = Node(binary, os.path.join(folder, "health_2.txt"))
        peer.shows("a second node of the name shows", shows(NAME_TAKEN, "name"))
        check("the second node ends in order", second.end())
        second = None
        peer.shows("which is alone again", fine)
        node.says("fail-safe: inputs are missing")
        latched = shows(LATCHED, "integration", says="reset_trip")
        peer.run(lambda flags, words: False, seconds=2.5)
        peer.shows("a trip stays when the inputs are back", latched)
        reply = peer.call("reset_trip", 0)
        check("an operator resets it", reply is not None and reply.success)
        follows = lambda flags, words: flags == 0 and (states := peer.states()) and abs(states[-1].servomotor_position - 0.4) < 2e-3
        peer.shows("and the twin follows again", follows)
        reply = peer.call("reset_trip", 0)
        check("there is nothing more to reset", reply is not None and not reply.success)
    finally:
        if second is not None:
            second.end()
        check("the node ends in order", node.end())
        del peer
    node = Node(binary, os.path.join(folder, "health_age.txt"), "--max-stamp-age", "0.5")
    peer = Watcher()
    try:
        peer.matched()
        peer.run(fine)
        peer.shows("old stamps are refused, and the fail-safe acts", shows(STAMP_OLD, "integration"), lambda: shifted(-2))
        peer.shows("fresh ones are taken again", fine)
    finally:
        check("the node ends in order", node.end())
    print(f"{len(FAILED)} failed")
    return 1 if FAILED else 0


if __name__ == "__main__":
    sys.exit(main())
