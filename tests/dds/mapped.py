#!/usr/bin/env python3
"""`govtwin run --map`, `record --map` and `watch --bus --map` beside a plant on Cyclone DDS whose topics have types of its own.

Usage: mapped.py GOVTWIN FOLDER   (needs PyPI `cyclonedds` 11 and `mcap`; ROS_DOMAIN_ID picks the domain; bags and logs go to FOLDER)
The twin must follow, the recording must read by the same map as the same values, and what cannot be used must be said by name.
Exits 0 when everything was as it should be, 1 otherwise, 77 where cyclonedds or mcap is missing.
"""

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from dataclasses import dataclass

from bench import BEST_EFFORT, DOMAIN, FAILED, RELIABLE, DataReader, DataWriter, DomainParticipant, Topic, check, end_process, matched, now, wait_for, whole
from cyclonedds.idl import IdlStruct
from cyclonedds.idl.types import float32, float64
from listening import OVERLAP_M, REST_S, TOPICS, lines, made, tight_sheet
from record import info
import types_ros as ros

try:
    from mcap.reader import make_reader
except ImportError as error:
    print(f"skipped: PyPI mcap is not there ({error}); `pip install mcap`")
    sys.exit(77)


@dataclass
class Float64(IdlStruct, typename="std_msgs::msg::dds_::Float64_"):
    data: float64


@dataclass
class Oil(IdlStruct, typename="plant_msgs::msg::dds_::Oil_"):
    header: ros.Header
    pressure_bar: float32
    trip: bool


@dataclass
class Text(IdlStruct, typename="std_msgs::msg::dds_::String_"):
    data: str


DEFINITION = "std_msgs/Header header\nfloat32 pressure_bar\nbool trip\n"
MAP = """signals:
  opening_command: {field: /plant/opening.data, unit: "%"}
  tank_pressure: {field: /plant/oil.pressure_bar, unit: bar}
  esv: {field: /plant/oil.trip, shutdown: [true]}
  servomotor_position: {field: "/plant/joints.position[servomotor]", unit: m, range: [0, 0.6]}
  spool_position: {field: "/plant/joints.position[spool]", unit: m, range: [0, 0.015]}
"""


class Plant:
    """Sends opening in per cent, oil pressure in bar with the trip, and positions in metres."""

    def __init__(self):
        self.participant = DomainParticipant(DOMAIN)

        def writer(name, kind):
            return DataWriter(self.participant, Topic(self.participant, f"rt/plant/{name}", kind), qos=RELIABLE)

        self.opening, self.oil, self.joints = writer("opening", Float64), writer("oil", Oil), writer("joints", ros.JointState)
        self.sent = 0
        self.state = DataReader(self.participant, Topic(self.participant, "rt/sim/servo_state", ros.ServoState), qos=BEST_EFFORT)

    def awaited_by(self, readers):
        """Whether so many subscribe to each topic."""
        writers = (self.opening, self.oil, self.joints)
        return wait_for(lambda: all(matched(writer) >= count for writer, count in zip(writers, readers)), 20)

    def drive(self, seconds, opening_percent, trip=False):
        """Sends at 100 Hz, each value a little above the one before; the states that come back."""
        states, begin = [], time.monotonic()
        for step in range(int(seconds * 100)):
            self.sent += 1
            self.opening.write(Float64(opening_percent + 1e-4 * self.sent))
            self.joints.write(ros.JointState(now(), ["spool", "servomotor"], [0.0, 0.006 * opening_percent], [], []))
            if step % 10 == 0:
                self.oil.write(Oil(now(), 63.0 + 1e-3 * self.sent, trip))
            states += whole(self.state.take(100))
            time.sleep(max(0.0, begin + (step + 1) / 100 - time.monotonic()))
        return states


    def replay(self, messages):
        """Sends a recording as fast as it was, since a `std_msgs/Float64` has no stamp but its arrival, and rest behind it."""
        pressure_bar, trip, begin, first_ns = 63.0, False, time.monotonic(), messages[0][2]
        rest = [(name, data, messages[-1][2] + (step + 1) * 20_000_000) for step in range(REST_S * 50) for name, data, _ in messages[-12:]
                if name in ("/plant/servo_state", "/governor/command")]
        for name, data, log_ns in messages + rest:
            since_ns = log_ns - first_ns
            message = TOPICS[name].deserialize(data)
            time.sleep(max(0.0, begin + since_ns / 1e9 - time.monotonic()))
            header = now()
            if name == "/governor/command":
                self.opening.write(Float64(100.0 * message.opening))
            elif name == "/governor/tank_pressure":
                pressure_bar = message.fluid_pressure * 1e-5
                self.oil.write(Oil(header, pressure_bar, trip))
            elif name == "/governor/esv":
                trip = message.state == 0
                self.oil.write(Oil(header, pressure_bar, trip))
            else:
                positions = [0.015 * message.spool_position, 0.6 * message.servomotor_position]
                self.joints.write(ros.JointState(header, ["spool", "servomotor"], positions, [], []))


def values(bag, topic, kind, of):
    """What a bag's messages of a topic say, repetitions left out: a node's bag holds its inputs at its own rate."""
    found = []
    for name in sorted(os.listdir(bag)):
        if name.endswith(".mcap"):
            with open(os.path.join(bag, name), "rb") as file:
                found += [of(kind.deserialize(message.data)) for _, _, message in make_reader(file).iter_messages(topics=[topic])]
    return [value for at, value in enumerate(found) if at == 0 or value != found[at - 1]]


def in_order(part, all_of_them):
    """Whether each of the values stands among all of them, in the same order."""
    rest = iter(all_of_them)
    return all(value in rest for value in part)


def follows(binary, folder, plan):
    """The twin follows fields of any type; the recording reads by the same map as what it heard."""
    live, recorded, imported = (os.path.join(folder, name) for name in ("live", "recorded", "imported"))
    log = open(os.path.join(folder, "follows.txt"), "w")
    node = subprocess.Popen([binary, "run", "--map", plan, "--definitions", folder, "--bag", live, "--json"], stdout=subprocess.PIPE,
                            stderr=log, text=True)
    recorder = subprocess.Popen([binary, "record", "--map", plan, "--definitions", folder, "--out", recorded], stdout=log, stderr=log)
    plant = Plant()
    try:
        check("node and recorder subscribe to the plant's own types", plant.awaited_by((2, 2, 1)))
        plant.drive(4, 30)
        states = plant.drive(2, 30)
        opening = states[-1].servomotor_position if states else float("nan")
        check("the twin follows the command in per cent", abs(opening - 0.30) < 0.01, f"({opening:.4f} pu)")
        tripped = plant.drive(5, 30, trip=True)
        closed = tripped[-1].servomotor_position if tripped else float("nan")
        check("the plant's trip closes the twin", closed < 0.02, f"({closed:.4f} pu)")
    finally:
        recorder.send_signal(signal.SIGINT)
        node.send_signal(signal.SIGINT)
        out = node.communicate(timeout=20)[0]
        recorder.wait(20)
    check("node and recorder end well", (node.returncode, recorder.returncode) == (0, 0), f"({node.returncode}, {recorder.returncode})")
    used = json.loads(out)["inputs"]
    check("nothing was refused", all(one["refused"] == 0 for one in used.values()), f"({ {name: one['used'] for name, one in used.items()} })")
    topics, _, _ = info(binary, recorded)
    check("recorded as they stand on the wire", sorted(topics) == ["/plant/joints", "/plant/oil", "/plant/opening"], f"({sorted(topics)})")
    run = subprocess.run([binary, "import", recorded, "--map", plan, "--out", imported], capture_output=True, text=True)
    check("the recording reads by the same map", run.returncode in (0, 3), run.stderr if run.returncode not in (0, 3) else "")
    if run.returncode not in (0, 3):
        return
    for topic, kind, of in (("/governor/command", ros.GovernorCommand, lambda message: message.opening),
                            ("/governor/tank_pressure", ros.FluidPressure, lambda message: message.fluid_pressure)):
        heard, read = values(live, topic, kind, of), values(imported, topic, kind, of)
        # Either may have begun a little earlier. Of two that came within a tick the node used the newer one.
        same = len(heard) > 60 and len(read) > 60 and in_order([value for value in heard if read[0] <= value <= read[-1]], read)
        check(f"what was heard is what is read, to the last bit: {topic}", same, f"({len(heard)}, {len(read)})")
    run = subprocess.run([binary, "replay", live, "--out", os.path.join(folder, "again"), "--json"], capture_output=True, text=True)
    check("the node's own bag replays", run.returncode in (0, 3), run.stderr if run.returncode not in (0, 3) else "")


def said_by(binary, folder, plan, words, act, *arguments):
    """What a node says while a plant acts, until it says these words."""
    path = os.path.join(folder, "said.txt")
    with open(path, "w") as log:
        node = subprocess.Popen([binary, "run", "--map", plan, *arguments], stdout=log, stderr=log)
        try:
            wait_for(lambda: (act(0.5), words in open(path).read())[1], 60)
        finally:
            end_process(node)
    with open(path) as file:
        return file.read(), node.returncode


def refusals(binary, folder, plan):
    """What cannot be used is said by name, with the way out, and the node goes on."""
    plant = Plant()
    said, _ = said_by(binary, folder, plan, "--definitions", lambda seconds: plant.drive(seconds, 30))
    check("a type that nobody describes is told with the way out", "plant_msgs/msg/Oil" in said and "--definitions" in said, f"({said[-300:]!r})"
          if "plant_msgs/msg/Oil" not in said else "")
    wrong = os.path.join(folder, "wrong.yaml")
    with open(wrong, "w") as file:
        file.write("signals:\n  opening_command: {field: /plant/opening.value, unit: pu}\n")
    said, _ = said_by(binary, folder, wrong, "`value`", lambda seconds: plant.drive(seconds, 30))
    check("a field that is not there is told with those that are", "`value`" in said and "data" in said, "" if "`value`" in said else f"({said[-300:]!r})")

    def no_number(seconds):
        begin = time.monotonic()
        while time.monotonic() < begin + seconds:
            plant.opening.write(Float64(float("nan")))
            time.sleep(0.02)

    said, code = said_by(binary, folder, plan, "finite", no_number, "--definitions", folder)
    check("a command that is no number is told with its field", "/plant/opening.data" in said and "finite" in said,
          "" if "finite" in said else f"({said[-300:]!r})")
    check("the node lives on and ends when asked", code == 0, f"({code})")
    del plant
    other = DomainParticipant(DOMAIN)
    text = DataWriter(other, Topic(other, "rt/plant/opening", Text), qos=RELIABLE)

    def words(seconds):
        begin = time.monotonic()
        while time.monotonic() < begin + seconds:
            text.write(Text("thirty"))
            time.sleep(0.02)

    said, code = said_by(binary, folder, plan, "a sample was refused", words, "--definitions", folder)
    check("a field that is a text is told", code == 0 and "opening" in said and ("text" in said or "number" in said),
          "" if "text" in said else f"({said[-400:]!r})")


def watched(binary, folder, plan):
    """A load rejection on the plant's own topics is cut out and diagnosed."""
    sheet, out = os.path.join(folder, "sheet.yaml"), os.path.join(folder, "unit3")
    tight_sheet(sheet, os.path.join(os.path.dirname(__file__), "..", "..", "params", "reference_unit.yaml"))
    recording = made(binary, folder, 1)
    plant = Plant()
    with open(os.path.join(folder, "watch.txt"), "w") as log:
        node = subprocess.Popen([binary, "watch", "--bus", "--map", plan, "--definitions", folder, "--params", sheet, "--only", "port_overlap", "--out", out],
                                stdout=log, stderr=log)
        try:
            check("the watch subscribes to the plant's own types", plant.awaited_by((1, 1, 1)))
            plant.replay(recording)
            check("the process is in the history", wait_for(lambda: len(lines(out)) == 1, 240), f"({len(lines(out))} lines)")
            entry = (lines(out) or [{"process": "", "sizes": []}])[0]
            sizes = {(one["effect"], one["parameter"]): one["ci90"] for one in entry["sizes"]}
            low, high = sizes.get(("port_overlap", "extra_overlap_m"), (1.0, 0.0))
            check("as a load rejection, with the size of the fault", entry["process"] == "load_rejection" and low < OVERLAP_M < high, f"({entry})")
        finally:
            end_process(node)


def main():
    binary, folder = sys.argv[1], os.path.join(sys.argv[2], "mapped")
    shutil.rmtree(folder, ignore_errors=True)
    os.makedirs(os.path.join(folder, "plant_msgs/msg"))
    with open(os.path.join(folder, "plant_msgs/msg/Oil.msg"), "w") as file:
        file.write(DEFINITION)
    plan = os.path.join(folder, "map.yaml")
    with open(plan, "w") as file:
        file.write(MAP)
    cases = os.environ.get("CASES", "follows refusals watched").split()
    if "follows" in cases:
        follows(binary, folder, plan)
    if "refusals" in cases:
        refusals(binary, folder, plan)
    if "watched" in cases:
        watched(binary, folder, plan)
    return 1 if FAILED else 0


if __name__ == "__main__":
    sys.exit(main())
