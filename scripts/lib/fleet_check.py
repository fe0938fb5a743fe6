"""One plan on several engines and under faults: the tables must be those of a single process, byte for byte."""

import argparse
import json
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

PROGRAM = os.path.realpath(os.environ["GOVTWIN"])
TOP = Path(__file__).resolve().parents[2]
ENGINES = ["xargs", "parallel", "hyperqueue", "slurm", "s3", "kill"]
CORES = os.cpu_count() or 1
# One thread a worker, so that throughput is told by the number of workers; the same date in all reports.
ENVIRONMENT = {**os.environ, "RAYON_NUM_THREADS": "1", "SOURCE_DATE_EPOCH": "1700000000"}
# What is tried beside refitting: all other effects are left out, so that an entry takes seconds.
EFFECTS = {"backlash", "feedback_bias"}


def govtwin(*arguments, check=(0,), **more):
    done = subprocess.run([PROGRAM, *map(str, arguments)], env=ENVIRONMENT, capture_output=True, text=True, **more)
    if check and done.returncode not in check:
        sys.exit(f"fleet_check: govtwin {' '.join(map(str, arguments))} ended with {done.returncode}:\n{done.stderr}")
    return done


def say(text):
    print(f"fleet_check: {text}", flush=True)


def make(folder, units, periods):
    """Recordings of units over months, each month a start-up of 30 s at 20 Hz; the play of every third unit grows from half-time on."""
    for unit in range(units):
        for period in range(periods):
            to = folder / "source" / f"unit_{unit:03}" / f"{period:03}"
            if to.is_dir():
                continue
            grown = unit % 3 == 0 and period >= periods // 2
            start = f"{2015 + period // 12}-{1 + period % 12:02}-05T06:00:00Z"
            govtwin("generate", "--process", "startup", "--rate", 20, "--duration", 30, "--spread", "off", "--seed", 1000 * unit + period,
                    "--effect", f"backlash={0.02 if grown else 0.004}", "--start", start, "--out", to)
    effects = json.loads(govtwin("effects", "--json").stdout)["effects"]
    without = " ".join(one["id"] for one in effects if one["id"] not in EFFECTS)
    rows = "".join(f"unit_{unit:03},{without}\n" for unit in range(units))
    (folder / "units.csv").write_text("unit,without\n" + rows)
    govtwin("fleet", "plan", folder / "source", "--units", folder / "units.csv", "--out", folder / "plan", check=(0, 3))
    return len((folder / "plan/entries.jsonl").read_text().splitlines())


def table(folder, store):
    """The table of a store, and that nothing is lost or double in it."""
    done = govtwin("fleet", "gather", store, "--plan", folder / "plan", "--out", folder / "gathered" / Path(str(store)).name, "--json", check=(0, 3))
    figures = json.loads(done.stdout)
    if figures["missing"] or figures["damaged"] or figures["superseded"]:
        sys.exit(f"fleet_check: {store}: missing {figures['missing']}, damaged {figures['damaged']}, superseded {figures['superseded']}")
    return (folder / "gathered" / Path(str(store)).name / "fleet.csv").read_bytes(), figures


def whole(folder):
    store = folder / "whole"
    govtwin("fleet", "run", folder / "plan", "--out", store)
    return store


def xargs(folder, entries, workers):
    store = folder / f"xargs_{workers}"
    command = f"seq 0 {entries - 1} | xargs -P {workers} -I I '{PROGRAM}' fleet run '{folder}/plan' --index I --out '{store}'"
    subprocess.run(["bash", "-c", command], env=ENVIRONMENT, check=True, capture_output=True)
    return store


def parallel(folder, entries):
    if not shutil.which("parallel"):
        return None
    store = folder / "parallel"
    command = f"seq 0 {entries - 1} | parallel -j {CORES} '{PROGRAM}' fleet run '{folder}/plan' --index {{}} --out '{store}'"
    subprocess.run(["bash", "-c", command], env=ENVIRONMENT, check=True, capture_output=True)
    return store


def hyperqueue(folder, _entries):
    try:
        from hyperqueue import Job, LocalCluster
        from hyperqueue.cluster import WorkerConfig
    except ImportError:
        return None
    store = folder / "hyperqueue"
    job = Job()
    for line in (folder / "plan/entries.jsonl").read_text().splitlines():
        # What `hq submit --each-line entries.jsonl` does: a task for each line, which is told it by HQ_ENTRY.
        environment = {"HQ_ENTRY": line, "RAYON_NUM_THREADS": "1", "SOURCE_DATE_EPOCH": "1700000000"}
        job.program([PROGRAM, "fleet", "run", str(folder / "plan"), "--out", str(store)], env=environment, stdout=None, stderr=None)
    with LocalCluster(worker_config=WorkerConfig(cores=CORES)) as cluster:
        client = cluster.client()
        client.wait_for_jobs([client.submit(job)])
    return store


def slurm(folder, _entries):
    store = folder / "slurm"
    environment = {**ENVIRONMENT, "GOVTWIN": PROGRAM}
    done = subprocess.run([TOP / "scripts/fleet_slurm", folder / "plan", store], env=environment, capture_output=True, text=True)
    if done.returncode == 77:
        return None
    if done.returncode:
        sys.exit(f"fleet_check: slurm: {done.stderr}")
    return store


def s3(folder, entries):
    """Source, plan and store in a server that speaks S3, every entry by two workers at once; then the server is gone. No secret may be seen."""
    try:
        import boto3
        from moto.server import ThreadedMotoServer
    except ImportError:
        return None
    if "not in this build" in govtwin("fleet", "gather", "s3://x/y", check=None).stderr:
        return None
    server = ThreadedMotoServer(port=0)
    server.start()
    host, port = server.get_host_and_port()
    endpoint = f"http://127.0.0.1:{port}"
    ENVIRONMENT.update(AWS_ENDPOINT=endpoint, AWS_ALLOW_HTTP="true", AWS_ACCESS_KEY_ID="key", AWS_SECRET_ACCESS_KEY="not-to-be-seen", AWS_REGION="us-east-1")
    client = boto3.client("s3", endpoint_url=endpoint, aws_access_key_id="key", aws_secret_access_key="not-to-be-seen", region_name="us-east-1")
    client.create_bucket(Bucket="plant")
    for path in sorted((folder / "source").rglob("*")):
        if path.is_file():
            client.upload_file(str(path), "plant", f"source/{path.relative_to(folder / 'source')}")
    govtwin("fleet", "plan", "s3://plant/source", "--units", folder / "units.csv", "--out", "s3://plant/store", check=(0, 3))
    # Every entry twice, by two workers at once.
    command = f"seq 0 {entries - 1} | sed p | xargs -P {2 * CORES} -I I '{PROGRAM}' fleet run s3://plant/store --index I --out s3://plant/store"
    done = subprocess.run(["bash", "-c", command], env=ENVIRONMENT, check=True, capture_output=True, text=True)
    if "not-to-be-seen" in done.stdout + done.stderr:
        sys.exit("fleet_check: s3: a secret is in the log")
    figures = json.loads(govtwin("fleet", "gather", "s3://plant/store", "--out", folder / "gathered/s3", "--json", check=(0, 3)).stdout)
    keys = [one["Key"] for page in client.get_paginator("list_objects_v2").paginate(Bucket="plant", Prefix="store/") for one in page["Contents"]]
    for key in keys:
        if key.endswith((".json", ".jsonl", ".csv", ".txt")) and b"not-to-be-seen" in client.get_object(Bucket="plant", Key=key)["Body"].read():
            sys.exit(f"fleet_check: s3: a secret is in {key}")
    server.stop()
    refused = govtwin("fleet", "run", "s3://plant/store", "--index", 0, "--out", "s3://plant/store", check=(1,), timeout=900).stderr
    say(f"s3: {len(keys)} objects, {figures['done']} diagnosed, none missing; a server that is gone: {refused.strip()[:160]}")
    return (folder / "gathered/s3/fleet.csv").read_bytes()


def kill(folder, entries, kills):
    """Workers that are killed at random: as often as asked for, each entry by two of them at once."""
    store = folder / "kill"
    draws = random.Random(1)
    killed = 0
    results = lambda: len(list((store / "results").glob("*.json"))) if (store / "results").is_dir() else 0
    start = time.monotonic()
    while killed < kills:
        if results() == entries:
            # All are done before the kills are: begin again with half of them.
            for path in sorted((store / "results").glob("*.json"))[: entries // 2 + 1]:
                path.unlink()
        index = str(draws.randrange(entries))
        pair = [subprocess.Popen([PROGRAM, "fleet", "run", folder / "plan", "--index", index, "--out", store], env=ENVIRONMENT,
                                 stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) for _ in range(2)]
        time.sleep(draws.uniform(0.0, 1.5))
        for worker in pair:
            if worker.poll() is None:
                worker.send_signal(signal.SIGKILL)
                killed += 1
            worker.wait()
    for path in (store / "results").glob("*.json"):
        json.loads(path.read_text())
    left = results()
    govtwin("fleet", "run", folder / "plan", "--out", store)
    say(f"kill: {killed} workers killed in {time.monotonic() - start:.0f} s, {left} results whole before the last run, all after it")
    return store


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--units", type=int, default=10)
    parser.add_argument("--periods", type=int, default=4)
    parser.add_argument("--kills", type=int, default=100)
    parser.add_argument("--keep", type=Path, help="folder for recordings and stores; kept")
    parser.add_argument("engines", nargs="*", choices=[*ENGINES, []])
    arguments = parser.parse_args()
    engines = arguments.engines or ENGINES
    folder = (arguments.keep or Path(tempfile.mkdtemp())).resolve()
    folder.mkdir(parents=True, exist_ok=True)
    entries = make(folder, arguments.units, arguments.periods)
    say(f"{entries} entries of {arguments.units} units, on {CORES} cores; all recordings are synthetic")
    start = time.monotonic()
    expected, figures = table(folder, whole(folder))
    single = time.monotonic() - start
    work = figures["work"]
    say(f"one process: {single:.0f} s, {work['processor_s'] / entries:.2f} s of a core an entry, at most {work['peak_memory_bytes'] / 1e6:.0f} MB")
    say(f"sizes beyond their intervals: {len(figures['standing']['changed'])}")
    # With every result there, an entry costs what there is beside the diagnosis.
    start = time.monotonic()
    for index in range(min(entries, 50)):
        govtwin("fleet", "run", folder / "plan", "--index", index, "--out", folder / "whole")
    say(f"overhead: {1000 * (time.monotonic() - start) / min(entries, 50):.0f} ms an entry whose result is there, a process each")
    runs = {"parallel": parallel, "hyperqueue": hyperqueue, "slurm": slurm}
    for engine in engines:
        if engine == "xargs":
            for workers in sorted({1, CORES}):
                start = time.monotonic()
                store = xargs(folder, entries, workers)
                seconds = time.monotonic() - start
                compare(f"xargs -P {workers}", expected, table(folder, store), entries, seconds)
        elif engine == "kill":
            compare("kill", expected, table(folder, kill(folder, entries, arguments.kills)), entries, None)
        elif engine == "s3":
            start = time.monotonic()
            got = s3(folder, entries)
            skip("s3") if got is None else compare("s3", expected, (got, None), entries, time.monotonic() - start)
        else:
            start = time.monotonic()
            store = runs[engine](folder, entries)
            seconds = time.monotonic() - start
            skip(engine) if store is None else compare(engine, expected, table(folder, store), entries, seconds)
    if not arguments.keep:
        shutil.rmtree(folder)


def skip(engine):
    say(f"{engine}: skipped, as it is not installed or not in this build")


def compare(name, expected, got, entries, seconds):
    got, figures = got
    if got != expected:
        sys.exit(f"fleet_check: {name}: the table is not that of a single process")
    pace = f", {entries / seconds:.2f} entries/s" if seconds else ""
    peak = f", at most {figures['work']['peak_memory_bytes'] / 1e6:.0f} MB a worker" if figures else ""
    say(f"{name}: the table is the same to the last byte{pace}{peak}")


main()
