#!/usr/bin/env python3
"""How late the node's loop wakes, and how old a command is when it acts, beside a bare loop and a plain Cyclone DDS echo in the same run.

Usage: latency.py GOVTWIN FOLDER   (a study, not part of the tests; the figures stand in docs/ros2.md)
Needs Debian's cyclonedds-dev and cyclonedds-tools, PyPI `mcap`, gcc, and the right to SCHED_FIFO. RUN_S is the length of a run (60), RATES the node's rates in Hz, LOADS how many busy loops run beside it, CORE where
the node's loop and the bare loop run. Exits 0 when all runs gave figures, 1 otherwise, 77 where something is missing.
"""

import json
import os
import shutil
import signal
import struct
import subprocess
import sys
import time

HERE = os.path.dirname(os.path.abspath(__file__))
SECONDS = int(os.environ.get("RUN_S", "60"))
RATES = [int(rate) for rate in os.environ.get("RATES", "1000 2000").split()]
LOADS = [int(load) for load in os.environ.get("LOADS", "0 2").split()]
CORE = int(os.environ.get("CORE", str(os.cpu_count() - 1)))
DOMAIN = os.environ.setdefault("ROS_DOMAIN_ID", "96")
ROWS = ["bare loop, lateness", "node, lateness", "command sent to in force", "command sent to state received", "plain echo, there and back"]


def build(folder):
    """The peer in C."""
    idl, peer = os.path.join(HERE, "latency", "latency.idl"), os.path.join(folder, "peer")
    subprocess.run(["idlc", idl], cwd=folder, check=True)
    source = [os.path.join(HERE, "latency", "peer.c"), os.path.join(folder, "latency.c")]
    subprocess.run(["gcc", "-O2", "-Wall", "-I", folder, "-o", peer, *source, "-lddsc", "-lm"], check=True)
    return peer


def quantiles(values):
    """p50, p99, p99.9 and the largest, in us, of times in ns."""
    values = sorted(values)
    return [values[min(len(values) - 1, int(share * len(values)))] * 1e-3 for share in (0.5, 0.99, 0.999, 1.0)] if values else [float("nan")] * 4


def in_force(bag):
    """The tick at which each command acted, by its opening, from the node's bag."""
    from mcap.reader import make_reader
    found = {}
    for name in os.listdir(bag):
        if name.endswith(".mcap"):
            with open(os.path.join(bag, name), "rb") as file:
                for _, _, message in make_reader(file).iter_messages(topics=["/governor/command"]):
                    seconds, nanos, length = struct.unpack_from("<iII", message.data, 4)
                    at = 12 + length + 4
                    at = 4 + (at - 4 + 7) // 8 * 8
                    found.setdefault(struct.unpack_from("<d", message.data, at)[0], seconds * 10**9 + nanos)
    return found


def run(binary, folder, peer, rate, load):
    """One run; the rows of the table."""
    bag, figures, events, lateness = (os.path.join(folder, name) for name in ("bag", "run.json", "events.txt", "bare.txt"))
    shutil.rmtree(bag, ignore_errors=True)
    real_time = ["chrt", "-f", "70"]
    others = [subprocess.Popen(["sh", "-c", "while :; do :; done"]) for _ in range(load)]
    others.append(subprocess.Popen([*real_time, peer, "echo"]))
    log = open(os.path.join(folder, "node.txt"), "w")
    node = subprocess.Popen([binary, "run", "--rate", str(rate), "--publish-rate", str(rate), "--cpu", str(CORE), "--optional", "esv", "tank_pressure",
                             "--bag", bag, "--out", figures], stdout=log, stderr=log)
    try:
        time.sleep(3)
        loop = subprocess.Popen(["taskset", "-c", str(CORE), "chrt", "-f", "80", peer, "bare", str(SECONDS), str(10**9 // rate), lateness])
        subprocess.run([*real_time, peer, "drive", str(SECONDS), events], check=True)
        loop.wait(30)
    finally:
        node.send_signal(signal.SIGINT)
        node.wait(20)
        for other in others:
            other.kill()
            other.wait()
    words = [line.split() for line in open(events)]
    sent = {float(row[2]): int(row[1]) for row in words if row[0] == "sent"}
    echoes = [int(row[2]) - int(row[1]) for row in words if row[0] == "echo"]
    states = sorted((int(row[1]), int(row[2])) for row in words if row[0] == "state")
    ticks, to_tick, to_state, place = in_force(bag), [], [], 0
    for tick, begin in sorted((ticks[opening], begin) for opening, begin in sent.items() if opening in ticks):
        to_tick.append(tick - begin)
        while place < len(states) and states[place][0] < tick:
            place += 1
        if place < len(states):
            to_state.append(states[place][1] - begin)
    with open(figures) as text:
        loop = json.load(text)["loop"]
    node_late = [loop["lateness"][name] for name in ("p50_us", "p99_us", "p99_9_us", "max_us")]
    rows = [quantiles([int(line) for line in open(lateness)]), node_late, quantiles(to_tick), quantiles(to_state), quantiles(echoes)]
    heard = f"{len(to_tick)} of {len(sent)} commands acted, {len(echoes)} echoes, {len(states)} states, {loop['ticks']} ticks, {loop['overruns']} overruns, {loop['skipped']} skipped"
    return rows, heard


def main():
    binary, folder = sys.argv[1], os.path.join(sys.argv[2], "latency")
    try:
        import mcap  # noqa: F401
    except ImportError:
        mcap = None
    if mcap is None or not all(map(shutil.which, ("idlc", "gcc", "chrt", "taskset"))):
        print("skipped: needs cyclonedds-dev, cyclonedds-tools, gcc and PyPI mcap")
        sys.exit(77)
    os.makedirs(folder, exist_ok=True)
    peer, whole = build(folder), True
    for rate in RATES:
        for load in LOADS:
            rows, heard = run(binary, folder, peer, rate, load)
            print(f"-- {rate} Hz, {SECONDS} s, {load} busy loops besides, load {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores: {heard}")
            print(f"{'us':<34}{'p50':>10}{'p99':>10}{'p99.9':>10}{'max':>10}")
            for name, row in zip(ROWS, rows):
                whole = whole and len(row) == 4
                print(f"{name:<34}" + "".join(f"{one:>10.0f}" for one in row))
            print(f"p99.9 lateness, node by bare loop: {rows[1][2] / max(rows[0][2], 1):.2f}", flush=True)
    sys.exit(0 if whole else 1)


if __name__ == "__main__":
    main()
