#!/usr/bin/env python3
"""Lock-step over a network that loses packets: the same to the last bit in every run, or refused with the inputs that are missing.

Usage: lossy_steps.py GOVTWIN FOLDER   (needs PyPI `cyclonedds` 11, root and /dev/net/tun; ROS_DOMAIN_ID picks the domain; logs go to FOLDER)
LOSS is the share of packets lost (0.05), RUNS how many, STEPS how long each is. Exits 0 when everything was as it should be, 1 otherwise, 77 where
nothing could be tried.
"""

import json
import os
import sys
import time

from bench import check, matched, wait_for, whole, FAILED, stamp_ns
from relay import Network, is_possible
import types_ros as ros

LOSS = float(os.environ.get("LOSS", "0.05"))
RUNS = int(os.environ.get("RUNS", "10"))
STEPS = int(os.environ.get("STEPS", "150"))
NAMED = ("--step-waits-for", "command", "esv", "tank_pressure", "--step-timeout", "5")
TICKS = 10


def drive():
    """A peer that commands another opening at each step; prints what became of each step."""
    from simulate import Driver, result

    driver = Driver()
    driver.matched()
    for name in ("step_simulation", "get_simulation_state"):
        call, reply = driver.calls[name]
        wait_for(lambda: matched(call) and matched(reply), 20)
    time.sleep(1.0)
    print("ready", flush=True)
    sys.stdin.readline()
    positions = {}

    def take():
        for state in whole(driver.reliable_state.take(1000)):
            positions[stamp_ns(state.header)] = state.servomotor_position.hex()
        return len(positions)

    for step in range(STEPS):
        header = ros.Header(ros.Time(step // 100, 10_000_000 * (step % 100) + 1), "lossy")
        driver.command.write(ros.GovernorCommand(header, 0.3 + 0.3 * (step % 37) / 37))
        driver.pressure.write(ros.FluidPressure(header, 6.3e6 - 1e3 * step, 0.0))
        driver.esv.write(ros.EsvState(header, 1))
        reply = driver.call("step_simulation", TICKS, seconds=20)
        if result(reply) != 1:
            print(json.dumps({"refused": None if reply is None else reply.result.error_message, "step": step}))
            return
        # A step gives two states, one of the period and one at its end; both may be on their way once more.
        wait_for(lambda: take() >= 2 * (step + 1), 10)
    print(json.dumps({"positions": sorted(positions.items()), "said": reply.result.error_message}))


def run(binary, folder, number, options):
    from network import Remote

    network = Network("gtl", seed=number)
    node = Remote(network.sides[0], binary, os.path.join(folder, f"lossy_{number}.txt"), "--paused", "--publish-clock", *options)
    try:
        return network.losing(LOSS, __file__, "drive")
    finally:
        network.set()
        check("the node ends in order", node.end())
        network.close()


def main():
    if not is_possible():
        return 77
    options = NAMED if os.environ.get("NAMED", "1") == "1" else ()
    runs = [run(sys.argv[1], sys.argv[2], number, options) for number in range(RUNS)]
    refused = [one for one in runs if "refused" in one]
    done = [one["positions"] for one in runs if "positions" in one]
    distinct = {json.dumps(positions) for positions in done}
    check(f"{RUNS} runs with {LOSS:.0%} of packets lost are the same to the last bit, or refused", len(distinct) <= 1 and all(one["refused"] for one in refused),
          f"({len(done)} done, {len(distinct)} different, {len(refused)} refused {refused[:2]}; {[len(one) for one in done]} states)")
    check("most are done", len(done) >= 0.5 * RUNS)
    print(f"{len(FAILED)} failed")
    return 1 if FAILED else 0


if __name__ == "__main__":
    sys.exit(drive() if sys.argv[1:] == ["drive"] else main())
