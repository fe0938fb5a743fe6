"""One plan on several engines, in folders and in servers of objects: the tables must be those of a single process, byte for byte."""

import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from fleet_made import CORES, ENVIRONMENT, PROGRAM, SERVERS, TOP, govtwin, gather, lines, say, xargs


# Entries of which the cost of an engine alone is measured: their results are there already.
OVERHEAD = 200


def by_xargs(folder, plan, store, environment):
    xargs(len(lines(folder / "plan")), CORES, plan, store, environment)
    return True


def by_one_job_of_xargs(folder, plan, store, environment):
    xargs(len(lines(folder / "plan")), 1, plan, store, environment)
    return True


def by_two_at_each(folder, plan, store, environment):
    """Two workers at each entry at once: one result of each may stand."""
    xargs(len(lines(folder / "plan")), 2 * CORES, plan, store, environment, twice=True)
    return True


def by_parallel(folder, plan, store, environment):
    if not shutil.which("parallel"):
        return False
    command = f"seq 0 {len(lines(folder / 'plan')) - 1} | parallel -j {CORES} '{PROGRAM}' fleet run '{plan}' --index {{}} --out '{store}'"
    subprocess.run(["bash", "-c", command], env=environment, check=True, capture_output=True)
    return True


def by_hyperqueue(folder, plan, store, environment):
    try:
        from hyperqueue import Job, LocalCluster
        from hyperqueue.cluster import WorkerConfig
    except ImportError:
        return False
    listed = lines(folder / "plan")
    job = Job()
    for line in listed:
        # What `hq submit --each-line entries.jsonl` does: a task for each line, which is told it by HQ_ENTRY.
        handed = {name: value for name, value in environment.items() if name.startswith(("AWS_", "AZUR", "RAYON_", "SOURCE_"))}
        job.program([PROGRAM, "fleet", "run", str(plan), "--out", str(store)], env={**handed, "HQ_ENTRY": line}, stdout=None, stderr=None)
    with LocalCluster(worker_config=WorkerConfig(cores=CORES)) as cluster:
        client = cluster.client()
        client.wait_for_jobs([client.submit(job)])
    return True


def by_hq(hand_over):
    """By the command line of `hq`, as docs/fleet.md has it: a server, a worker and a submission; `hand_over` gives what tells tasks their lines."""

    def do(folder, plan, store, environment):
        if not shutil.which("hq"):
            return False
        with tempfile.TemporaryDirectory() as run:
            environment = {**environment, "HQ_SERVER_DIR": run}
            listed = f"{run}/entries.jsonl"
            Path(listed).write_text("".join(line + "\n" for line in lines(folder / "plan")))
            quiet = {"env": environment, "stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
            server = subprocess.Popen(["hq", "server", "start"], **quiet)
            worker = subprocess.Popen(["hq", "worker", "start", "--cpus", str(CORES)], **quiet)
            try:
                for _ in range(100):
                    if subprocess.run(["hq", "server", "info"], **quiet).returncode == 0:
                        break
                    time.sleep(0.1)
                if worker.poll() is not None:
                    worker = subprocess.Popen(["hq", "worker", "start", "--cpus", str(CORES)], **quiet)
                task = ["--cpus", "1", "--env", "RAYON_NUM_THREADS=1", "--crash-limit", "5", "--stdout", "none", "--stderr", "none", "--", PROGRAM, "fleet", "run", str(plan), "--out", str(store)]
                done = subprocess.run(["hq", "submit", "--wait", *hand_over(listed), *task], env=environment, capture_output=True, text=True)
                if done.returncode:
                    sys.exit(f"fleet_check: hq: {done.stdout}{done.stderr}")
            finally:
                subprocess.run(["hq", "server", "stop"], **quiet)
                for process in (worker, server):
                    process.terminate()
                    process.wait()
        return True

    return do


def each_line(listed):
    return ["--each-line", listed]


def from_json(listed):
    # jq -s . entries.jsonl
    array = Path(listed).with_suffix(".json")
    array.write_text("[" + ",".join(Path(listed).read_text().splitlines()) + "]")
    return ["--from-json", array]


def by_manifest(folder, plan, store, environment):
    """What pods of packaging/fleet-job.yaml would do: its command, by its variables, once for each index. No cluster is asked; the manifest is held against its schema."""
    try:
        import kubernetes_validate
        import yaml
    except ImportError:
        return False
    manifest = yaml.safe_load((TOP / "packaging/fleet-job.yaml").read_text())
    kubernetes_validate.validate(manifest, kubernetes_validate.latest_version(), strict=True)
    container = manifest["spec"]["template"]["spec"]["containers"][0]
    *head, planned, out, stored = container["args"]
    if (head, out) != (["fleet", "run"], "--out") or planned != stored:
        sys.exit(f"fleet_check: packaging/fleet-job.yaml: {container['args']}")
    variables = {one["name"]: one["value"] for one in container["env"]}
    command = f"seq 0 {len(lines(folder / 'plan')) - 1} | xargs -P {CORES} -I I env JOB_COMPLETION_INDEX=I '{PROGRAM}' {' '.join(head)} '{plan}' {out} '{store}'"
    done = subprocess.run(["bash", "-c", command], env={**environment, **variables}, capture_output=True, text=True)
    if done.returncode:
        sys.exit(f"fleet_check: kubernetes: {done.stderr[-2000:]}")
    return True


def by_slurm(folder, plan, store, environment):
    environment = {**environment, "GOVTWIN": PROGRAM}
    command = [TOP / "scripts/fleet_slurm", plan, store, str(len(lines(folder / "plan")))]
    done = subprocess.run(command, env=environment, capture_output=True, text=True)
    if done.returncode == 77:
        return False
    if done.returncode:
        sys.exit(f"fleet_check: slurm: {done.stdout}{done.stderr}")
    return True


ENGINES = {"xargs": by_xargs, "xargs-1": by_one_job_of_xargs, "xargs-twice": by_two_at_each, "parallel": by_parallel, "hyperqueue": by_hyperqueue, "hq": by_hq(each_line), "hq-json": by_hq(from_json),
           "slurm": by_slurm, "kubernetes": by_manifest}


def whole(folder, entries):
    """What every engine is held against: the table of a single process, which does one entry after the other; and how long it took for one, s."""
    store, out = folder / "whole", folder / "gathered/whole"
    start = time.monotonic()
    govtwin("fleet", "run", folder / "plan", "--out", store)
    seconds = time.monotonic() - start
    expected, figures = gather(store, folder / "plan", out)
    work = figures["work"]
    say(f"one process: {seconds:.0f} s, {entries / seconds:.2f} entries/s; {work['processor_s'] / entries:.3f} s of a core an entry, at most {work['peak_memory_bytes'] / 1e6:.0f} MB; "
        f"{figures['done']} diagnosed, {figures['failed']} failed, {len(figures['standing']['changed'])} sizes beyond their intervals")
    return expected, seconds / entries


def compare(name, expected, got, entries, seconds):
    table, figures = got
    if table != expected:
        sys.exit(f"fleet_check: {name}: the table is not that of a single process")
    pace = f", {seconds:.0f} s, {entries / seconds:.2f} entries/s" if seconds else ""
    work = figures["work"]
    say(f"{name}: the table is the same to the last byte{pace}, {work['processor_s'] / entries:.3f} s of a core an entry, at most {work['peak_memory_bytes'] / 1e6:.0f} MB a worker")


def in_folder(name, folder, expected, entries):
    store = folder / name
    start = time.monotonic()
    if not ENGINES[name](folder, folder / "plan", store, ENVIRONMENT):
        say(f"{name}: skipped, as it is not installed")
        return
    seconds = time.monotonic() - start
    compare(name, expected, gather(store, folder / "plan", folder / f"gathered/{name}"), entries, seconds)


def overhead(folder, entries):
    """What an entry costs beside its diagnosis: its result is there already."""
    count = min(entries, OVERHEAD)
    start = time.monotonic()
    for index in range(count):
        govtwin("fleet", "run", folder / "plan", "--index", index, "--out", folder / "whole")
    say(f"overhead: {1000 * (time.monotonic() - start) / count:.0f} ms an entry whose result is there, a process each")


def in_server(kind, names, folder, without, expected, entries):
    """Source, plan and stores in a server of objects. No secret may be seen in any object or line."""
    server = SERVERS[kind]()
    if server is None:
        say(f"{kind}: skipped, as its server is not installed or the program has no object stores")
        return
    try:
        start = time.monotonic()
        server.plan(folder, without)
        say(f"{kind}: {entries} exports put there and planned in {time.monotonic() - start:.0f} s")
        # What engines read of the plan: its lines.
        copy = folder / kind
        (copy / "plan").mkdir(parents=True, exist_ok=True)
        (copy / "plan/entries.jsonl").write_bytes(server.content("plan/entries.jsonl"))
        for name in names:
            store = f"{server.address}/{name}"
            start = time.monotonic()
            if not ENGINES[name](copy, f"{server.address}/plan", store, server.environment()):
                say(f"{kind}, {name}: skipped, as it is not installed")
                continue
            seconds = time.monotonic() - start
            got = gather(store, f"{server.address}/plan", folder / f"gathered/{kind}_{name}", server.environment())
            compare(f"{kind}, {name}", expected, got, entries, seconds)
            results = server.keys(f"{name}/results/")
            if len(results) != entries:
                sys.exit(f"fleet_check: {kind}, {name}: {len(results)} results of {entries} entries")
            for key in server.keys(f"{name}/"):
                if key.endswith((".json", ".txt")) and server.secret.encode() in server.content(key):
                    sys.exit(f"fleet_check: {kind}: a secret is in {key}")
    finally:
        server.stop()
    refused = govtwin("fleet", "run", f"{server.address}/plan", "--index", 0, "--out", f"{server.address}/gone", check=(1,), environment=server.environment(), timeout=900).stderr
    if server.secret in refused:
        sys.exit(f"fleet_check: {kind}: a secret is in an error")
    say(f"{kind}: a server that is gone: {refused.strip()[:200]}")
