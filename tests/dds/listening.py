#!/usr/bin/env python3
"""`govtwin watch --bus` beside a plant on Cyclone DDS: processes are cut out, diagnosed while more is heard, and told.

Usage: listening.py GOVTWIN FOLDER [PEER...]   (needs PyPI `cyclonedds` 11 and `mcap`; ROS_DOMAIN_ID picks the domain; bags and logs go to FOLDER)
The plant sends recordings that `govtwin generate` makes, ten times as fast, with the stamps that they have. Synthetic data throughout.
With a PEER's command line, that peer comes late to a watch that goes on with the history of an earlier run.
Exits 0 when everything was as it should be, 1 otherwise, 77 where cyclonedds or mcap is missing.
"""

import glob
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time

from bench import BEST_EFFORT, DOMAIN, FAILED, RELIABLE, DataReader, DataWriter, DomainParticipant, Topic, check, matched, wait_for, whole
from record import LATCHED
import types_ros as ros

try:
    from mcap.reader import make_reader
except ImportError as error:
    print(f"skipped: PyPI mcap is not there ({error}); `pip install mcap`")
    sys.exit(77)

OVERLAP_M = 3e-4
FASTER = 10
REST_S = 32
TOPICS = {
    "/governor/command": ros.GovernorCommand,
    "/governor/esv": ros.EsvState,
    "/governor/tank_pressure": ros.FluidPressure,
    "/plant/servo_state": ros.ServoState,
}


def made(binary, folder, seed):
    """The messages of a load rejection: topic, bytes as they stand in the bag, and time of recording in ns."""
    out = os.path.join(folder, f"made_{seed}")
    shutil.rmtree(out, ignore_errors=True)
    subprocess.run([binary, "generate", "--out", out, "--process", "load_rejection", "--rate", "50", "--spread", "off", "--effect",
                    f"port_overlap={OVERLAP_M}", "--seed", str(seed), "--duration", "40"], check=True, capture_output=True)
    with open(glob.glob(f"{out}/load_rejection/*.mcap")[0], "rb") as file:
        return [(channel.topic, message.data, message.log_time) for _, channel, message in make_reader(file).iter_messages()
                if channel.topic in TOPICS]


def tight_sheet(path, reference):
    """A sheet in which nothing has a tolerance but friction, so that a diagnosis is quick."""
    with open(reference) as file, open(path, "w") as sheet:
        section = None
        for line in file:
            if heading := re.match(r"(\w+):\s*(#.*)?$", line):
                section = heading[1]
            elif (entry := re.match(r"  (\w+):.*\btol\b", line)) and entry[1] != "coulomb_friction_n":
                if section:
                    sheet.write(f"{section}:\n")
                    section = None
                sheet.write(f"  {entry[1]}: {{tol: ~}}\n")


class Plant:
    """Sends what a plant sends, and hears what is said of it."""

    def __init__(self):
        self.participant = DomainParticipant(DOMAIN)
        self.topics = {name: Topic(self.participant, f"rt{name}", kind) for name, kind in TOPICS.items()}
        self.writers = {name: DataWriter(self.participant, topic, qos=RELIABLE) for name, topic in self.topics.items()}
        self.diagnostics = DataReader(self.participant, Topic(self.participant, "rt/diagnostics", ros.DiagnosticArray), qos=BEST_EFFORT)
        self.clock_ns = 1_800_000_000 * 10**9

    def verdicts(self):
        """A reader that comes late."""
        topic = Topic(self.participant, "rt/govtwin_watch/verdict", ros.UnitVerdict)
        return DataReader(self.participant, topic, qos=LATCHED)

    def awaits(self):
        """Whether the watch hears, as one that is told of all four topics does."""
        return wait_for(lambda: all(map(matched, self.writers.values())), 20)

    def send(self, messages, share=1.0):
        """Sends a share of a recording, and the rest that follows where it is the whole."""
        begin, first_ns = time.monotonic(), messages[0][2]
        messages = messages[:int(len(messages) * share)]
        newest = {}
        for name, data, log_ns in messages:
            message = TOPICS[name].deserialize(data)
            newest[name] = message
            self.put(name, message, begin, log_ns - first_ns)
        end_ns = messages[-1][2] - first_ns
        for step in range(int(REST_S * 50) if share == 1.0 else 0):
            for name, message in newest.items():
                self.put(name, message, begin, end_ns + (step + 1) * 20_000_000)
        # The next one begins much later.
        self.clock_ns += 3600 * 10**9

    def put(self, name, message, begin, since_ns):
        stamp_ns = self.clock_ns + since_ns
        message.header.stamp = ros.Time(stamp_ns // 10**9, stamp_ns % 10**9)
        time.sleep(max(0.0, begin + since_ns / 1e9 / FASTER - time.monotonic()))
        self.writers[name].write(message)

    def statuses(self):
        """What diagnostics say now of the watch, by the part behind the node's name."""
        for array in whole(self.diagnostics.take(100))[::-1]:
            said = {status.name.removeprefix("/govtwin_watch: "): status for status in array.status}
            if "verdict" in said:
                return said
        return {}


def lines(out):
    path = os.path.join(out, "history.jsonl")
    if not os.path.exists(path):
        return []
    with open(path) as file:
        return [json.loads(line) for line in file]


def late(binary, out, peer):
    """What a peer of another make decodes."""
    history = lines(out)
    if not history:
        print("skipped: no history of an earlier run")
        return 0
    node = subprocess.Popen([binary, "watch", "--bus", "--out", out], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        run = subprocess.run(peer, capture_output=True, text=True, timeout=60)
        size = history[-1]["sizes"][0]
        expected = [f"verdict unit3 load_rejection {history[-1]['verdict']} {len(history)}",
                    "size port_overlap " + " ".join(f"{value:.6g}" for value in (size["value"], *size["ci90"])),
                    "status 0 /govtwin_watch: verdict", "status 0 /govtwin_watch: port_overlap.extra_overlap_m"]
        check("a late subscriber decodes verdict and diagnostics", run.returncode == 0 and set(expected) <= set(run.stdout.splitlines()),
              f"({run.stdout!r})")
    finally:
        node.send_signal(signal.SIGINT)
        node.wait(20)
    return 1 if FAILED else 0


def main():
    binary, folder = sys.argv[1], os.path.join(sys.argv[2], "listening")
    if len(sys.argv) > 3:
        return late(binary, os.path.join(folder, "unit3"), sys.argv[3:])
    shutil.rmtree(folder, ignore_errors=True)
    os.makedirs(folder)
    sheet, out = os.path.join(folder, "sheet.yaml"), os.path.join(folder, "unit3")
    tight_sheet(sheet, os.path.join(os.path.dirname(__file__), "..", "..", "params", "reference_unit.yaml"))
    recordings = [made(binary, folder, seed) for seed in (1, 2, 3)]
    log = open(os.path.join(folder, "watch.txt"), "w+")

    def watch():
        return subprocess.Popen([binary, "watch", "--bus", "--params", sheet, "--only", "port_overlap", "--out", out], stdout=log, stderr=log)

    plant, node = Plant(), watch()
    try:
        check("the watch hears the plant's topics", plant.awaits())
        plant.send(recordings[0])
        said = {}
        check("a process is heard of in /diagnostics", wait_for(lambda: (said.update(plant.statuses()) or "listening" in said), 15)
              and said["verdict"].hardware_id == "unit3", f"({[(name, one.message) for name, one in said.items()]})")
        # The second one comes while the first is diagnosed.
        plant.send(recordings[1])
        check("both are in the history", wait_for(lambda: len(lines(out)) == 2, 240), f"({len(lines(out))} lines)")
        reader = plant.verdicts()
        verdicts = []
        wait_for(lambda: verdicts.extend(whole(reader.take(10))) or any(one.processes == 2 for one in verdicts), 10)
        check("a late subscriber gets the newest verdict", verdicts and verdicts[-1].processes == 2
              and verdicts[-1].header.frame_id == "unit3", f"({verdicts})")
        size = verdicts[-1].sizes[0] if verdicts and verdicts[-1].sizes else ros.FaultSize(ros.Time(0, 0), *[""] * 4, *[0.0] * 3, False, *[0.0] * 4, False)
        check("it holds size and interval", verdicts and verdicts[-1].process == "load_rejection" and size.effect == "port_overlap"
              and size.unit == "m" and size.low < OVERLAP_M < size.high and not size.moved, f"({size.low} to {size.high} {size.unit})")
        said = plant.statuses()
        wait_for(lambda: said.update(plant.statuses()) or "port_overlap.extra_overlap_m" in said, 15)
        check("/diagnostics hold them too", any(name.startswith("port_overlap.") and status.level == 0
              and {one.key for one in status.values} >= {"value", "interval of nine in ten", "limit of the sums [sd]"} for name, status in said.items()),
              f"({list(said)})")
        values = {one.key: one.value for one in said["listening"].values} if "listening" in said else {}
        check("nothing was lost", values.get("samples lost on the way") == "0" and values.get("processes recorded") == "2", f"({values})")
        digests = [line["digest"] for line in lines(out)]

        # Killed amid a process: what was heard of it is there after the next start, and what was entered stays.
        plant.send(recordings[2], 0.7)
        time.sleep(1.2)
        node.kill()
        node.wait()
        node = watch()
        check("what was heard before a kill is diagnosed after it", wait_for(lambda: len(lines(out)) == 3, 240))
        history = lines(out)
        check("as a process that was broken off", len(history) == 3 and any("ended before the unit was at rest" in note for note in history[2]["notes"])
              and [line["digest"] for line in history[:2]] == digests, f"({[line['notes'] for line in history]})")
        reader, verdicts = plant.verdicts(), []
        wait_for(lambda: verdicts.extend(whole(reader.take(10))) or any(one.processes == 3 for one in verdicts), 10)
        check("a restarted watch tells its newest verdict", any(one.processes == 3 for one in verdicts), f"({[one.processes for one in verdicts]})")
        check("no recording waits", not os.listdir(os.path.join(out, "waiting")) and len(os.listdir(os.path.join(out, "processes"))) == 3)
        node.send_signal(signal.SIGINT)
        check("it ends with exit code 0", node.wait(20) == 0)
    finally:
        if node.poll() is None:
            node.kill()
            node.wait()
    log.seek(0)
    text = log.read()
    check("it said what it took up", "was being recorded when the last watch ended" in text)
    if FAILED:
        print(text)
    print(f"{len(FAILED)} failed")
    return 1 if FAILED else 0


if __name__ == "__main__":
    sys.exit(main())
