#!/usr/bin/env python3
"""A running `govtwin run` on a bad network, with peers that come and go, and over some minutes.

Usage: network.py GOVTWIN FOLDER   (needs PyPI `cyclonedds` 11; ROS_DOMAIN_ID picks the domain; logs go to FOLDER)
CASES picks among: link callers unicast churn soak units together; the first three need root. SOAK_S, CHURN_S and UNITS_S are lengths, UNITS and CALLS
how many, OUTAGES those of the link, s. Exits 0 when everything was as it should be, 1 otherwise, 77 where nothing could be tried.
"""

import json
import os
import sys
import time

from bench import COUNTED, DOMAIN, RELIABLE, Bench, Machine, check, matched, now, run_cases, stamp_ns, wait_for, whole
from cyclonedds.domain import DomainParticipant
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
import types_ros as ros
from faults import Node, Watch
from relay import Network, is_possible

HERE = os.path.dirname(os.path.abspath(__file__))
# Name, what the network does, how long; the state's rate that is wanted then, Hz, of 100.
CONDITIONS = [
    ("an even network", {}, 6, 90),
    ("5 % of packets lost", {"loss": 0.05}, 10, 85),
    ("20 % of packets lost", {"loss": 0.2}, 10, 65),
    ("50 ms delay", {"delay_s": 0.05}, 10, 90),
    ("0 to 30 ms delay, reordered", {"jitter_s": 0.03}, 10, 30),
    ("10 % lost, 20 ms delay, reordered by 20 ms", {"loss": 0.1, "delay_s": 0.02, "jitter_s": 0.02}, 10, 30),
]
OUTAGES_S = [float(seconds) for seconds in os.environ.get("OUTAGES", "1 15").split()]


# An input may be silent for so long: stale after 1.5 s, held for 0.5 s.
LIMIT_S = 2.0


def trips(node):
    """How often the fail-safe acted."""
    return node.said().count("fail-safe: inputs are missing")


class Remote(Node):
    """A node in a namespace."""

    def __init__(self, side, binary, log, *more):
        self.side = side
        super().__init__(binary, log, *more)

    def command(self, arguments):
        return self.side.command(*arguments)


def across(watch, seconds):
    """States a second at the peer in the time to come, and the positions in them."""
    time.sleep(1.0)
    watch.lines()
    begin, states, positions = time.monotonic(), 0, []
    while time.monotonic() < begin + seconds:
        # Each line is of the half second before it.
        for count, position in watch.lines():
            states += count
            positions.append(position)
        time.sleep(0.05)
    return states / (0.5 * max(len(positions), 1)), positions


def link(binary, folder):
    """Loss, delay, reordering and outages between node and peer."""
    if not is_possible():
        return
    network = Network("gtn")
    figures = os.path.join(folder, "link.json")
    node = Remote(network.sides[0], binary, os.path.join(folder, "link.txt"), "--out", figures, "--lease", "3")
    watch = Watch(network.sides[1].command(sys.executable, os.path.join(HERE, "watch.py")))
    try:
        check("they meet across the relay", watch.until(lambda n, x: n > 0 and abs(x - 0.3) < 2e-3, 30) is not None)
        for name, conditions, seconds, wanted_hz in CONDITIONS:
            network.set(**conditions)
            rate_hz, positions = across(watch, seconds)
            if rate_hz <= wanted_hz:
                # Where all announcements of a lease are lost by chance, peers part and meet again, which takes seconds.
                rate_hz, again = across(watch, seconds)
                positions += again
            steady = positions and max(abs(x - 0.3) for x in positions) < 5e-3
            check(f"{name}: states come and nothing moves wrongly", steady and rate_hz > wanted_hz,
                  f"({rate_hz:.0f} a second; {min(positions, default=0):.4f} to {max(positions, default=0):.4f} pu)")
        network.set()
        opening = 0.3
        # Bad conditions before this may have parted the peers for longer than the limits.
        across(watch, 2.0)
        for seconds in OUTAGES_S:
            watch.lines()
            before = trips(node)
            network.set(is_up=False)
            time.sleep(seconds)
            network.set()
            # After a silence of 2 s the watch commands the other opening; about there it may be either.
            openings = {opening, 0.8 - opening} if 1.5 < seconds < 2.5 else {0.8 - opening if seconds > 2.0 else opening}
            reached = []
            watch.lines()
            back = watch.until(lambda n, x: n > 10 and reached.extend(y for y in openings if abs(x - y) < 2e-3) or reached, 40)
            opening = reached[0] if reached else opening
            check(f"a link that was down for {seconds:.0f} s works again", back is not None,
                  f"({back:.1f} s after it came back)" if back is not None else "(not within 40 s)")
            # What counts is how long nothing came across.
            silent_s, tripped = seconds + (back or 0.0), trips(node) > before
            check("an outage beyond the limits fails safe, a short one does not", tripped if seconds > LIMIT_S else not tripped or silent_s > LIMIT_S,
                  f"({silent_s:.1f} s, {trips(node) - before} times)")
    finally:
        watch.end()
        check("the node ends in order", node.end())
        network.close()
    with open(figures) as text:
        lost = json.load(text)["inputs"]["governor/command"]["lost"]
    check("what was lost is counted", lost > 100, f"({lost} commands; the relay lost {network.lost} of {network.lost + network.passed} packets)")


def call_together():
    """Three clients of one service in this process, two of them of one participant, call at a time; prints how many calls have no answer."""
    participants = [DomainParticipant(DOMAIN) for _ in range(2)]
    clients = []
    for participant in (participants[0], *participants):
        request = DataWriter(participant, Topic(participant, "rq/govtwin/get_parametersRequest", ros.GetParametersRequest), qos=RELIABLE)
        clients.append((request, DataReader(participant, Topic(participant, "rr/govtwin/get_parametersReply", ros.GetParametersResponse), qos=RELIABLE)))
    wait_for(lambda: all(matched(end) for client in clients for end in client), 30)
    print("ready", flush=True)
    sys.stdin.readline()
    unanswered, took = 0, []
    for number in range(int(os.environ.get("CALLS", "200"))):
        begin, waits = time.monotonic(), set(range(len(clients)))
        for caller, (request, _) in enumerate(clients):
            request.write(ros.GetParametersRequest(caller, number, ["rate"]))
        while waits and time.monotonic() < begin + 5:
            waits -= {caller for caller in waits for sample in whole(clients[caller][1].take(20)) if (sample.caller, sample.number) == (caller, number)}
            time.sleep(0.0005)
        unanswered += len(waits)
        took.append(time.monotonic() - begin)
    print(json.dumps({"calls": len(took) * len(clients), "unanswered": unanswered, "slowest_s": max(took)}))


def callers(binary, folder):
    """Clients of one service in one process of Cyclone DDS, while 10 % of the packets are lost: each call is answered."""
    if not is_possible():
        return
    network = Network("gtc")
    node = Remote(network.sides[0], binary, os.path.join(folder, "callers.txt"))
    try:
        said = network.losing(0.1, __file__, "call_together")
        check("each call is answered", said["unanswered"] == 0, f"({said})")
    finally:
        network.set()
        check("the node ends in order", node.end())
        network.close()


def unicast(binary, folder):
    """Where no multicast passes: a node that names its peer by ROS_STATIC_PEERS is found, and one that names nobody is not."""
    if not is_possible():
        return
    # As rmw_cyclonedds has it beside static peers: a participant at the port of its index, where a list of hosts can reach it.
    os.environ["CYCLONEDDS_URI"] = (
        "<CycloneDDS><Domain><Discovery><ParticipantIndex>auto</ParticipantIndex><LeaseDuration>2s</LeaseDuration>"
        "</Discovery></Domain></CycloneDDS>"
    )
    for peers in ("", "10.99.7.2"):
        network = Network("gtu")
        network.unicast_only = True
        os.environ["ROS_STATIC_PEERS"] = peers
        node = Remote(network.sides[0], binary, os.path.join(folder, f"unicast_{len(peers)}.txt"), "--lease", "3")
        watch = Watch(network.sides[1].command(sys.executable, os.path.join(HERE, "watch.py")))
        try:
            met = watch.until(lambda n, x: n > 0 and abs(x - 0.3) < 2e-3, 40 if peers else 8)
            if peers:
                check("a node that names its peer is found without multicast", met is not None, f"({met or 0:.1f} s)")
            else:
                check("without multicast and names nobody is found", met is None)
        finally:
            watch.end()
            check("the node ends in order", node.end())
            network.close()
            del os.environ["ROS_STATIC_PEERS"]
    del os.environ["CYCLONEDDS_URI"]


def resources(node):
    """Threads and descriptors of the node."""
    process = f"/proc/{node.process.pid}"
    return len(os.listdir(f"{process}/task")), len(os.listdir(f"{process}/fd"))


def churn(binary, folder):
    """A peer that joins and leaves each second while another one commands."""
    seconds = float(os.environ.get("CHURN_S", "60"))
    node = Node(binary, os.path.join(folder, "churn.txt"))
    bench = Bench()
    try:
        bench.drive(3.0, 0.4)
        before, threads = node.megabytes(), resources(node)
        begin, rounds, states, driven_s, positions = time.monotonic(), 0, 0, 0.0, []
        while time.monotonic() < begin + seconds:
            visitor = DomainParticipant(DOMAIN)
            readers = [DataReader(visitor, Topic(visitor, f"rt/sim/{name}", kind))
                       for name, kind in (("servo_state", ros.ServoState), ("joint_states", ros.JointState))]
            writer = DataWriter(visitor, Topic(visitor, "rt/plant/nothing", ros.EsvState))
            # What came while the visitor was made is not counted: that takes as long as the machine lets it.
            bench.state.take(1000)
            start = time.monotonic()
            got, _ = bench.drive(0.9, 0.4)
            driven_s += time.monotonic() - start
            states += len(got)
            positions += [sample.servomotor_position for sample in got]
            rounds += 1
            del readers, writer, visitor
        check("commands and states flow", states > 80 * driven_s, f"({states} states in {driven_s:.0f} s, {rounds} visitors)")
        check("and nothing moves wrongly", max(abs(x - 0.4) for x in positions) < 2e-3)
        time.sleep(2.0)
        after, now = node.megabytes(), resources(node)
        check("memory, threads and descriptors stay", after - before < 8 and now[0] <= threads[0] and now[1] <= threads[1] + 2,
              f"({before:.1f} -> {after:.1f} MB, {threads} -> {now})")
    finally:
        check("the node ends in order", node.end())


def slope(times, values):
    """Least-squares slope an hour with its 95 % interval, from the means of 20 spans of time: neighbours depend on each other."""
    count = min(20, len(times))
    spans = [range(len(times) * k // count, len(times) * (k + 1) // count) for k in range(count)]
    t = [sum(times[n] for n in span) / len(span) / 3600 for span in spans]
    v = [sum(values[n] for n in span) / len(span) for span in spans]
    mean_t, mean_v = sum(t) / count, sum(v) / count
    spread = sum((one - mean_t) ** 2 for one in t)
    rise = sum((a - mean_t) * (b - mean_v) for a, b in zip(t, v)) / spread
    rest = sum((b - mean_v - rise * (a - mean_t)) ** 2 for a, b in zip(t, v))
    # Student's t of 18 degrees of freedom.
    return rise, 2.10 * (rest / max(count - 2, 1) / spread) ** 0.5


def soak(binary, folder):
    """SOAK_S at 100 Hz (180 s): slopes of memory, descriptors, threads, and of the model's time against the clock."""
    seconds = float(os.environ.get("SOAK_S", "180"))
    figures = os.path.join(folder, "soak.json")
    node = Node(binary, os.path.join(folder, "soak.txt"), "--out", figures)
    bench = Bench()
    try:
        # Rings and the transport's caches fill first: 80 s at 100 Hz.
        bench.drive(100.0, 0.4)
        begin, times, rows, states = time.monotonic(), [], [], 0
        while time.monotonic() < begin + seconds:
            got, _ = bench.drive(5.0, 0.4 + 0.1 * (len(times) % 2))
            states += len(got)
            times.append(time.monotonic() - begin)
            # The newest of the last 100 states: what delays single ones is not drift.
            ahead_ms = max((stamp_ns(state.header) - time.time_ns()) * 1e-6 for state in got[-3:]) if got else float("nan")
            rows.append((node.megabytes(), *resources(node), ahead_ms))
        memory, threads, files, ahead_ms = zip(*rows)
        print("     MB each minute: " + " ".join(f"{size:.1f}" for size in memory[::12]))
        rise, either_way = slope(times, memory)
        check("memory does not grow", rise - either_way < 2.0,
              f"({rise:+.2f} +- {either_way:.2f} MB an hour over {times[-1]:.0f} s; {memory[0]:.1f} -> {memory[-1]:.1f} MB)")
        check("nor do threads and descriptors", max(threads) <= threads[0] and max(files) <= files[0] + 1,
              f"(threads {min(threads)} to {max(threads)}, descriptors {min(files)} to {max(files)})")
        drift, either_way = slope(times, ahead_ms)
        check("the model's time keeps to the clock", abs(drift) < 5.0 + either_way, f"({drift:+.2f} +- {either_way:.2f} ms an hour)")
        check("states keep their rate", states > 95 * times[-1], f"({states / times[-1]:.1f} a second)")
    finally:
        check("the node ends in order", node.end())
    with open(figures) as text:
        run = json.load(text)
    print(f"     wake-up lateness {run['loop']['lateness']['p99_9_us']:.0f} us at 99.9 %, {run['loop']['overruns']} overruns, {run['loop']['skipped']} ticks "
          f"skipped, {run['lost_publications']} publications lost, {run['inputs']['governor/command']['lost']} commands lost; load {os.getloadavg()[2]:.1f}")


def together(binary, folder):
    """The same units as nodes of one process, with one thread that integrates or THREADS."""
    count, log = int(os.environ.get("UNITS", "10")), os.path.join(folder, "together")
    of_units = [word for n in range(count) for word in ("--unit", f"unit{n}")]
    node = Node(binary, f"{log}.txt", "--optional", "esv", "tank_pressure", "--rate", "1000", "--out", f"{log}.json", "--threads", os.environ.get("THREADS", "1"),
                *of_units)
    drive_units([node], count, lambda: [unit["loop"] for unit in json.load(open(f"{log}.json"))["units"].values()])


def units(binary, folder):
    """UNITS nodes (10) at 1 kHz beside each other, each with a namespace and a command of its own, for UNITS_S (20)."""
    count = int(os.environ.get("UNITS", "10"))
    figures = [os.path.join(folder, f"unit_{n}.json") for n in range(count)]
    nodes = [Node(binary, os.path.join(folder, f"unit_{n}.txt"), "--optional", "esv", "tank_pressure", "--rate", "1000", "--out", figures[n],
                  "--ros-args", "-r", f"__ns:=/unit{n}") for n in range(count)]
    drive_units(nodes, count, lambda: [json.load(open(name))["loop"] for name in figures])


def drive_units(nodes, count, loops_of):
    """Commands each unit in its namespace and looks at what comes back, and at the figures at the end."""
    seconds = float(os.environ.get("UNITS_S", "20"))
    participant = DomainParticipant(DOMAIN)
    ends = [(DataWriter(participant, Topic(participant, f"rt/unit{n}/governor/command", ros.GovernorCommand), qos=RELIABLE),
             DataReader(participant, Topic(participant, f"rt/unit{n}/sim/servo_state", ros.ServoState), qos=COUNTED)) for n in range(count)]
    openings, states, last = [0.1 + 0.05 * n for n in range(count)], [0] * count, [None] * count
    try:
        wait_for(lambda: all(matched(writer) for writer, _ in ends), 30)
        with Machine() as machine:
            begin, settled = time.monotonic(), False
            while time.monotonic() < begin + seconds + 3:
                loop = time.monotonic()
                for n, (writer, reader) in enumerate(ends):
                    writer.write(ros.GovernorCommand(now(), openings[n]))
                    got = whole(reader.take(1000))
                    states[n] += len(got)
                    last[n] = got[-1] if got else last[n]
                if not settled and loop > begin + 3:
                    states, settled, start = [0] * count, True, loop
                time.sleep(max(0.0, loop + 0.05 - time.monotonic()))
        took = time.monotonic() - start - machine.lost_s
        worst = max(abs(state.servomotor_position - opening) if state else 1.0 for state, opening in zip(last, openings))
        check("each unit follows its own command", worst < 2e-3, f"({worst:.4f} pu at most)")
        check("and keeps its rate", min(states) > 95 * took, f"({min(states) / took:.0f} to {max(states) / took:.0f} a second)")
        memory = sum(node.megabytes() for node in nodes)
    finally:
        check("all end in order", all([node.end() for node in nodes]))
    loops = loops_of()
    late, overruns = [loop["lateness"]["p99_9_us"] for loop in loops], [loop["overruns"] for loop in loops]
    skipped, ticks = sum(loop["skipped"] for loop in loops), sum(loop["ticks"] for loop in loops)
    # A loop that is 100 ms behind skips ticks: where the machine kept a bare loop waiting, each unit may have skipped as many.
    check("hardly a tick is skipped", skipped <= ticks // 1000 + count * 1000 * machine.lost_s, f"({skipped} of {ticks}; a bare loop lost {machine.lost_s:.1f} s)")
    print(f"     wake-up lateness at 99.9 % {min(late):.0f} to {max(late):.0f} us, overruns {sum(overruns)} of {ticks}, {memory:.0f} MB together, "
          f"load {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores")


if __name__ == "__main__":
    call_together() if sys.argv[1:] == ["call_together"] else run_cases(sys.argv[2], link, callers, unicast, churn, soak, units, together)
