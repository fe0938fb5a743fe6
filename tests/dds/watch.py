#!/usr/bin/env python3
"""A peer on Cyclone DDS that commands the node and prints, each half second, how many states it received.

Usage: watch.py   (needs PyPI `cyclonedds` 11; ROS_DOMAIN_ID picks the domain; ends at SIGTERM)
It commands an opening of 0.3, and changes between 0.3 and 0.5 after each silence of 2 s, its own or the node's.
Its lease is 2 s, so that a pause outlasts it soon.
"""

import os
import time

os.environ.setdefault(
    "CYCLONEDDS_URI",
    "<CycloneDDS><Domain><Discovery><LeaseDuration>2s</LeaseDuration></Discovery></Domain></CycloneDDS>",
)

from bench import Bench, now, whole  # noqa: E402  (the environment comes first)
import types_ros as ros  # noqa: E402


def main():
    bench = Bench()
    openings = [0.3, 0.5]
    count, position, heard, told = 0, float("nan"), None, time.monotonic()
    step = 0
    while True:
        loop = time.monotonic()
        bench.command.write(ros.GovernorCommand(now(), openings[0]))
        if step % 10 == 0:
            bench.pressure.write(ros.FluidPressure(now(), 6.3e6, 0.0))
            bench.esv.write(ros.EsvState(now(), 1))
        step += 1
        time.sleep(0.01)
        states = whole(bench.state.take(1000))
        at = time.monotonic()
        silent = heard is not None and states and at - heard > 2.0
        if silent or at - loop > 2.0:
            openings.reverse()
            heard = at
        if states:
            count, position, heard = count + len(states), states[-1].servomotor_position, at
        if at - told >= 0.5:
            print(f"states {count} at {position:.5f}", flush=True)
            count, told = 0, at


if __name__ == "__main__":
    main()
