#!/usr/bin/env python3
"""A hydro unit around the twin: this process is water, turbine, rotor, grid and governor; `govtwin run` is the servo system.

Usage: couple.py [--mode lockstep|free] [--case rejection|island|grid] [--seconds S] [--govtwin PROGRAM] [--csv FILE]

It starts the twin itself, commands it over DDS (PyPI `cyclonedds` 11, no ROS), takes the servomotor's position from
`sim/joint_states`, and gives the head of now back as a force on the piston, `effort` of `sim/joint_commands`.
lockstep: the twin stands until this process has advanced by 10 ms, then steps by as much; every run is the same to the last bit.
free: both run with the machine's clock, as on a bench.
The figures at the end are in per unit beyond the rated value; the exit code is 1 where the servomotor did not follow.
"""

import argparse
import csv
import itertools
import os
import subprocess
import sys
import time

from cyclonedds.core import Policy, Qos
from cyclonedds.domain import DomainParticipant
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from cyclonedds.util import duration

import messages as ros
from plant import Plant, pressure_rise_bound

PERIOD_S = 0.01
TICKS = 10
STROKE_M = 0.60
TANK_PRESSURE_PA = 6.3e6
SETTLE_S = 5.0
RELIABLE = Qos(Policy.Reliability.Reliable(duration(milliseconds=100)), Policy.History.KeepLast(10))


class Bus:
    """The twin as this process sees it."""

    def __init__(self, domain):
        participant = DomainParticipant(domain)
        writer = lambda name, kind: DataWriter(participant, Topic(participant, name, kind), qos=RELIABLE)
        reader = lambda name, kind: DataReader(participant, Topic(participant, name, kind), qos=RELIABLE)
        self.command = writer("rt/governor/command", ros.GovernorCommand)
        self.esv = writer("rt/governor/esv", ros.EsvState)
        self.pressure = writer("rt/governor/tank_pressure", ros.FluidPressure)
        self.load = writer("rt/sim/joint_commands", ros.JointState)
        self.joints = reader("rt/sim/joint_states", ros.JointState)
        self.step_call = writer("rq/govtwin/step_simulationRequest", ros.StepRequest)
        self.step_reply = reader("rr/govtwin/step_simulationReply", ros.StepResponse)
        self.numbers = itertools.count(1)
        self.position_m = None

    def is_whole(self):
        writers = (self.command, self.esv, self.pressure, self.load, self.step_call)
        readers = (self.joints, self.step_reply)
        return all(one.get_matched_subscriptions() for one in writers) and all(one.get_matched_publications() for one in readers)

    def tell(self, time_s, command, force_n):
        """All inputs of the twin at one instant of the plant's time."""
        ns = round(time_s * 1e9)
        header = ros.Header(ros.Time(ns // 10**9, ns % 10**9), "plant")
        self.esv.write(ros.EsvState(header, 1))
        self.pressure.write(ros.FluidPressure(header, TANK_PRESSURE_PA, 0.0))
        self.load.write(ros.JointState(header, ["servomotor"], [], [], [force_n]))
        self.command.write(ros.GovernorCommand(header, command))

    def hear(self):
        """The newest opening of the servomotor, pu; the one before where nothing came."""
        for sample in self.joints.take(1000):
            if sample.sample_info.valid_data:
                self.position_m = sample.position[sample.name.index("servomotor")]
        return None if self.position_m is None else self.position_m / STROKE_M

    def step(self, ticks):
        """Lets the twin do so many ticks; its states are here once the answer is."""
        number = next(self.numbers)
        self.step_call.write(ros.StepRequest(0x0102030405060708, number, ticks))
        until = time.monotonic() + 10.0
        while time.monotonic() < until:
            for sample in self.step_reply.take(10):
                if sample.sample_info.valid_data and sample.number == number:
                    if sample.result.result != 1:
                        raise RuntimeError(f"the twin did not step: {sample.result.error_message}")
                    return
            time.sleep(0.0002)
        raise RuntimeError("the twin did not answer within 10 s")


def run(bus, plant, case, mode, seconds):
    """The coupled run; rows of time, command, opening, head, speed and power."""
    rows, begin = [], time.monotonic()
    steps = round((SETTLE_S + seconds) / PERIOD_S)
    command = plant.opening
    for step in range(steps):
        happened = step * PERIOD_S >= SETTLE_S
        if happened and case == "rejection":
            plant.breaker = "open"
        elif happened and case == "island":
            plant.load = 0.60
        elif happened and case == "grid":
            plant.opening_reference = 0.55
        bus.tell(plant.time_s, command, plant.vane_force_n())
        if mode == "lockstep":
            bus.step(TICKS)
        else:
            time.sleep(max(0.0, begin + (step + 1) * PERIOD_S - time.monotonic()))
        opening = bus.hear()
        plant.advance(plant.opening if opening is None else min(max(opening, 0.0), 1.0), PERIOD_S)
        command = plant.command(PERIOD_S)
        rows.append((plant.time_s - SETTLE_S, command, plant.opening, plant.head, plant.speed,
                     plant.mechanical_power, plant.electrical_power))
    return rows, time.monotonic() - begin


def figures(rows, flow):
    """What a hydro engineer asks of such a run."""
    after = [row for row in rows if row[0] > 0.0]
    # Over a tenth of a second: with the machine's clock a period more or less has a state of its own.
    fastest = max((a[2] - b[2]) / (10 * PERIOD_S) for a, b in zip(after, after[10:]))
    return {
        "over-speed": max(row[4] for row in after) - 1.0,
        "least speed": min(row[4] for row in after) - 1.0,
        "pressure rise": max(row[3] for row in after) - 1.0,
        "pressure drop": min(row[3] for row in after) - 1.0,
        "fastest closing, 1/s": fastest,
        "rise of a linear closure at that rate": pressure_rise_bound(flow, 1.0 / fastest) if fastest > 1e-3 else 0.0,
        "speed at the end": after[-1][4],
        "opening at the end": after[-1][2],
    }


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--mode", choices=("lockstep", "free"), default="lockstep")
    parser.add_argument("--case", choices=("rejection", "island", "grid"), default="rejection")
    parser.add_argument("--seconds", type=float, default=30.0, help="after the event")
    parser.add_argument("--govtwin", default="govtwin", help="the program")
    parser.add_argument("--csv", help="write the rows here")
    options = parser.parse_args()
    domain = int(os.environ.get("ROS_DOMAIN_ID", "0"))
    plant = Plant(load=0.50 if options.case != "rejection" else 0.95, breaker="island" if options.case == "island" else "grid")
    flow = plant.flow
    lockstep = ["--paused", "--publish-clock"] if options.mode == "lockstep" else []
    # The twin publishes as often as this plant asks, so that each period has its state.
    twin = subprocess.Popen([options.govtwin, "run", "--publish-rate", "200", *lockstep],
                            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        bus = Bus(domain)
        until = time.monotonic() + 15.0
        while not bus.is_whole():
            if time.monotonic() > until or twin.poll() is not None:
                sys.exit("the twin did not come on the bus within 15 s; is ROS_DOMAIN_ID the same, and is the program right?")
            time.sleep(0.05)
        rows, took_s = run(bus, plant, options.case, options.mode, options.seconds)
    finally:
        twin.terminate()
        twin.wait(10)
    print(f"{options.case}, {options.mode}: {len(rows) * PERIOD_S:.1f} s in {took_s:.1f} s, "
          f"{len(rows) * PERIOD_S / took_s:.1f} times real time")
    for name, value in figures(rows, flow).items():
        print(f"  {name:<40}{value:+.4f}")
    if options.csv:
        with open(options.csv, "w", newline="") as file:
            writer = csv.writer(file)
            writer.writerow(("time_s", "command_pu", "opening_pu", "head_pu", "speed_pu", "mechanical_pu", "electrical_pu"))
            writer.writerows(rows)
    followed = max(abs(row[1] - row[2]) for row in rows[-100:])
    if followed > 0.02:
        sys.exit(f"the servomotor stands {followed:.3f} pu off its command at the end: the coupling did not work")


if __name__ == "__main__":
    main()
