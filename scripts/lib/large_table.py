"""Writes a table as a German historian would and imports it under a pseudo terminal: what it took, and what was shown meanwhile."""

import datetime
import os
import pty
import re
import sys
import time
from pathlib import Path

govtwin, folder, rows = sys.argv[1], Path(sys.argv[2]), int(sys.argv[3])
# Memory must not grow with the table: a hundredth of it beside the whole.
SIZES = [max(rows // 77, 1000), rows]
MAP = """time: {column: Zeit, format: "%d.%m.%Y %H:%M:%S%.f", zone: Europe/Zurich}
file: {separator: ";", decimal: ","}
signals:
  opening_command: {column: Y_soll, unit: "%"}
  esv: {column: Trip, shutdown: [1]}
  tank_pressure: {column: p_tank, unit: bar}
  spool_position: {column: HSV, unit: mm, range: [0, 15]}
  servomotor_position: {column: Y, unit: mm, range: [0, 600]}
"""
BLOCK = 6000


def write(path, rows):
    """Rows at 100 Hz; a block of a minute repeats with its times."""
    start = datetime.datetime(2024, 1, 8)
    block = []
    for k in range(BLOCK):
        phase = k % 2000 / 2000
        opening = 30 + 40 * (2 * phase if phase < 0.5 else 2 - 2 * phase)
        spool = 4.0 if phase < 0.5 else -4.0
        values = (f"{opening:.4f}", "0", f"{63 + 0.2 * phase:.4f}", f"{spool + 0.01 * (k % 7):.4f}", f"{6 * opening + 0.02 * (k % 5):.4f}")
        block.append(";".join(values).replace(".", ","))
    with open(path, "w", encoding="ascii") as file:
        file.write("Zeit;Y_soll;Trip;p_tank;HSV;Y\n")
        for first in range(0, rows, BLOCK):
            minute = (start + datetime.timedelta(seconds=first / 100)).strftime("%d.%m.%Y %H:%M:")
            count = min(BLOCK, rows - first)
            file.write("".join(f"{minute}{k // 100:02d},{k % 100:02d};{block[k]}\n" for k in range(count)))


def imported(table, out):
    """Runs the import; its processor seconds, its most memory in MB, and what it showed."""
    arguments = [govtwin, "import", str(table), "--map", str(folder / "map.yaml"), "--out", str(out)]
    child, terminal = pty.fork()
    if child == 0:
        os.execv(govtwin, arguments)
    shown = b""
    while True:
        try:
            part = os.read(terminal, 65536)
        except OSError:
            break
        if not part:
            break
        shown += part
    _, status, used = os.wait4(child, 0)
    code = os.waitstatus_to_exitcode(status)
    if code not in (0, 3):
        sys.exit(f"error: the import ended with {code}:\n{shown.decode(errors='replace')[-2000:]}")
    return used.ru_utime + used.ru_stime, used.ru_maxrss / 1024, shown.decode(errors="replace")


(folder / "map.yaml").write_text(MAP)
memory = []
for count in SIZES:
    table, out = folder / "table.csv", folder / f"bag_{count}"
    write(table, count)
    begins = time.monotonic()
    seconds, most, shown = imported(table, out)
    shares = sorted({int(share) for share in re.findall(r"(\d+) ?%", shown)})
    steps = len(re.findall(r"\r", shown))
    bag = sum(one.stat().st_size for one in out.rglob("*") if one.is_file()) if out.is_dir() else out.stat().st_size
    print(
        f"{count:,} rows, {table.stat().st_size:,} bytes: {seconds:.1f} s of a core ({time.monotonic() - begins:.1f} s on the clock), {most:.1f} MB at most, "
        f"bag of {bag:,} bytes, {steps} updates of what is shown{f', {shares[0]} to {shares[-1]} %' if shares else ''}",
        flush=True,
    )
    memory.append(most)
    table.unlink()
if memory[1] > 1.5 * memory[0]:
    sys.exit(f"error: memory grows with the table, from {memory[0]:.1f} to {memory[1]:.1f} MB")
