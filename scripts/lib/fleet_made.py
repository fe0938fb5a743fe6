"""What the fleet's checks share: a fleet of synthetic exports, the program, tables, and servers of objects."""

import datetime
import json
import math
import os
import random
import shutil
import socket
import subprocess
import sys
import tempfile
import time
from pathlib import Path

PROGRAM = os.path.realpath(os.environ["GOVTWIN"])
TOP = Path(__file__).resolve().parents[2]
CORES = os.cpu_count() or 1
SECRET = "not-to-be-seen"
# One thread a worker, so that throughput is told by the number of workers; the same date in all reports.
ENVIRONMENT = {**os.environ, "RAYON_NUM_THREADS": "1", "SOURCE_DATE_EPOCH": "1700000000"}
MAP = """time: {column: t, format: unix_s}
signals:
  spool_position: {column: spool, unit: pu}
  servomotor_position: {column: servomotor, unit: pu}
"""
DURATION_S = 20
RATE_HZ = 10


def govtwin(*arguments, check=(0,), environment=None, **more):
    done = subprocess.run([PROGRAM, *map(str, arguments)], env=environment or ENVIRONMENT, capture_output=True, text=True, **more)
    if check and done.returncode not in check:
        sys.exit(f"fleet_check: govtwin {' '.join(map(str, arguments))} ended with {done.returncode}:\n{done.stdout}{done.stderr}")
    return done


def say(text):
    print(f"fleet_check: {text}", flush=True)


def export(unit, period, grown):
    """A historian's table of one servomotor stage: an integrator with a dead band, and the noise of two transducers."""
    draws = random.Random(1000 * unit + period)
    own = random.Random(unit)
    rise, fall = own.uniform(0.09, 0.11), own.uniform(0.09, 0.11)
    dead_band = 0.05 if grown else 0.01
    phase, position = draws.uniform(0, 2 * math.pi), draws.uniform(0.3, 0.6)
    begin = datetime.datetime(2015 + period // 12, 1 + period % 12, 5, 6, tzinfo=datetime.timezone.utc).timestamp()
    rows = ["t,spool,servomotor"]
    steps = 50
    for i in range(DURATION_S * RATE_HZ):
        for k in range(steps):
            at = (i + k / steps) / RATE_HZ
            spool = 0.5 * math.sin(0.9 * at + phase) + 0.3 * math.sin(2.3 * at)
            if k == 0:
                rows.append(f"{begin + at:.3f},{spool + draws.gauss(0, 5e-4):.5f},{position + draws.gauss(0, 5e-4):.5f}")
            beyond = math.copysign(max(abs(spool) - dead_band, 0), spool)
            position = min(1, max(0, position + (rise if beyond > 0 else fall) * beyond / RATE_HZ / steps))
    return "\n".join(rows) + "\n"


def all_but(effects):
    """What leaves a plan these effects of the catalogue."""
    if not effects:
        return []
    all_effects = [effect["id"] for effect in json.loads(govtwin("effects", "--json").stdout)["effects"]]
    for one in effects:
        if one not in all_effects:
            sys.exit(f"fleet_check: --only {one}: there is no such effect")
    return [word for one in all_effects if one not in effects for word in ("--without", one)]


def make(folder, units, periods, without):
    """Exports of units over months and their table; from half-time on the dead band of every third unit is wider. Says how many entries the plan has."""
    for unit in range(units):
        for period in range(periods):
            path = folder / "source" / f"unit_{unit:03}" / f"{period:03}.csv"
            if path.exists():
                continue
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(export(unit, period, unit % 3 == 0 and period >= periods // 2))
    (folder / "stage.yaml").write_text(MAP)
    (folder / "units.csv").write_text("unit,map\n" + "".join(f"unit_{unit:03},stage.yaml\n" for unit in range(units)))
    govtwin("fleet", "plan", folder / "source", "--units", folder / "units.csv", "--out", folder / "plan", *without, check=(0, 3))
    return len(lines(folder / "plan"))


def lines(plan):
    return (plan / "entries.jsonl").read_text().splitlines()


def gather(store, plan, out, environment=None):
    """The table of a store, and its figures; nothing may be lost or double in it."""
    done = govtwin("fleet", "gather", store, "--plan", plan, "--out", out, "--json", check=(0, 3), environment=environment)
    figures = json.loads(done.stdout)
    if figures["missing"] or figures["damaged"] or figures["superseded"]:
        sys.exit(f"fleet_check: {store}: missing {figures['missing']}, damaged {figures['damaged']}, superseded {figures['superseded']}")
    return (out / "fleet.csv").read_bytes(), figures


def xargs(entries, workers, plan, store, environment=None, twice=False, check=True):
    """Every entry by its index, by so many workers; twice where each is to have two of them at once."""
    doubled = "sed p | " if twice else ""
    command = f"seq 0 {entries - 1} | {doubled}xargs -P {workers} -I I '{PROGRAM}' fleet run '{plan}' --index I --out '{store}'"
    done = subprocess.run(["bash", "-c", command], env=environment or ENVIRONMENT, capture_output=True, text=True)
    if check and done.returncode:
        sys.exit(f"fleet_check: xargs ended with {done.returncode}:\n{done.stderr[-2000:]}")
    return done


def free_port():
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        return one.getsockname()[1]


def wait_for(port):
    """Until something listens there."""
    for _ in range(300):
        try:
            return socket.create_connection(("127.0.0.1", port), 1).close()
        except OSError:
            time.sleep(0.1)
    sys.exit("fleet_check: a server does not listen")


class Server:
    """A local server of objects in a process of its own, with the bucket `plant`."""

    def put_recordings(self, folder, port=None):
        for path in sorted((folder / "source").rglob("*")):
            if path.is_file():
                self.put(f"source/{path.relative_to(folder / 'source')}", path, port)

    def plan(self, folder, without, port=None):
        """Recordings and plan into the server; through a proxy where a port is given."""
        self.put_recordings(folder, port)
        govtwin("fleet", "plan", f"{self.address}/source", "--units", folder / "units.csv", "--out", f"{self.address}/plan", *without, check=(0, 3), environment=self.environment(port))

    def endpoint(self, port=None):
        return f"http://127.0.0.1:{port or self.port}"

    def kill(self):
        self.process.kill()
        self.process.wait()

    def stop(self):
        self.process.terminate()
        self.process.wait()


class S3(Server):
    """PyPI's moto, which speaks S3."""

    address = "s3://plant"
    secret = SECRET

    def __init__(self):
        import boto3

        self.port = free_port()
        self.connect = lambda port: boto3.client("s3", endpoint_url=self.endpoint(port), aws_access_key_id="key", aws_secret_access_key=SECRET, region_name="us-east-1")
        self.client = self.connect(self.port)
        self.start()

    def start(self):
        """A server with an empty bucket."""
        command = [sys.executable, "-m", "moto.server", "-H", "127.0.0.1", "-p", str(self.port)]
        self.process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        wait_for(self.port)
        self.client.create_bucket(Bucket="plant")

    def environment(self, port=None):
        """What a worker needs to know of it; through a proxy where a port is given."""
        return {**ENVIRONMENT, "AWS_ENDPOINT": self.endpoint(port), "AWS_ALLOW_HTTP": "true", "AWS_ACCESS_KEY_ID": "key",
                "AWS_SECRET_ACCESS_KEY": SECRET, "AWS_REGION": "us-east-1"}

    def put(self, key, path, port=None):
        self.connect(port).upload_file(str(path), "plant", key)

    def keys(self, prefix):
        pages = self.client.get_paginator("list_objects_v2").paginate(Bucket="plant", Prefix=prefix)
        return [one["Key"] for page in pages for one in page.get("Contents", [])]

    def content(self, key):
        return self.client.get_object(Bucket="plant", Key=key)["Body"].read()


class Azure(Server):
    """Microsoft's own server for tests, npm's azurite, which speaks Azure Blob Storage."""

    address = "az://plant"
    account = "devstoreaccount1"
    # The account and key of every azurite.
    secret = "Eby8vdM02xNOcqFlqUwJPLlmEtlCDXJ1OUzFT50uSRZ6IFsuFq2UVErCz4I6tq/K1SZFPTOtr/KBHBeksoGMGw=="

    def __init__(self):
        from azure.storage.blob import ContainerClient

        self.port = free_port()
        self.folder = tempfile.mkdtemp()
        command = ["azurite-blob", "--silent", "--skipApiVersionCheck", "--location", self.folder, "--blobPort", str(self.port)]
        self.process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        wait_for(self.port)
        account_url = f"{self.endpoint()}/{self.account}"
        self.client = ContainerClient(account_url, "plant", {"account_name": self.account, "account_key": self.secret})
        self.client.create_container()

    def environment(self, port=None):
        return {**ENVIRONMENT, "AZURE_STORAGE_USE_EMULATOR": "true", "AZURITE_BLOB_STORAGE_URL": self.endpoint(port)}

    def put(self, key, path, port=None):
        self.client.upload_blob(key, path.read_bytes())

    def keys(self, prefix):
        return [one.name for one in self.client.list_blobs(prefix)]

    def content(self, key):
        return self.client.download_blob(key).readall()

    def stop(self):
        super().stop()
        shutil.rmtree(self.folder)


def has_object_stores():
    return "not in this build" not in govtwin("fleet", "gather", "s3://x/y", check=None).stderr


def s3():
    """A server, or none where moto is not installed or the program was built without object stores."""
    try:
        import boto3  # noqa: F401
        import moto.server  # noqa: F401
    except ImportError:
        return None
    return S3() if has_object_stores() else None


def azure():
    """The same of Azure; none where azurite or PyPI's azure-storage-blob is not installed."""
    try:
        import azure.storage.blob  # noqa: F401
    except ImportError:
        return None
    return Azure() if shutil.which("azurite-blob") and has_object_stores() else None


# Servers by what stands before an engine's name.
SERVERS = {"s3": s3, "az": azure}
