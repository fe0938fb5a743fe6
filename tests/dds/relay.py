"""A bad network of ours: two network namespaces joined by a relay that loses, delays and reorders packets, where the kernel has no netem.

Needs root and /dev/net/tun. Packets of layer 3 go from one namespace through this process into the other.
"""

import fcntl
import heapq
import json
import os
import random
import select
import struct
import subprocess
import sys
import threading
import time

TUNSETIFF = 0x400454CA
IFF_TUN, IFF_NO_PI = 0x0001, 0x1000


def is_possible():
    """Whether a network can be made here; says so where it cannot."""
    if os.geteuid() == 0 and os.path.exists("/dev/net/tun"):
        return True
    print("skipped: needs root and /dev/net/tun")
    return False


def ip(*words):
    subprocess.run(["ip", *words], check=True, capture_output=True)


class Side:
    """One namespace with its end of the link."""

    def __init__(self, name, address):
        self.name, self.address, self.device = name, address, name
        self.tun = os.open("/dev/net/tun", os.O_RDWR | os.O_NONBLOCK)
        fcntl.ioctl(self.tun, TUNSETIFF, struct.pack("16sH22x", self.device.encode(), IFF_TUN | IFF_NO_PI))
        ip("netns", "add", name)
        ip("link", "set", self.device, "netns", name)
        self.run("ip", "addr", "add", f"{address}/24", "dev", self.device)
        self.run("ip", "link", "set", self.device, "multicast", "on", "up")
        self.run("ip", "link", "set", "lo", "up")
        self.run("ip", "route", "add", "239.0.0.0/8", "dev", self.device)

    def command(self, *words):
        """A command that runs in this namespace."""
        return ["ip", "netns", "exec", self.name, *words]

    def run(self, *words):
        subprocess.run(self.command(*words), check=True, capture_output=True)

    def close(self):
        os.close(self.tun)
        subprocess.run(["ip", "netns", "del", self.name], capture_output=True)


def is_tcp(packet):
    """Whether this is TCP over IP version 4."""
    return packet[0] >> 4 == 4 and packet[9] == 6


def is_multicast(packet):
    """Whether this is IP version 4 to a group."""
    return packet[0] >> 4 == 4 and packet[16] >> 4 == 14


class Network:
    """Two sides and what lies between them; conditions may change at any time. With `tcp_only` DDS does not get across, with `unicast_only` no group does."""

    def __init__(self, prefix, seed=1):
        self.loss, self.delay_s, self.jitter_s, self.is_up = 0.0, 0.0, 0.0, True
        self.passed = self.lost = 0
        self.tcp_only = self.unicast_only = False
        # Names of this process alone: two checkouts may be tested on one machine.
        self.sides = [Side(f"{prefix}{os.getpid()}_{index}", f"10.99.7.{index + 1}") for index in range(2)]
        self.random = random.Random(seed)
        self.ended = threading.Event()
        self.thread = threading.Thread(target=self.relay, daemon=True)
        self.thread.start()

    def set(self, loss=0.0, delay_s=0.0, jitter_s=0.0, is_up=True):
        """Share of packets lost, delay and up to how much more: packets that overtake each other are reordered."""
        self.loss, self.delay_s, self.jitter_s, self.is_up = loss, delay_s, jitter_s, is_up

    def losing(self, loss, program, mode):
        """Runs a peer on the second side, loses packets from where it says that it is ready, and gives what it prints at its end."""
        program = os.path.abspath(program)
        peer = subprocess.Popen(self.sides[1].command(sys.executable, program, mode), stdin=subprocess.PIPE, stdout=subprocess.PIPE,
                                cwd=os.path.dirname(program), text=True)
        peer.stdout.readline()
        self.set(loss=loss)
        return json.loads(peer.communicate("go\n", timeout=600)[0].splitlines()[-1])

    def relay(self):
        waiting, number = [], 0
        ends = {side.tun: self.sides[1 - index].tun for index, side in enumerate(self.sides)}
        while not self.ended.is_set():
            patience = min(max(waiting[0][0] - time.monotonic(), 0.0), 0.05) if waiting else 0.05
            for tun in select.select(list(ends), [], [], patience)[0]:
                packet = os.read(tun, 65536)
                is_stopped = self.tcp_only and not is_tcp(packet) or self.unicast_only and is_multicast(packet)
                if is_stopped or not self.is_up or self.random.random() < self.loss:
                    self.lost += 1
                    continue
                due = time.monotonic() + self.delay_s + self.random.random() * self.jitter_s
                number += 1
                heapq.heappush(waiting, (due, number, ends[tun], packet))
            while waiting and waiting[0][0] <= time.monotonic():
                _, _, end, packet = heapq.heappop(waiting)
                try:
                    os.write(end, packet)
                    self.passed += 1
                except OSError:
                    self.lost += 1

    def close(self):
        self.ended.set()
        self.thread.join()
        for side in self.sides:
            side.close()
