#!/usr/bin/env python3
"""Draws coupled runs: guide vanes, head, speed and power over time.

Usage: picture.py OUT.png LABEL=ROWS.csv...   (needs PyPI `matplotlib`; rows as couple.py --csv writes them)
"""

import csv
import sys

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plot  # noqa: E402

PANELS = (
    ("opening [pu]", ("command_pu", "opening_pu"), 0.0),
    ("head [pu]", ("head_pu",), 1.0),
    ("speed [pu]", ("speed_pu",), 1.0),
    ("power [pu]", ("mechanical_pu", "electrical_pu"), 0.0),
)
COLOURS = ("#1b5e9b", "#c9622a", "#3a7d44")


def main():
    out, runs = sys.argv[1], [argument.split("=", 1) for argument in sys.argv[2:]]
    figure, axes = plot.subplots(len(PANELS), 1, sharex=True, figsize=(8.0, 8.5), constrained_layout=True)
    for (label, path), colour in zip(runs, COLOURS):
        with open(path, newline="") as file:
            rows = list(csv.DictReader(file))
        time_s = [float(row["time_s"]) for row in rows]
        for axis, (title, columns, rest) in zip(axes, PANELS):
            for index, column in enumerate(columns):
                values = [float(row[column]) for row in rows]
                style = "--" if column == "command_pu" else "-" if column != "electrical_pu" else ":"
                name = f"{label}, {column.removesuffix('_pu')}" if len(columns) > 1 else label
                axis.plot(time_s, values, style, color=colour, linewidth=1.2, label=name)
                if len(columns) == 1 and index == 0:
                    at = max(range(len(values)), key=lambda place: values[place])
                    if values[at] > rest + 0.05 and (label, path) == tuple(runs[0]):
                        axis.annotate(f"{100 * (values[at] - rest):+.1f} % at {time_s[at]:.1f} s", (time_s[at], values[at]),
                                      xytext=(12, -4), textcoords="offset points")
            axis.set_ylabel(title)
            axis.grid(alpha=0.3)
    for axis in axes:
        axis.legend(fontsize=7, loc="right")
        axis.set_xlim(-5.0, 60.0)
    axes[0].set_title("Load rejection of 0.95 pu: plant in Python, servo system by govtwin, coupled over DDS")
    axes[-1].set_xlabel("time since the breaker opened [s]")
    figure.savefig(out, dpi=100)


if __name__ == "__main__":
    main()
