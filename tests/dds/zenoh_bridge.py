#!/usr/bin/env python3
"""A node and a peer on Cyclone DDS on two hosts that nothing but Zenoh joins: a bridge `zenoh-bridge-ros2dds` beside each, over TCP and over TLS.

Usage: zenoh_bridge.py GOVTWIN FOLDER   (needs PyPI `cyclonedds` 11, root and /dev/net/tun; logs go to FOLDER)
ZENOH_BRIDGE names the bridge's program, else it is looked for in PATH. ROS_DISTRO must be that of the node's build (humble or later).
The hosts are network namespaces; what lies between them passes TCP only, so that DDS cannot. Where PyPI `eclipse-zenoh` is there, a program
without DDS hears and commands too. LINKS picks among: tcp tls. Exits 0 when everything was as it should be, 1 otherwise, 77 where nothing could be tried.
"""

import json
import os
import shutil
import subprocess
import sys
import time

from bench import DOMAIN, Bench, check, end_process, now, stamp_ns, wait_for, whole, FAILED
import types_ros as ros
from network import Remote
from graph import announce
from relay import Network, is_possible
from simulate import ALREADY, OK, PAUSED, PLAYING, Driver, add_action, result

HERE = os.path.dirname(os.path.abspath(__file__))
PORT = 7447
# Longer than the lease of a Zenoh session, 10 s.
OUTAGES_S = (3.0, 20.0)


def program():
    """The bridge's program; None where there is none."""
    named = os.environ.get("ZENOH_BRIDGE") or "zenoh-bridge-ros2dds"
    return shutil.which(named)


class Bridge:
    """A bridge in a namespace, with its log in a file."""

    def __init__(self, side, folder, name, ends, tls=None):
        settings = {
            "mode": "router",
            "listen": {"endpoints": []},
            "scouting": {"multicast": {"enabled": False}},
            "plugins": {"ros2dds": {"domain": DOMAIN}},
            **ends,
        }
        if tls:
            settings["transport"] = {"link": {"tls": tls}}
        path = os.path.join(folder, f"bridge_{name}.json5")
        with open(path, "w") as text:
            json.dump(settings, text, indent=2)
        self.log = open(os.path.join(folder, f"bridge_{name}.txt"), "w")
        self.process = subprocess.Popen(side.command(program(), "-c", path), stdout=self.log, stderr=self.log)

    def end(self):
        end_process(self.process)
        self.log.close()


def bridges(network, folder, scheme, certificates=None):
    """A bridge on each side: that of the node listens, that of the peer connects."""
    node, peer = network.sides
    at = f"{scheme}/{node.address}:{PORT}"
    tls = [tls_of(certificates, own, other) for own, other in ((0, 1), (1, 0))] if certificates else (None, None)
    return [Bridge(node, folder, f"{scheme}_node", {"listen": {"endpoints": [at]}}, tls[0]),
            Bridge(peer, folder, f"{scheme}_peer", {"connect": {"endpoints": [at]}}, tls[1])]


def certificate(folder, name, address):
    """A certificate that nobody but itself vouches for, and its key."""
    paths = [os.path.join(folder, f"{name}.{kind}.pem") for kind in ("certificate", "key")]
    subprocess.run(["openssl", "req", "-x509", "-newkey", "rsa:2048", "-nodes", "-days", "2", "-subj", f"/CN={name}", "-out", paths[0], "-keyout", paths[1],
                    "-addext", "basicConstraints=critical,CA:FALSE", "-addext", f"subjectAltName=IP:{address}"], check=True, capture_output=True)
    return paths


def tls_of(certificates, own, other):
    """Who has this certificate believes only who has that one."""
    (file, key), (believed, _) = certificates[own], certificates[other]
    return {"enable_mtls": True, "root_ca_certificate": believed, "listen_certificate": file, "listen_private_key": key,
            "connect_certificate": file, "connect_private_key": key}


class Peer:
    """This file as the peer in a namespace; it asks for outages by lines of its output."""

    def __init__(self, network, *arguments):
        self.network = network
        command = network.sides[1].command(sys.executable, os.path.join(HERE, "zenoh_bridge.py"), *arguments)
        self.process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, bufsize=1)

    def run(self):
        for line in self.process.stdout:
            words = line.split()
            if words[:1] == ["link"]:
                self.network.set(is_up=words[1] == "up")
                continue
            print(line, end="")
            if words[:1] == ["FAIL"]:
                FAILED.append(line.strip())
        if self.process.wait() not in (0, 1):
            check("the peer ends in order", False)


def across(binary, folder, scheme):
    """Everything over one kind of link."""
    network = Network("gtz")
    network.tcp_only = True
    log, figures = os.path.join(folder, f"zenoh_{scheme}.txt"), os.path.join(folder, f"zenoh_{scheme}.json")
    certificates = None
    if scheme == "tls":
        certificates = [certificate(folder, f"side{n}", side.address) for n, side in enumerate(network.sides)]
    node = Remote(network.sides[0], binary, log, "--publish-clock", "--out", figures)
    joined = bridges(network, folder, scheme, certificates)
    try:
        Peer(network, "--peer", "all" if scheme == "tcp" else "few").run()
        Peer(network, "--zenoh", f"{scheme}/{network.sides[0].address}:{PORT}").run() if scheme == "tcp" else None
        if scheme == "tls":
            joined.pop().end()
            stranger = tls_of([certificate(folder, "stranger", network.sides[1].address), certificates[0]], 0, 1)
            ends = {"connect": {"endpoints": [f"tls/{network.sides[0].address}:{PORT}"]}}
            joined.append(Bridge(network.sides[1], folder, "tls_stranger", ends, stranger))
            Peer(network, "--peer", "nothing").run()
    finally:
        for bridge in joined:
            bridge.end()
        check("the node ends in order", node.end())
        network.close()
    check("DDS itself did not get across", network.lost > 20, f"({network.lost} packets were stopped, {network.passed} of TCP passed)")
    if scheme == "tcp":
        trips = open(log).read().count("fail-safe: inputs are missing")
        check("an outage beyond the limits fails safe", trips >= 1, f"({trips} times)")


def stamp_ns_of(clock):
    return clock.clock.sec * 10**9 + clock.clock.nanosec


def drive(driver, seconds, opening):
    """Commands at 100 Hz; the states that came back."""
    states, _ = Bench.drive(driver, seconds, opening)
    return states


def peer(what):
    """The far side: commands, calls, an action, the clock, outages."""
    driver = Driver()
    feedback, status = add_action(driver)
    told = announce(driver.participant, "far_bench", driver, [feedback, status])
    there = wait_for(lambda: drive(driver, 0.2, 0.3), 40 if what != "nothing" else 15)
    if what == "nothing":
        check("a bridge with another certificate gets nothing", not there)
        return
    check("states come across", bool(there))
    states = drive(driver, 4.0, 0.5)
    position = states[-1].servomotor_position if states else float("nan")
    check("commands go across and are followed", abs(position - 0.5) < 2e-3, f"({position:.4f})")
    check("states keep their rate", len(states) > 350, f"({len(states)} in 4 s)")
    check("stamps rise", all(stamp_ns(b.header) > stamp_ns(a.header) for a, b in zip(states, states[1:])))
    reply = driver.call("reset", 0)
    check("~/reset is answered", reply is not None and reply.success, f"({reply})")
    if what == "few":
        return
    clocks = []
    for _ in range(10):
        drive(driver, 0.1, 0.5)
        clocks += whole(driver.clock_in.take(1000))
    rises = all(stamp_ns_of(b) > stamp_ns_of(a) for a, b in zip(clocks, clocks[1:]))
    # Its reader keeps ten.
    check("/clock comes across", len(clocks) > 60 and rises, f"({len(clocks)} in a second)")
    joints = whole(driver.joints.take(1000))
    check("joint states come across", joints and joints[-1].name == ["spool", "servomotor"])
    request = ros.GetParametersRequest(0x0102030405060708, 11, ["hold", "unit.servomotor.stroke_m", "no"])
    reply = driver.ask(driver.get_call, driver.get_reply, request, 10)
    check("parameters are read", reply is not None and [v.double_value for v in reply.values[:2]] == [0.5, 0.6], "" if reply else "(no reply)")
    value = lambda number: ros.ParameterValue(3, False, 0, number, "", [], [], [], [], [])
    request = ros.SetParametersRequest(0x0102030405060708, 12, [ros.Parameter("hold", value(0.7)), ros.Parameter("hold", value(-1.0))])
    reply = driver.ask(driver.set_call, driver.set_reply, request, 10)
    check("and set, or refused", reply is not None and [r.successful for r in reply.results] == [True, False])
    reply = driver.ask(driver.list_call, driver.list_reply, ros.ListParametersRequest(0x0102030405060708, 13, [], 0), 10)
    check("a reply above one datagram comes across", reply is not None and len(reply.names) > 50)
    for seconds in OUTAGES_S:
        print("link down", flush=True)
        drive(driver, seconds, 0.5)
        print("link up", flush=True)
        begin, opening = time.monotonic(), 0.3
        back = wait_for(lambda: any(abs(s.servomotor_position - opening) < 2e-3 for s in drive(driver, 0.2, opening)), 60)
        check(f"a link that was down for {seconds:.0f} s works again, both ways", back, f"({time.monotonic() - begin:.1f} s after it came back)")
        drive(driver, 2.0, 0.5)
    check("the simulation is paused", result(driver.call("set_simulation_state", PAUSED)) in (OK, ALREADY))
    reply = driver.call("step_simulation", 10)
    check("and stepped", result(reply) == OK, f"({reply})")
    goal = [7] * 16
    reply = driver.call("send_goal", goal, 3000)
    check("the action's goal is accepted", reply is not None and reply.accepted, f"({reply})")
    if reply is not None:
        reply = driver.call("get_result", goal, seconds=15)
        check("its result comes", reply is not None and (reply.status, reply.result.result) == (4, OK), f"({reply})")
        done = [sample.completed_steps for sample in whole(feedback.take(1000))]
        check("with feedback", bool(done) and done == sorted(done) and done[-1] == 3000, f"({done})")
    check("and it plays again", result(driver.call("set_simulation_state", PLAYING)) == OK)
    del told


def plain(at):
    """A program without DDS on the link: it subscribes by Zenoh and reads CDR."""
    try:
        import zenoh
    except ImportError:
        print("skipped: PyPI eclipse-zenoh is not there")
        return
    config = zenoh.Config()
    config.insert_json5("mode", '"client"')
    config.insert_json5("connect/endpoints", json.dumps([at]))
    config.insert_json5("scouting/multicast/enabled", "false")
    with zenoh.open(config) as session:
        states = []
        heard = session.declare_subscriber("sim/servo_state", lambda sample: states.append(ros.ServoState.deserialize(bytes(sample.payload))))
        command = session.declare_publisher("governor/command")
        others = [session.declare_publisher(f"governor/{name}") for name in ("esv", "tank_pressure")]
        for _ in range(500):
            command.put(ros.GovernorCommand(now(), 0.4).serialize())
            others[0].put(ros.EsvState(now(), 1).serialize())
            others[1].put(ros.FluidPressure(now(), 6.3e6, 0.0).serialize())
            time.sleep(0.01)
        heard.undeclare()
    position = states[-1].servomotor_position if states else float("nan")
    check("a program without DDS hears states and commands", abs(position - 0.4) < 2e-3, f"({len(states)} states, {position:.4f})")


def main():
    if sys.argv[1:2] == ["--peer"]:
        peer(sys.argv[2])
    elif sys.argv[1:2] == ["--zenoh"]:
        plain(sys.argv[2])
    else:
        if program() is None:
            print("skipped: no zenoh-bridge-ros2dds in PATH, and ZENOH_BRIDGE names none")
            sys.exit(77)
        if not is_possible():
            sys.exit(77)
        for scheme in os.environ.get("LINKS", "tcp tls").split():
            print(f"-- {scheme}")
            across(sys.argv[1], sys.argv[2], scheme)
        print(f"{len(FAILED)} failed")
    sys.exit(1 if FAILED else 0)


if __name__ == "__main__":
    main()
