#!/usr/bin/env python3
"""`govtwin record` and `play` beside peers on Cyclone DDS: types that it does not know, kills, a full disk, refusals.

Usage: record.py GOVTWIN FOLDER   (needs PyPI `cyclonedds` 11; ROS_DOMAIN_ID picks the domain; bags and logs go to FOLDER)
CASES picks among: types play refusals kills full; KILLS is how often the recorder is killed (4); `full` needs root, for a small disk.
Exits 0 when everything was as it should be, 1 otherwise, 77 where cyclonedds is missing.
"""

import hashlib
import json
import os
import random
import shutil
import signal
import subprocess
import sys
import threading
import time
from dataclasses import dataclass

from bench import DOMAIN, ENDS_S, RELIABLE, DataReader, DataWriter, DomainParticipant, Machine, Policy, Qos, Topic, check, duration, matched, now, run_cases, wait_for, whole, BuiltinDataReader, BuiltinTopicDcpsPublication
from cyclonedds.idl import IdlStruct
from cyclonedds.idl.types import array, float32, float64, int32, sequence, uint8, uint32
import types_ros as ros

LATCHED = Qos(Policy.Reliability.Reliable(duration(milliseconds=100)), Policy.Durability.TransientLocal, Policy.History.KeepLast(10))
RATE = 200
FLUSH_S = 1.0


@dataclass
class String(IdlStruct, typename="std_msgs::msg::dds_::String_"):
    data: str


@dataclass
class Log(IdlStruct, typename="rcl_interfaces::msg::dds_::Log_"):
    stamp: ros.Time
    level: uint8
    name: str
    msg: str
    file: str
    function: str
    line: uint32


@dataclass
class Gauge(IdlStruct, typename="bench_msgs::msg::dds_::Gauge_"):
    level: float32


@dataclass
class Head(IdlStruct, typename="bench_msgs::msg::dds_::Head_"):
    header: ros.Header
    metres: float64
    counts: array[int32, 3]
    gauges: sequence[Gauge]


@dataclass
class Bare(IdlStruct, typename="bench_msgs::msg::dds_::Bare_"):
    value: float64


TEXTS = {
    "bench_msgs/msg/Head": "# Head of water.\nstd_msgs/Header header\nfloat64 metres  # above the tailwater\nint32[3] counts\nGauge[] gauges\n",
    "bench_msgs/msg/Gauge": "float32 level\n",
    "std_msgs/msg/Header": "builtin_interfaces/Time stamp\nstring frame_id\n",
    "builtin_interfaces/msg/Time": "int32 sec\nuint32 nanosec\n",
}


def field(name, number, nested="", capacity=0):
    return {"name": name, "type": {"type_id": number, "capacity": capacity, "string_capacity": 0, "nested_type_name": nested}}


def head_hash():
    """The RIHS01 hash of Head: SHA-256 of its description as JSON."""
    kinds = {
        "builtin_interfaces/msg/Time": [field("sec", 6), field("nanosec", 7)],
        "bench_msgs/msg/Gauge": [field("level", 10)],
        "std_msgs/msg/Header": [field("stamp", 1, "builtin_interfaces/msg/Time"), field("frame_id", 17)],
    }
    own = [field("header", 1, "std_msgs/msg/Header"), field("metres", 11), field("counts", 54, capacity=3),
           field("gauges", 145, "bench_msgs/msg/Gauge")]
    text = json.dumps({
        "type_description": {"type_name": "bench_msgs/msg/Head", "fields": own},
        "referenced_type_descriptions": [{"type_name": name, "fields": kinds[name]} for name in sorted(kinds)],
    })
    return "RIHS01_" + hashlib.sha256(text.encode()).hexdigest()


class Peer:
    """A node of a bench: topics of many types, and a service that describes one of them."""

    def __init__(self):
        self.participant = DomainParticipant(DOMAIN)

        def writer(name, kind, qos=RELIABLE):
            return DataWriter(self.participant, Topic(self.participant, name, kind), qos=qos)

        hashed = Qos(Policy.Reliability.Reliable(duration(milliseconds=100)), Policy.History.KeepLast(10),
                     Policy.Userdata(f"enclave=/;typehash={head_hash()};".encode()))
        self.clock, self.log = writer("rt/clock", ros.Clock), writer("rt/rosout", Log, LATCHED)
        self.diagnostics, self.talk = writer("rt/diagnostics", ros.DiagnosticArray), writer("rt/talk", String)
        self.joints, self.bare = writer("rt/joint_states", ros.JointState), writer("rt/bare", Bare)
        self.head = writer("rt/head", Head, hashed)
        self.asked = DataReader(self.participant, Topic(self.participant, "rq/bench/get_type_descriptionRequest", ros.TypeRequest), qos=RELIABLE)
        self.answer = writer("rr/bench/get_type_descriptionReply", ros.TypeResponse)
        self.log.write(Log(now().stamp, 20, "bench", "said before anybody listened", "", "", 1))
        self.answers = True
        self.ends = threading.Event()
        self.thread = threading.Thread(target=self.run)
        self.thread.start()

    def run(self):
        step = 0
        while not self.ends.wait(0.02):
            self.clock.write(ros.Clock(ros.Time(step // 50, step % 50 * 20_000_000)))
            self.talk.write(String(f"number {step}"))
            self.joints.write(ros.JointState(now(), ["a"], [step * 1.0], [], []))
            self.head.write(Head(now(), 120.0 + step, [1, 2, 3], [Gauge(0.5), Gauge(0.25)]))
            self.bare.write(Bare(step * 1.0))
            if step % 50 == 0:
                said = ros.DiagnosticStatus(0, "bench", "runs", "", [ros.KeyValue("a", "b")])
                self.diagnostics.write(ros.DiagnosticArray(now(), [said]))
            for asked in whole(self.asked.take(10)) if self.answers else ():
                known = asked.type_name in TEXTS and asked.type_hash in ("", head_hash())
                sources = [ros.TypeSource(name, "msg", text) for name, text in TEXTS.items()] if known else []
                empty = ros.IndividualTypeDescription("", [])
                reason = "" if known else "not a type of this node"
                self.answer.write(ros.TypeResponse(asked.caller, asked.number, known, reason, empty, [], sources, []))
            step += 1

    def end(self):
        self.ends.set()
        self.thread.join()


def record(binary, bag, log, *arguments):
    shutil.rmtree(bag, ignore_errors=True)
    shutil.rmtree(kept(bag), ignore_errors=True)
    return subprocess.Popen([binary, "record", "--out", bag, *arguments], stdout=log, stderr=log)


def kept(bag):
    return os.path.join(os.path.dirname(bag), f".{os.path.basename(bag)}.unfinished")


def info(binary, bag):
    """What `govtwin info` says of a bag, and its exit code."""
    run = subprocess.run([binary, "info", "--json", bag], capture_output=True, text=True)
    said = json.loads(run.stdout)[0] if run.stdout else {"topics": [], "warnings_in_words": [run.stderr]}
    return {topic["name"]: topic for topic in said["topics"]}, said["warnings_in_words"], run.returncode


def types(binary, folder):
    """Topics of any type, with what their publishers, a folder or nobody knows of them."""
    peer = Peer()
    log = open(os.path.join(folder, "record.txt"), "w+")
    try:
        bag = os.path.join(folder, "all")
        code = record(binary, bag, log, "--all", "--duration", "10").wait(60)
        log.seek(0)
        said = log.read()
        topics, warnings, clean = info(binary, bag)
        check("a type that nobody knows is recorded all the same, and told", code == 3 and "`bench_msgs/msg/Bare`" in said, f"(exit code {code})")
        for name, least in (("/clock", 100), ("/talk", 100), ("/joint_states", 100), ("/head", 100), ("/bare", 100), ("/diagnostics", 3), ("/rosout", 1)):
            topic = topics.get(name, {"messages": 0, "undecodable": 0})
            check(f"{name} is recorded", topic["messages"] >= least and topic["undecodable"] == 0, f"({topic['messages']} messages)")
        check("what was said before is there, too", topics.get("/rosout", {}).get("messages", 0) == 1)
        head = topics.get("/head", {})
        fields = {one["name"]: one for one in head.get("fields", [])}
        check("an unknown type is described by its publisher", head.get("readable") and "metres" in fields and head.get("type_hash_fits") is True,
              f"({head.get('type_hash')}, {sorted(fields)})")
        check("its numbers are right", fields.get("metres", {}).get("least", 0) >= 120.0)
        with open(os.path.join(bag, "metadata.yaml")) as file:
            metadata = file.read()
        check("publishers' qualities of service are kept", metadata.count("reliability: reliable") == 7
              and metadata.count("durability: transient_local") == 1, f"({metadata.count('reliability: reliable')} reliable)")
        check("what nobody knows has no numbers", topics.get("/bare", {}).get("readable") is False)
        check("the bag gives no warnings", clean == 0 and not warnings, f"({warnings})")

        path = os.path.join(folder, "definitions", "bench_msgs", "msg")
        os.makedirs(path, exist_ok=True)
        for name, text in (("Bare", "float64 value\n"), ("Head", TEXTS["bench_msgs/msg/Head"]), ("Gauge", "float32 level\n")):
            with open(os.path.join(path, f"{name}.msg"), "w") as file:
                file.write(text)
        peer.answers = False
        bag = os.path.join(folder, "named")
        arguments = ("--topics", "/bare", "/head", "/rosout", "--definitions", os.path.join(folder, "definitions"))
        code = record(binary, bag, log, *arguments, "--duration", "5").wait(60)
        topics, warnings, clean = info(binary, bag)
        check("definitions of a folder do", code == 0 and clean == 0 and all(topics[name]["readable"] for name in ("/bare", "/head")),
              f"(exit code {code}, {warnings})")
        check("only what was named is recorded", set(topics) == {"/bare", "/head", "/rosout"}, f"({sorted(topics)})")
    finally:
        peer.end()


KEPT = Qos(Policy.Reliability.Reliable(duration(milliseconds=100)), Policy.History.KeepAll)
KEPT_LATCHED = Qos(Policy.Reliability.Reliable(duration(milliseconds=100)), Policy.Durability.TransientLocal, Policy.History.KeepAll)
PLAYED = {"/clock": ros.Clock, "/rosout": Log, "/diagnostics": ros.DiagnosticArray, "/talk": String, "/joint_states": ros.JointState,
          "/bare": Bare, "/head": Head}


def play(binary, folder):
    """What was recorded, played again: types that the program does not know, decoded by a peer."""
    bag = os.path.join(folder, "all")
    if not os.path.isdir(bag):
        types(binary, folder)
    recorded, _, _ = info(binary, bag)
    participant = DomainParticipant(DOMAIN)
    publications = BuiltinDataReader(participant, BuiltinTopicDcpsPublication)
    topics = {name: Topic(participant, f"rt{name}", kind) for name, kind in PLAYED.items()}
    readers = {name: DataReader(participant, topic, qos=KEPT) for name, topic in topics.items()}
    got, late, comer, said_by = {name: [] for name in PLAYED}, [], None, {}
    process = subprocess.Popen([binary, "play", bag, "--speed", "3", "--json"], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    begin = None
    while process.poll() is None:
        for name, reader in readers.items():
            got[name] += whole(reader.take(10000))
        if got["/clock"] and begin is None:
            begin = time.monotonic()
            said_by = {s.topic_name[2:]: s for s in publications.read(1000) if s.participant_key != participant.guid}
        if comer is None and begin and time.monotonic() > begin + 1.0:
            comer = DataReader(participant, topics["/rosout"], qos=KEPT_LATCHED)
        late += whole(comer.take(10)) if comer else []
        time.sleep(0.002)
    for name, reader in readers.items():
        got[name] += whole(reader.take(10000))
    out, err = process.communicate()
    played = json.loads(out or "{}").get("messages", {})
    check("a bag of any types is played without a word", process.returncode == 0 and not err.strip(), f"(exit code {process.returncode}, {err.strip()})")
    counts = {name: (topic["messages"], played.get(name), len(got[name])) for name, topic in recorded.items()}
    check("whole: as many as were recorded are played and decoded", all(a == b == c for a, b, c in counts.values()) and set(PLAYED) == set(counts), f"({counts})")
    heads = [head.metres for head in got["/head"]]
    right = all(head.counts == [1, 2, 3] and [gauge.level for gauge in head.gauges] == [0.5, 0.25] for head in got["/head"])
    check("in order, and as they were", right and heads == sorted(heads) and all(b - a == 1.0 for a, b in zip(heads, heads[1:])))
    check("words and joints, too", [sample.data[:7] for sample in got["/talk"][:1]] == ["number "] and got["/joint_states"][0].name == ["a"])
    clocks = [sample.clock.sec * 10**9 + sample.clock.nanosec for sample in got["/clock"]]
    check("/clock rises", clocks == sorted(clocks) and len(set(clocks)) == len(clocks))
    check("who comes late gets what its publisher kept", len(late) == 1, f"({len(late)} of 1)")
    head = said_by.get("/head")
    data = bytes(head.qos[Policy.Userdata].data) if head and Policy.Userdata in head.qos else b""
    check("the type's hash is announced as it was recorded", f"typehash={head_hash()};".encode() in data, f"({data})")

    chosen = subprocess.run([binary, "play", bag, "--topics", "/talk", "/clock", "--duration", "2", "--clock=50", "--speed", "4", "--wait", "0"],
                            capture_output=True, text=True)
    check("the bag's /clock gives way to --clock, which is told", chosen.returncode == 0 and "--clock tells the time instead" in chosen.stderr
          and "/talk" in chosen.stdout and "/head" not in chosen.stdout, f"(exit code {chosen.returncode}, {chosen.stderr})")


def refusals(binary, folder):
    """What is refused leaves nothing, and nothing that blocks the next."""
    bag = os.path.join(folder, "refused")
    log = open(os.path.join(folder, "refused.txt"), "w")
    code = record(binary, bag, log, "--topics", "not a name!").wait(30)
    check("a name that is none is refused, and nothing stays", code == 1 and not os.path.exists(bag) and not os.path.exists(kept(bag)), f"(exit code {code})")
    process = record(binary, bag, log, "--topics", "/nothing")
    wait_for(lambda: os.path.exists(kept(bag)), 30)
    time.sleep(1)
    process.kill()
    process.wait()
    check("a recorder that was killed before its first message leaves its folder", os.path.exists(kept(bag)))
    again = subprocess.run([binary, "record", "--out", bag, "--topics", "/nothing", "--duration", "1"], stdout=log, stderr=log)
    check("which does not block the next", again.returncode == 3 and os.path.isdir(bag) and not os.path.exists(kept(bag)), f"(exit code {again.returncode})")


class Numbers:
    """Publishes numbers at a steady rate, and knows when each went out."""

    def __init__(self):
        participant = DomainParticipant(DOMAIN)
        self.writer = DataWriter(participant, Topic(participant, "rt/governor/command", ros.GovernorCommand), qos=RELIABLE)
        self.sent = []
        self.ends = threading.Event()
        self.thread = threading.Thread(target=self.run)
        self.thread.start()

    def run(self):
        begin = time.monotonic()
        while not self.ends.is_set():
            self.sent.append(time.monotonic())
            self.writer.write(ros.GovernorCommand(now(), len(self.sent) * 1e-6))
            time.sleep(max(0.0, begin + len(self.sent) / RATE - time.monotonic()))

    def end(self):
        self.ends.set()
        self.thread.join()


def openings(binary, bag):
    """How many numbers a bag holds, the first and the last of them."""
    topics, warnings, _ = info(binary, bag)
    topic = topics.get("/governor/command", {"messages": 0, "fields": []})
    for one in topic["fields"]:
        return topic["messages"], round(one["least"] * 1e6), round(one["most"] * 1e6), warnings
    return 0, 0, 0, warnings


def kills(binary, folder):
    """A recorder killed at random: every message that was flushed is back."""
    count = int(os.environ.get("KILLS", "4"))
    numbers = Numbers()
    log = open(os.path.join(folder, "kills.txt"), "w")
    chance = random.Random(27)
    saved, worst_s, holes, failed = 0, 0.0, 0, []
    try:
        for number in range(count):
            bag = os.path.join(folder, "killed")
            process = record(binary, bag, log, "--topics", "/governor/command", "--lease", "1")
            until = time.monotonic() + 30
            while time.monotonic() < until and not matched(numbers.writer):
                time.sleep(0.01)
            with Machine() as machine:
                time.sleep(chance.uniform(1.5, 4.5))
                process.send_signal(signal.SIGKILL)
                process.wait()
                killed = time.monotonic()
            again = subprocess.run([binary, "record", "--out", bag, "--duration", "0.1"], capture_output=True, text=True)
            told = again.returncode == 1 and "govtwin recover" in again.stderr
            run = subprocess.run([binary, "recover", bag], capture_output=True, text=True)
            messages, first, last, warnings = openings(binary, bag)
            # The number of the last message counts from 1.
            lost_s = killed - numbers.sent[last] if messages else killed
            worst_s = max(worst_s, lost_s)
            holes += last - first + 1 - messages
            saved += messages
            if not told or run.returncode not in (0, 3) or warnings or lost_s > FLUSH_S + 0.5 + machine.lost_s:
                failed.append((number, told, run.returncode, warnings, round(lost_s, 2)))
            while matched(numbers.writer):
                # A killed peer is dropped by its lease; its successor is told apart by coming while none is matched.
                time.sleep(0.1)
        check(f"{count} kills: everything up to the last flush is back, a second flush apart", not failed and holes <= saved // 1000,
              f"({saved} messages saved, {holes} missing among them, at most {worst_s:.2f} s before a kill lost; {failed[:3]})")
    finally:
        numbers.end()


def fill(path):
    """Writes until nothing more fits."""
    with open(path, "wb", buffering=0) as file:
        try:
            while file.write(bytes(4096)):
                pass
        except OSError:
            pass


def full(binary, folder):
    """A disk that is full: the bag is completed, and the node goes on."""
    if os.geteuid() != 0:
        print("skipped: a small disk needs root")
        return
    disk = os.path.join(folder, "disk")
    os.makedirs(disk, exist_ok=True)
    if subprocess.run(["mount", "-t", "tmpfs", "-o", "size=10m", "tmpfs", disk]).returncode != 0:
        print("skipped: no small disk can be mounted")
        return
    numbers = Numbers()
    log = open(os.path.join(folder, "full.txt"), "w+")
    try:
        bag, ballast = os.path.join(disk, "run"), os.path.join(disk, "ballast")
        process = record(binary, bag, log, "--topics", "/governor/command")
        wait_for(lambda: matched(numbers.writer), 30)
        time.sleep(4)
        fill(ballast)
        code = process.wait(60)
        log.seek(0)
        said = log.read()
        messages, _, _, warnings = openings(binary, bag)
        check("a full disk ends the recording, which is complete and told", code == 3 and "the disk is full" in said and messages > 300 and not warnings,
              f"(exit code {code}, {messages} messages, {warnings})")
        os.remove(ballast)
        shutil.rmtree(bag)
        figures = os.path.join(folder, "full.json")
        log = open(os.path.join(folder, "full_node.txt"), "w+")
        node = subprocess.Popen([binary, "run", "--optional", "esv", "tank_pressure", "--bag", bag, "--out", figures], stdout=log, stderr=log)
        wait_for(lambda: matched(numbers.writer), 30)
        first = len(numbers.sent)
        time.sleep(4)
        fill(ballast)
        wait_for(lambda: "the node runs on without it" in open(log.name).read(), 60)
        time.sleep(4)
        alive, sent = node.poll() is None, len(numbers.sent) - first
        node.send_signal(signal.SIGINT)
        code = node.wait(ENDS_S)
        log.seek(0)
        said = log.read()
        _, warnings, _ = info(binary, bag)
        with open(figures) as file:
            used = json.load(file)["inputs"]["governor/command"]["used"]
        check("the node outlives its bag, and says so", alive and code == 3 and "the node runs on without it" in said and used > 0.9 * sent > 1000,
              f"(exit code {code}, {used} of {sent} commands used)")
        check("its bag is complete", not warnings and os.path.exists(os.path.join(bag, "metadata.yaml")), f"({warnings})")
    finally:
        numbers.end()
        subprocess.run(["umount", disk])


if __name__ == "__main__":
    folder = os.path.join(sys.argv[2], "record")
    os.makedirs(folder, exist_ok=True)
    run_cases(folder, types, play, refusals, kills, full)
