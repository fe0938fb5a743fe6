#!/usr/bin/env python3
"""A peer of another maker recorded and played to: `govtwin record` hears it, `govtwin play` is heard by it.

Usage: fast_tape.py GOVTWIN FOLDER COMMAND...   (needs PyPI `cyclonedds` 11 and `mcap`; COMMAND is a peer that commands and watches as watch.py does)
Exits 0 when everything was as it should be, 1 otherwise, 77 where a package is missing.
"""

import glob
import os
import shutil
import subprocess
import sys
import time

from bench import check, FAILED
import types_ros as ros
from faults import Watch

try:
    from mcap.reader import make_reader
except ImportError as error:
    print(f"skipped: PyPI mcap is not there ({error}); `pip install mcap`")
    sys.exit(77)


def bag_of(folder):
    """Messages of a bag, by topic."""
    topics = {}
    for path in glob.glob(os.path.join(folder, "*.mcap")):
        with open(path, "rb") as file:
            for _, channel, message in make_reader(file).iter_messages():
                topics.setdefault(channel.topic, []).append(message.data)
    return topics


def main():
    binary, folder, command = sys.argv[1], sys.argv[2], sys.argv[3:]
    bag = os.path.join(folder, "fast_bag")
    shutil.rmtree(bag, ignore_errors=True)
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    # One at a time: Debian's Fast DDS 2.9 ends itself where a second participant comes (an assertion of its statistics, eProsima/Fast-DDS
    # pull request 3169).
    recorder = subprocess.Popen([binary, "record", "--out", bag, "--duration", "10"], **quiet)
    time.sleep(2.0)
    watch = Watch(command)
    try:
        ended = recorder.wait(60)
        # Its own states were not to be had: that is a warning.
        check("a recording ends in order", ended == 3, f"({ended})")
    finally:
        watch.end()
    topics = bag_of(bag)
    commands = [ros.GovernorCommand.deserialize(data).opening for data in topics.get("/governor/command", [])]
    check("its commands are recorded as it sent them", len(commands) > 350 and set(commands) == {0.3}, f"({len(commands)})")
    check("so are its other inputs", len(topics.get("/governor/tank_pressure", [])) > 30 and len(topics.get("/governor/esv", [])) > 3)
    # Some seconds of the node's states, driven by nobody, is as good a tape as any.
    node_bag = os.path.join(folder, "fast_states")
    shutil.rmtree(node_bag, ignore_errors=True)
    subprocess.run([binary, "run", "--optional", "command", "esv", "tank_pressure", "--duration", "4", "--bag", node_bag,
                    "--ros-args", "-p", "inputs.command.default:=0.3"], timeout=30, **quiet)
    count = len(bag_of(node_bag).get("/sim/servo_state", []))
    tape = subprocess.Popen([binary, "play", node_bag, "--topics", "/sim/servo_state"], **quiet)
    time.sleep(1.0)
    watch = Watch(command)
    try:
        heard, until = 0, time.monotonic() + 12
        while time.monotonic() < until:
            heard += sum(states for states, position in watch.lines() if abs(position - 0.3) < 2e-3)
            time.sleep(0.05)
        check("it hears a recording that is played", tape.wait(30) == 0 and heard > 0.9 * count > 300, f"({heard} of {count} states)")
    finally:
        watch.end()
    print(f"{len(FAILED)} failed")
    sys.exit(1 if FAILED else 0)


if __name__ == "__main__":
    main()
