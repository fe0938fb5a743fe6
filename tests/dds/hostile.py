#!/usr/bin/env python3
"""Hostile packets of each kind against a running `govtwin run`, in the name of a matched peer: memory stays, states flow, the deadline is kept.

Usage: hostile.py GOVTWIN FOLDER   (needs PyPI `cyclonedds` 11; ROS_DOMAIN_ID picks the domain; logs go to FOLDER)
KINDS picks among: quiet random truncated mutated heartbeats fragments acknacks participants endpoints. HOSTILE_S (3) is how long each lasts. Packets go to 127.0.0.1
only, PACKETS_S (500) a second to each of the node's ports. Exits 0 when everything was as it should be, 1 otherwise, 77 where cyclonedds is missing.
"""

import json
import os
import random
import socket
import struct
import sys
import time

from bench import DOMAIN, Bench, Machine, check, now, wait_for, whole, FAILED
import types_ros as ros
from faults import BUILTIN, Node, header, hostile, number, submessage

SECONDS = float(os.environ.get("HOSTILE_S", "3"))
PACKETS_S = int(os.environ.get("PACKETS_S", "500"))
# What may be taken at all (fragments that wait for their rest), and in the second half of a minute.
MOST_MEGABYTES, LATER_MEGABYTES = 100.0, 6.0
BASE = 7400 + 250 * DOMAIN
PORTS = [BASE] + [BASE + 10 + 2 * index + user for index in range(2) for user in (0, 1)]


def user_ids(source):
    """Reader and writer ids as a node's own topics have them."""
    return source.randrange(256, 320) << 8 | 0x04, source.randrange(256, 320) << 8 | 0x03


def ids(source):
    return struct.pack(">II", *(source.choice(BUILTIN) if source.random() < 0.7 else user_ids(source)))


def randoms(source, prefix, count):
    body = source.randbytes(source.randrange(0, 1400))
    return body if source.random() < 0.5 else header(prefix) + body


def truncated(source, prefix, count):
    packet = header(prefix) + source.choice(list(hostile(count)))
    return packet[:source.randrange(0, len(packet))]


def mutated(source, prefix, count):
    packet = bytearray(header(prefix) + source.choice(list(hostile(count))))
    for _ in range(source.randint(1, 6)):
        packet[source.randrange(20, len(packet))] = source.randrange(256)
    return bytes(packet)


def heartbeats(source, prefix, count):
    first = source.choice([1, source.randrange(1 << 20), 1 << 30, (1 << 63) - 2])
    last = source.choice([first, first + source.randrange(1 << 32), (1 << 63) - 1, first - 1])
    body = ids(source) + number(first) + number(min(last, (1 << 63) - 1)) + struct.pack("<i", count)
    return header(prefix) + submessage(7, source.choice([1, 3, 5]), body)


def fragments(source, prefix, count):
    kind = source.randrange(3)
    sample = number(source.randrange(1, 1 << source.choice([4, 20, 40])))
    if kind == 0:
        size = source.choice([1 << 10, 1 << 20, 0xFFFFFFF0])
        body = struct.pack("<HH", 0, 28) + ids(source) + sample + struct.pack("<IHHI", source.randrange(1, 1 << 16), 1, source.choice([64, 1200, 60000]), size)
        return header(prefix) + submessage(0x16, 1, body + source.randbytes(64))
    if kind == 1:
        body = ids(source) + sample + struct.pack("<II", source.choice([1, 0xFFFFFF00]), 32) + struct.pack("<I", 0xFFFFFFFF) + struct.pack("<i", count)
        return header(prefix) + submessage(0x12, 1, body)
    return header(prefix) + submessage(0x13, 1, ids(source) + sample + struct.pack("<I", source.randrange(1 << 32)) + struct.pack("<i", count))


def acknacks(source, prefix, count):
    base = source.choice([1, source.randrange(1 << 20), (1 << 62) + 5, (1 << 63) - 8])
    bits = source.choice([0, 1, 32, 256])
    body = ids(source) + number(base) + struct.pack("<I", bits) + source.randbytes(bits // 8 + 4 if bits % 32 else bits // 8)
    if source.random() < 0.5:
        return header(prefix) + submessage(6, 1, body + struct.pack("<i", count))
    # A gap, which needs no count.
    return header(prefix) + submessage(8, 1, ids(source) + number(1) + body[8:])


def parameter(kind, value):
    value += bytes(-len(value) % 4)
    return struct.pack("<HH", kind, len(value)) + value


def data(reader, writer, sample, payload):
    body = struct.pack("<HH", 0, 16) + struct.pack(">II", reader, writer) + number(sample) + b"\x00\x03\x00\x00" + payload + struct.pack("<HH", 1, 0)
    return submessage(0x15, 5, body)


def participants(source, prefix, count):
    """Participants that were never there, each with a lease of a second."""
    stranger = b"\x01\x10" + source.randbytes(10)
    locator = struct.pack("<iI", 1, 7400 + source.randrange(50000)) + bytes(12) + bytes([127, 0, 0, 1])
    payload = (parameter(0x15, b"\x02\x02\0\0") + parameter(0x16, b"\x01\x10\0\0") + parameter(0x50, stranger + struct.pack(">I", 0x1C1))
               + parameter(0x58, struct.pack("<I", 0xFFFFFFFF)) + parameter(0x32, locator) + parameter(0x31, locator)
               + parameter(0x02, struct.pack("<iI", 1, 0)))
    return header(stranger) + data(0x100C7, 0x100C2, 1, payload)


def endpoints(source, prefix, count):
    """Endpoints in a peer's name, right and wrong, on topics of every kind; told by one who never was: a peer's own numbers would be spent,
    and its later endpoints lost by right."""
    reader, writer = source.choice(BUILTIN[:2])
    name = source.choice(["rt/governor/command", "rt/sim/servo_state", "rt/" + "x" * source.randrange(200), "\xff" * 20])
    text = name.encode("latin1") + b"\0"
    length = source.choice([len(text), len(text), 0xFFFFFFFF, 0])
    guid = prefix + struct.pack(">I", user_ids(source)[source.randrange(2)])
    payload = (parameter(0x5A, guid) + parameter(0x05, struct.pack("<I", length) + text)
               + parameter(0x07, struct.pack("<I", 5) + b"Type\0") + parameter(0x50, prefix + struct.pack(">I", 0x1C1)))
    return header(b"\x01\x10" + source.randbytes(10)) + data(reader, writer, source.randrange(1, 1 << 16), payload)


KINDS = {"quiet": None, "random": randoms, "truncated": truncated, "mutated": mutated, "heartbeats": heartbeats, "fragments": fragments,
         "acknacks": acknacks, "participants": participants, "endpoints": endpoints}


def strike(binary, folder, kind):
    """One node under one kind of packets; its figures."""
    figures, make = os.path.join(folder, f"hostile_{kind}.json"), KINDS[kind]
    node = Node(binary, os.path.join(folder, f"hostile_{kind}.txt"), "--out", figures)
    bench = Bench()
    out = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    source = random.Random(f"hostile {kind}")
    count = states = 0
    try:
        wait_for(bench.is_met, 15)
        bench.drive(3.0, 0.4)
        before = most = node.megabytes()
        prefix, begin, step = bench.participant.guid.bytes[:12], time.monotonic(), 0
        # Each stranger is told of all that the node has, as DDS wants it: fewer of them.
        per_step, middle = PACKETS_S * (0.001 if make is participants else 0.01), before
        with Machine() as machine:
            while time.monotonic() < begin + SECONDS and node.process.poll() is None:
                bench.command.write(ros.GovernorCommand(now(), 0.4))
                if step % 10 == 0:
                    bench.pressure.write(ros.FluidPressure(now(), 6.3e6, 0.0))
                    bench.esv.write(ros.EsvState(now(), 1))
                    most = max(most, node.megabytes())
                    middle = most if time.monotonic() < begin + SECONDS / 2 else middle
                states += len(whole(bench.state.take(100)))
                step += 1
                while make is not None and count < per_step * step:
                    count += 1
                    packet = make(source, prefix, count % (1 << 31))
                    for port in PORTS:
                        try:
                            out.sendto(packet, ("127.0.0.1", port))
                        except OSError:
                            pass
                time.sleep(max(0.0, begin + 0.01 * step - time.monotonic()))
        took = time.monotonic() - begin - machine.lost_s
        after, _ = bench.drive(3.0, 0.6)
        alive = node.process.poll() is None
        position = after[-1].servomotor_position if after else float("nan")
        check(f"{kind}: it hears and is heard, then and afterwards", alive and states > 80 * took and len(after) > 200 and abs(position - 0.6) < 5e-3,
              f"({states / took:.0f} and {len(after) / 3:.0f} states a second, {count} packets to each of {len(PORTS)} ports)")
        check(f"{kind}: memory stays", alive and most - before < MOST_MEGABYTES and (SECONDS < 30 or most - middle < LATER_MEGABYTES),
              f"({before:.1f} MB before, {middle:.1f} at most in the first half, {most:.1f} in the second)")
    finally:
        out.close()
        check(f"{kind}: the node ends in order", node.end())
    with open(figures) as text:
        loop = json.load(text)["loop"]
    check(f"{kind}: no tick is skipped", loop["skipped"] <= loop["ticks"] // 1000 + 1000 * machine.lost_s,
          f"({loop['skipped']} of {loop['ticks']}; a bare loop lost {machine.lost_s:.1f} s)")
    late = loop["lateness"]
    print(f"     lateness {late['p50_us']:.0f} / {late['p99_us']:.0f} / {late['p99_9_us']:.0f} us at 50 / 99 / 99.9 %, {loop['overruns']} overruns, load "
          f"{os.getloadavg()[0]:.1f}")


def main():
    for kind in os.environ.get("KINDS", " ".join(KINDS)).split():
        strike(sys.argv[1], sys.argv[2], kind)
    print(f"{len(FAILED)} failed")
    sys.exit(1 if FAILED else 0)


if __name__ == "__main__":
    main()
