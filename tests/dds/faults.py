#!/usr/bin/env python3
"""Faults of a bench against a running `govtwin run`: large replies, pauses past the lease, hostile packets.

Usage: faults.py GOVTWIN FOLDER [--watch COMMAND...]   (needs PyPI `cyclonedds` 11; ROS_DOMAIN_ID picks the domain)
The node's logs go to FOLDER. COMMAND is a peer of another maker that commands and watches as `watch.py` does; by
default `watch.py` itself, on Cyclone DDS. Packets are sent to 127.0.0.1 only, with bounded counts.
Exits 0 when everything was as it should be, 1 otherwise, 77 where cyclonedds is missing.
"""

import json
import os
import random
import signal
import socket
import struct
import subprocess
import sys
import time

from bench import COUNTED, DOMAIN, ENDS_S, Bench, DataReader, Machine, Policy, Qos, Topic, check, duration, end_process, now, wait_for, whole, FAILED
import types_ros as ros

LEASE_S = 3.0
# Seconds of each pause. A peer's lease is 2 s in this test; the node looks for expired leases every 2 s.
PAUSES_S = [float(seconds) for seconds in os.environ.get("PAUSES", "1 9").split()]
MOST_MEGABYTES = 150


class Node:
    """A running node, with its log in a file."""

    def __init__(self, binary, log, *more):
        self.log_path = log
        self.log = open(log, "w")
        hold = () if "--hold" in more else ("--hold", "0.5")
        arguments = [binary, "run", "--stale-after", "1.5", *hold, *([] if "--latch" in more else ["--auto-reset"]), *(one for one in more if one != "--latch")]
        self.process = subprocess.Popen(self.command(arguments), stderr=self.log, stdout=self.log)

    def command(self, arguments):
        """How it is started."""
        return arguments

    def said(self):
        """Its log up to now."""
        with open(self.log_path) as log:
            return log.read()

    def says(self, words, count=1, seconds=30):
        """Waits until the log has these words so often; whether it has them just so often."""
        wait_for(lambda: self.said().count(words) >= count, seconds)
        return self.said().count(words) == count

    def megabytes(self):
        with open(f"/proc/{self.process.pid}/statm") as statm:
            return int(statm.read().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6

    def end(self):
        """Ends it by SIGINT; whether it went with exit code 0."""
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGINT)
        try:
            return self.process.wait(ENDS_S) == 0
        except subprocess.TimeoutExpired:
            return False
        finally:
            if self.process.poll() is None:
                self.process.kill()
                self.process.wait()
            self.log.close()


def large_replies(binary, folder):
    """Replies above one datagram, as `ros2 param list` asks for."""
    node = Node(binary, os.path.join(folder, "replies.txt"))
    bench = Bench()
    try:
        request = ros.ListParametersRequest(0x0102030405060708, 1, [], 0)
        reply = bench.ask(bench.list_call, bench.list_reply, request, 10)
        names = reply.names if reply else []
        check("a Cyclone caller gets the list of all parameters", len(names) > 50 and "hold" in names,
              f"({len(names)} names, {sum(map(len, names))} characters)")
        if names:
            request = ros.DescribeParametersRequest(0x0102030405060708, 2, list(names))
            reply = bench.ask(bench.describe_call, bench.describe_reply, request, 10)
            described = [d.name for d in reply.descriptors] if reply else []
            check("and the descriptors of all", described == list(names), f"({len(described)} descriptors)")
    finally:
        node.end()


class Watch:
    """A peer in a process of its own that prints, each half second, the states it received and the last position."""

    def __init__(self, command):
        self.process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, bufsize=1)
        os.set_blocking(self.process.stdout.fileno(), False)
        self.rest = ""

    def lines(self):
        """What it printed since the last call: (states, position) for each line."""
        try:
            self.rest += self.process.stdout.read() or ""
        except (BlockingIOError, TypeError):
            pass
        whole, _, self.rest = self.rest.rpartition("\n")
        rows = [line.split() for line in whole.splitlines()]
        return [(int(row[1]), float(row[3])) for row in rows if len(row) == 4 and row[0] == "states"]

    def until(self, condition, seconds):
        """Seconds until a line fulfils the condition; None where none does."""
        begin = time.monotonic()
        while time.monotonic() < begin + seconds:
            if any(condition(*line) for line in self.lines()):
                return time.monotonic() - begin
            time.sleep(0.05)
        return None

    def end(self):
        self.process.send_signal(signal.SIGCONT)
        end_process(self.process)


def pauses(binary, folder, command, leases, seconds):
    """A peer that stops, past its lease or not, and comes back, and a node that does."""
    is_long = seconds > 2.5
    figures = os.path.join(folder, "pauses.json")
    # A busy machine needs a while after a pause until the first command is heard again.
    limits = () if is_long else ("--hold", "3")
    node = Node(binary, os.path.join(folder, "pauses.txt"), "--out", figures, *limits, *leases)
    watch = Watch(command)
    try:
        check("a peer's command is followed", watch.until(lambda n, x: n > 0 and abs(x - 0.3) < 2e-3, 25) is not None)
        # After a silence of 2 s the peer commands the other opening, so that both ways are seen to work.
        for who, pid, opening in (("peer", watch.process.pid, 0.5), ("node", node.process.pid, 0.3)):
            opening = opening if is_long else 0.3
            os.kill(pid, signal.SIGSTOP)
            time.sleep(seconds)
            watch.lines()
            os.kill(pid, signal.SIGCONT)
            back = watch.until(lambda n, x: n > 10 and abs(x - opening) < 2e-3, 30)
            check(f"both ways work again after the {who} paused {seconds:.0f} s", back is not None,
                  f"({back:.1f} s after its return)" if back else "(not within 30 s)")
    finally:
        watch.end()
        check("the node ends in order", node.end())
    with open(figures) as text:
        inputs = json.load(text)["inputs"]
    lost = inputs["governor/command"].get("lost", 0)
    trips = node.said().count("fail-safe: inputs are missing")
    if is_long:
        check("commands that its pause cost are counted", lost > 100, f"({lost} lost)")
        check("a pause beyond the limits fails safe", trips >= 1, f"({trips} times)")
    else:
        check("a pause within the limits trips nothing", trips == 0, f"({trips} times; {lost} commands lost)")


def optional_inputs(binary, folder):
    """A bench without ESV and tank pressure: the twin runs on their defaults, and its status says so."""
    node = Node(binary, os.path.join(folder, "optional.txt"), "--optional", "esv", "tank_pressure")
    bench = Bench()
    status = bench.reader("rt/sim/status", ros.TwinStatus, COUNTED)
    try:
        wait_for(bench.is_met, 15)
        waiting = []
        wait_for(lambda: waiting.extend(whole(status.take(1000))) or len(waiting) > 5, 15)
        check("without a command it waits and trips nothing",
              waiting and all((s.state, s.command) == (0, 0) for s in waiting), f"({len(waiting)} statuses)")
        # No ESV, no pressure.
        states, seen = [], []
        for _ in range(200):
            bench.command.write(ros.GovernorCommand(now(), 0.4))
            states += whole(bench.state.take(100))
            seen += whole(status.take(100))
            time.sleep(0.01)
        last = seen[-1] if seen else None
        check("the command alone moves it", states and abs(states[-1].servomotor_position - 0.4) < 2e-3)
        check("its status says what stands behind", last and (last.state, last.command, last.esv, last.tank_pressure)
              == (1, 1, 0, 0), f"({last.state}, {last.command}, {last.esv}, {last.tank_pressure})" if last else "")
        stamps = {s.header.stamp.sec * 10**9 + s.header.stamp.nanosec for s in seen}
        paired = [s for s in states if s.header.stamp.sec * 10**9 + s.header.stamp.nanosec in stamps]
        check("a status comes with each state", states and len(paired) > 0.9 * len(states),
              f"({len(paired)} of {len(states)})")
        wanting = DataReader(bench.participant, Topic(bench.participant, "rt/sim/servo_state", ros.ServoState),
                             qos=Qos(Policy.Reliability.Reliable(duration(milliseconds=100)), Policy.Durability.TransientLocal))
        seen = []
        wait_for(lambda: seen.extend(whole(status.take(100))) or {2, 3} <= {s.state for s in seen}, 15)
        order = [state for state in dict.fromkeys(s.state for s in seen) if state in (2, 3)]
        check("silence is held, then fails safe", order == [2, 3], f"({sorted({s.state for s in seen})})")
        node.says("asks for more Durability")
        del wanting
    finally:
        node.end()
    said = node.said()
    check("an incompatible QoS is reported by name", "/sim/servo_state: a subscription asks for more Durability" in said)
    for words in ("DDS domain", "hears /governor/esv: governor_msgs/msg/EsvState [0 shutdown, 1 normal], optional",
                  "publishes at 100 Hz /sim/servo_state: governor_msgs/msg/ServoState [pu, Pa]", "integrates at 1000 Hz"):
        check(f"it said at start: {words}", words in said)


def header(prefix, vendor=b"\x01\x10"):
    return b"RTPS\x02\x02" + vendor + prefix


def submessage(kind, flags, body):
    return struct.pack("<BBH", kind, flags, len(body)) + body


def number(value):
    return struct.pack("<iI", value >> 32, value & 0xFFFFFFFF)


BUILTIN = [(0x3C7, 0x3C2), (0x4C7, 0x4C2), (0x200C7, 0x200C2)]


def hostile(count):
    """Submessages whose ranges and sizes are far beyond anything real, each well-formed."""
    for reader, writer in BUILTIN:
        ids = struct.pack(">II", reader, writer)
        back = struct.pack(">II", reader, writer)
        for first, last in ((1 << 30, 1 << 31), (1, 1 << 62), ((1 << 63) - 2, (1 << 63) - 1)):
            yield submessage(7, 1, ids + number(first) + number(last) + struct.pack("<i", count))
        yield submessage(8, 1, ids + number(1 << 20) + number(1 << 34) + struct.pack("<I", 0))
        for sn in range(1, 9):
            # One fragment of a sample that claims 4 GB.
            yield submessage(0x16, 1, struct.pack("<HH", 0, 28) + ids + number(1000 + sn)
                             + struct.pack("<IHHI", 1, 1, 60000, 0xFFFFFFF0) + bytes(64))
            # Fragments requested that nothing has.
            yield submessage(0x12, 1, back + number(sn) + struct.pack("<II", 0xFFFFFF00, 32)
                             + struct.pack("<I", 0xFFFFFFFF) + struct.pack("<i", count + sn))
        yield submessage(6, 1, back + number((1 << 62) + 5) + struct.pack("<I", 0) + struct.pack("<i", count))
        # Sets of numbers beyond the largest one.
        every = struct.pack("<II", 32, 0xFFFFFFFF)
        yield submessage(0x12, 1, back + number(1) + struct.pack("<I", 0xFFFFFFF0) + every + struct.pack("<i", count + 9))
        yield submessage(6, 1, back + number((1 << 63) - 8) + every + struct.pack("<i", count + 1))


def hostile_packets(binary, folder):
    """Hostile and mutated packets in the name of a matched peer: memory stays, data flows, SIGINT is heard."""
    node = Node(binary, os.path.join(folder, "hostile.txt"))
    bench = Bench()
    out = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    ports = [7400 + 250 * DOMAIN + 10 + 2 * index + user for index in range(4) for user in (0, 1)]

    def send(packet):
        for port in ports:
            try:
                out.sendto(packet, ("127.0.0.1", port))
            except OSError:
                pass

    def flow(what):
        """Whether commands and states flow, and the memory stayed where it was."""
        states, _ = bench.drive(3.0, 0.4)
        alive = node.process.poll() is None
        now = node.megabytes() if alive else math_nan
        right = alive and len(states) > 150 and now - before < MOST_MEGABYTES
        check(what, right, f"({len(states)} states in 3 s, {before:.0f} MB before, {now:.0f} MB after)")
        return right

    math_nan = float("nan")
    try:
        wait_for(bench.is_met, 15)
        bench.drive(2.0, 0.4)
        before = node.megabytes()
        prefix = bench.participant.guid.bytes[:12]
        begin = time.monotonic()
        for reader, writer in BUILTIN:
            ids = struct.pack(">II", reader, writer)
            body = ids + number(1 << 30) + number(1 << 31) + struct.pack("<i", 1_000_000)
            send(header(prefix) + submessage(7, 1, body))
        while time.monotonic() < begin + 4 and node.megabytes() < before + 1500:
            time.sleep(0.05)
        if not flow("a heartbeat of 2^30 to 2^31 is survived"):
            return
        for turn in range(20):
            for body in hostile(2_000_000 + 100 * turn):
                send(header(prefix) + body)
            time.sleep(0.02)
        if not flow("ranges and sizes beyond anything real are survived"):
            return
        source = random.Random(20_000)
        templates = [header(prefix) + body for body in hostile(3_000_000)]
        for index in range(20_000):
            packet = bytearray(source.choice(templates))
            for _ in range(source.randint(1, 6)):
                packet[source.randrange(20, len(packet))] = source.randrange(256)
            send(bytes(packet))
            if index % 50 == 0:
                time.sleep(0.01)
                if node.process.poll() is not None or node.megabytes() > before + 1500:
                    break
        flow("20000 mutated packets are survived")
    finally:
        out.close()
        check("the node hears SIGINT", node.end())


SUBSCRIBER = """
import sys, time
from bench import BEST_EFFORT, DOMAIN, RELIABLE, DataReader, Topic
from cyclonedds.domain import DomainParticipant
import types_ros as ros
participant = DomainParticipant(DOMAIN)
reader = DataReader(participant, Topic(participant, "rt/governor/command", ros.GovernorCommand), qos=RELIABLE)
print("ready", flush=True)
heard = False
while True:
    if reader.take(1000) and not heard:
        heard = print("heard", flush=True) is None
    time.sleep(0.01)
"""


def acknowledged_clock(binary):
    """`play --clock` waits 1 s for a reliable subscriber that does not answer, goes on without it, and says so."""
    here = os.path.dirname(os.path.abspath(__file__))
    bag = os.path.join(here, "..", "..", "bags", "reference", "load_rejection_01.mcap")
    for stops in (False, True):
        subscriber = subprocess.Popen([sys.executable, "-c", SUBSCRIBER], cwd=here, stdout=subprocess.PIPE, text=True)
        try:
            subscriber.stdout.readline()
            play = subprocess.Popen([binary, "play", bag, "--clock", "--speed", "10", "--duration", "60", "--json"], stdout=subprocess.PIPE,
                                    stderr=subprocess.PIPE, text=True)
            begin = time.monotonic()
            with Machine() as machine:
                subscriber.stdout.readline()
                time.sleep(1.5)
                if stops:
                    subscriber.send_signal(signal.SIGSTOP)
                out, err = play.communicate(timeout=120)
            seconds, figures = time.monotonic() - begin, json.loads(out)
            late = figures["unacknowledged"]
            if stops:
                check("a clock goes on without a subscriber that stands still, after 1 s, and says so", play.returncode == 3 and set(late) == {"/governor/command"}
                      and "acknowledged" in err and figures["worst_delay_s"] < 1.5 + machine.lost_s and seconds < 15 + machine.lost_s, f"({late}, delay {figures['worst_delay_s']:.2f} s, {seconds:.1f} s, {err!r})")
            else:
                check("a clock waits for a subscriber on Cyclone DDS without being late", play.returncode == 0 and late == {} and figures["worst_delay_s"] < 0.5 + machine.lost_s,
                      f"({late}, delay {figures['worst_delay_s']:.3f} s, {err!r})")
        finally:
            subscriber.kill()
            subscriber.wait()


def main():
    binary, folder = sys.argv[1], sys.argv[2]
    here = os.path.dirname(os.path.abspath(__file__))
    command = sys.argv[4:] if sys.argv[3:4] == ["--watch"] else [sys.executable, os.path.join(here, "watch.py")]
    wanted = os.environ.get("FAULTS", "clock replies pauses optional hostile").split()
    if "pauses" in wanted:
        for seconds in PAUSES_S:
            pauses(binary, folder, command, os.environ.get("LEASE", f"--lease {LEASE_S}").split(), seconds)
    if "clock" in wanted:
        acknowledged_clock(binary)
    if "replies" in wanted:
        large_replies(binary, folder)
    if "optional" in wanted:
        optional_inputs(binary, folder)
    if "hostile" in wanted:
        hostile_packets(binary, folder)
    print(f"{len(FAILED)} failed")
    sys.exit(1 if FAILED else 0)


if __name__ == "__main__":
    main()
