"""One plan on several engines and under faults: the tables must be those of a single process, byte for byte."""

import argparse
import shutil
import tempfile
from pathlib import Path

import fleet_engines
import fleet_faults
from fleet_made import CORES, SERVERS, all_but, make, say


def main():
    faults = fleet_faults.FAULTS
    parser = argparse.ArgumentParser(prog="fleet_check")
    parser.add_argument("--units", type=int, default=10)
    parser.add_argument("--periods", type=int, default=4)
    parser.add_argument("--kills", type=int, default=100)
    parser.add_argument("--only", action="append", metavar="EFFECT", help="tries these effects alone, which is faster")
    parser.add_argument("--keep", type=Path, help="folder for recordings and stores; kept")
    choices = [*fleet_engines.ENGINES, *(f"{kind}-{name}" for kind in SERVERS for name in fleet_engines.ENGINES), "engines", *faults, "faults"]
    parser.add_argument("what", nargs="*", metavar="WHAT", help=", ".join(choices))
    arguments = parser.parse_args()
    for one in arguments.what:
        if one not in choices:
            parser.error(f"{one}: expected one of {', '.join(choices)}")
    what = arguments.what or ["engines", "faults"]
    if "engines" in what:
        what += ["xargs-1", "xargs", "parallel", "hyperqueue", "hq", "hq-json", "slurm", "kubernetes", "s3-xargs", "s3-hyperqueue", "s3-slurm", "az-xargs", "az-xargs-twice", "az-hyperqueue"]
    if "faults" in what:
        what += faults
    folder = (arguments.keep or Path(tempfile.mkdtemp())).resolve()
    folder.mkdir(parents=True, exist_ok=True)
    without = all_but(arguments.only)
    entries = make(folder, arguments.units, arguments.periods, without)
    tried = ", ".join(arguments.only or ["the whole catalogue"])
    say(f"{entries} entries of {arguments.units} units, {tried}, on {CORES} cores; all recordings are synthetic")
    expected, pace_s = fleet_engines.whole(folder, entries)
    fleet_engines.overhead(folder, entries)
    for name in fleet_engines.ENGINES:
        if name in what:
            fleet_engines.in_folder(name, folder, expected, entries)
    for kind in SERVERS:
        stored = [name for name in fleet_engines.ENGINES if f"{kind}-{name}" in what]
        if stored:
            fleet_engines.in_server(kind, stored, folder, without, expected, entries)
    chosen = [name for name in faults if name in what]
    if chosen:
        fleet_faults.run(chosen, folder, without, expected, entries, arguments.kills, pace_s)
    if not arguments.keep:
        shutil.rmtree(folder)


main()
