"""Faults: whatever goes wrong, nothing is lost, nothing double, and every failure is told with its unit."""

import json
import random
import shutil
import signal
import subprocess
import sys
import threading
import time

from fleet_made import CORES, ENVIRONMENT, PROGRAM, SECRET, gather, govtwin, s3, say, xargs
from s3_proxy import Proxy

# Rounds of the same plan until nothing is missing: with one request in ten failing, an entry of a dozen requests needs few.
ROUNDS = 30


class Fleet:
    """A plan, what its table must be, and where things stand."""

    def __init__(self, folder, without, expected, entries, kills, pace_s):
        self.folder, self.without, self.expected, self.entries, self.kills, self.pace_s = folder, without, expected, entries, kills, pace_s
        self.plan = folder / "plan"
        self.names = [f"{entry['unit']}, {entry['period']}" for entry in map(json.loads, (self.plan / "entries.jsonl").read_text().splitlines())]

    def compare(self, name, store, words, plan=None, environment=None):
        table, _ = gather(store, plan or self.plan, self.folder / f"gathered/fault_{name}", environment)
        if table != self.expected:
            sys.exit(f"fleet_check: {name}: the table is not that of a single process")
        say(f"{name}: {words}; the table is the same to the last byte")

    def told(self, name, stderr):
        """How many workers had no result; each must say so with its unit and period."""
        said = [line for line in stderr.splitlines() if "no result" in line]
        for line in said:
            if not any(one in line for one in self.names):
                sys.exit(f"fleet_check: {name}: a failure without its unit: {line}")
        if SECRET in stderr:
            sys.exit(f"fleet_check: {name}: {stderr[-2000:]}")
        return len(said)


def count(store):
    return len(list((store / "results").glob("*.json"))) if (store / "results").is_dir() else 0


def kill(fleet):
    """Workers that are killed at random moments of their work, each entry by two of them at once."""
    store = fleet.folder / "kill"
    draws = random.Random(1)
    killed = finished = 0
    start = time.monotonic()
    while killed < fleet.kills:
        if 2 * count(store) >= fleet.entries:
            # An entry that is done keeps nobody busy: begin again.
            for path in (store / "results").glob("*.json"):
                json.loads(path.read_text())
                path.unlink()
        command = [PROGRAM, "fleet", "run", fleet.plan, "--index", str(draws.randrange(fleet.entries)), "--out", store]
        pair = [subprocess.Popen(command, env=ENVIRONMENT, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) for _ in range(2)]
        # Two at once take twice as long; some are to end by themselves.
        time.sleep(draws.uniform(0.0, 3 * max(fleet.pace_s, 0.2)))
        for worker in pair:
            if worker.poll() is None:
                worker.send_signal(signal.SIGKILL)
                killed += 1
            else:
                finished += 1
            worker.wait()
    for path in (store / "results").glob("*.json"):
        json.loads(path.read_text())
    left = count(store)
    govtwin("fleet", "run", fleet.plan, "--out", store)
    fleet.compare("kill", store, f"{killed} workers killed and {finished} not, in {time.monotonic() - start:.0f} s; {left} results whole before the last run")


def two(fleet):
    """Two runs of the same plan at once, of several workers each."""
    store = fleet.folder / "two"
    runs = [threading.Thread(target=xargs, args=(fleet.entries, CORES, fleet.plan, store)) for _ in range(2)]
    for run in runs:
        run.start()
    for run in runs:
        run.join()
    fleet.compare("two", store, f"two runs at once, {count(store)} results of {fleet.entries} entries")


def disk(fleet):
    """A disk that is full before all is done, and larger later."""
    store = fleet.folder / "disk"
    store.mkdir()
    try:
        subprocess.run(["mount", "-t", "tmpfs", "-o", "size=3m", "tmpfs", store], check=True, capture_output=True)
    except (OSError, subprocess.CalledProcessError):
        say("disk: skipped, as nothing may be mounted here")
        return
    try:
        done = xargs(fleet.entries, CORES, fleet.plan, store, check=False)
        told, left = fleet.told("disk", done.stderr), count(store)
        if told + left != fleet.entries or not told:
            sys.exit(f"fleet_check: disk: {left} results and {told} failures told, of {fleet.entries} entries:\n{done.stderr[-2000:]}")
        for path in (store / "results").glob("*.json"):
            json.loads(path.read_text())
        subprocess.run(["mount", "-o", "remount,size=1g", store], check=True)
        govtwin("fleet", "run", fleet.plan, "--out", store)
        fleet.compare("disk", store, f"3 MB full after {left} results, {told} failures told with their units; with room the rest was done")
    finally:
        subprocess.run(["umount", store], check=True)


def clock(fleet):
    """Workers whose clocks are years apart; a store that refuses them for it."""
    if not shutil.which("faketime"):
        say("clock: skipped, as faketime is not installed")
        return
    store = fleet.folder / "clock"
    environment = {name: value for name, value in ENVIRONMENT.items() if name != "SOURCE_DATE_EPOCH"}
    for index in range(fleet.entries):
        shift = ["-3650d", "+0d", "+3650d"][index % 3]
        command = ["faketime", "-f", shift, PROGRAM, "fleet", "run", fleet.plan, "--index", str(index), "--out", store]
        done = subprocess.run(command, env=environment, capture_output=True, text=True)
        if done.returncode:
            sys.exit(f"fleet_check: clock: {done.stderr}")
    fleet.compare("clock", store, "workers ten years early, right and ten years late")


def through(fault, share, words):
    """A fault of the way to an S3 server, which some share of all requests meets."""

    def check(fleet):
        server = s3()
        if server is None:
            say(f"{fault}: skipped, as moto is not installed or the program has no object stores")
            return
        proxy = Proxy(server.port, fault, share)
        try:
            server.plan(fleet.folder, fleet.without)
            environment, start = server.environment(proxy.port), time.monotonic()
            rounds = told = 0
            while len(server.keys("store/results/")) < fleet.entries:
                if rounds == ROUNDS:
                    sys.exit(f"fleet_check: {fault}: entries lack results after {ROUNDS} rounds")
                done = xargs(fleet.entries, 2 * CORES, "s3://plant/plan", "s3://plant/store", environment, twice=True, check=False)
                told += fleet.told(fault, done.stderr)
                rounds += 1
            seconds = time.monotonic() - start
            fleet.compare(fault, "s3://plant/store", f"{proxy.hits} of {proxy.requests} requests {words}; {rounds} rounds in {seconds:.0f} s, "
                          f"{told} failures told with their units", "s3://plant/plan", server.environment())
        finally:
            proxy.stop()
            server.stop()

    return check


def server(fleet):
    """A server that is killed and started anew, again and again, while two workers are at each entry."""
    moto = s3()
    if moto is None:
        say("server: skipped, as moto is not installed or the program has no object stores")
        return
    proxy = Proxy(moto.port)
    try:
        moto.plan(fleet.folder, fleet.without, proxy.port)
        environment = moto.environment(proxy.port)
        restarts, stopped = [], threading.Event()

        def restart():
            while not stopped.wait(0.5):
                proxy.restart(moto)
                restarts.append(1)

        thread = threading.Thread(target=restart)
        thread.start()
        done = xargs(fleet.entries, 2 * CORES, "s3://plant/plan", "s3://plant/store", environment, twice=True, check=False)
        stopped.set()
        thread.join()
        told, left = fleet.told("server", done.stderr), len(moto.keys("store/results/"))
        xargs(fleet.entries, CORES, "s3://plant/plan", "s3://plant/store", environment)
        fleet.compare("server", "s3://plant/store", f"killed and started anew {len(restarts)} times, {left} results after the first run, {told} failures told with their units", "s3://plant/plan",
                      moto.environment())
        # One that does not come back: the failure names unit and object.
        line = (fleet.plan / "entries.jsonl").read_text().splitlines()[0]
        proxy.stop()
        gone = govtwin("fleet", "run", fleet.plan, "--out", "s3://plant/gone", check=(1,), environment={**environment, "HQ_ENTRY": line}, timeout=900).stderr
        if fleet.told("server", gone) != 1 or "s3://plant/gone" not in gone:
            sys.exit(f"fleet_check: server: {gone}")
    finally:
        moto.stop()


def skew(fleet):
    """A store that refuses a clock that is wrong, as S3 does: told with its unit, and nothing is written."""
    moto = s3()
    if moto is None or not shutil.which("faketime"):
        say("skew: skipped, as moto or faketime is not installed or the program has no object stores")
        return
    proxy = Proxy(moto.port, "clock")
    try:
        line = (fleet.plan / "entries.jsonl").read_text().splitlines()[0]
        environment = {**moto.environment(proxy.port), "HQ_ENTRY": line}
        command = ["faketime", "-f", "+2h", PROGRAM, "fleet", "run", fleet.plan, "--out", "s3://plant/skewed"]
        done = subprocess.run(command, env=environment, capture_output=True, text=True)
        if done.returncode != 1 or fleet.told("skew", done.stderr) != 1 or "clock" not in done.stderr or moto.keys("skewed/"):
            sys.exit(f"fleet_check: skew: {done.returncode}: {done.stderr}")
        say(f"skew: a clock two hours ahead: …{done.stderr.strip()[-200:]}")
    finally:
        proxy.stop()
        moto.stop()


FAULTS = {
    "kill": kill,
    "two": two,
    "disk": disk,
    "clock": clock,
    "skew": skew,
    "server": server,
    "errors": through("errors", 0.3, "answered by an error of the server"),
    "slow": through("slow", 0.3, "answered over two seconds"),
    "torn": through("torn", 0.3, "torn before, behind or amid their answer"),
}


def run(names, folder, without, expected, entries, kills, pace_s):
    fleet = Fleet(folder, without, expected, entries, kills, pace_s)
    for name in names:
        FAULTS[name](fleet)
