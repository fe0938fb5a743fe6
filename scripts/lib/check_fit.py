"""Compares a fit by govtwin with scipy's least_squares on the residuals that govtwin serves."""

import json
import subprocess
import sys

import numpy as np
from scipy.optimize import least_squares

# Half widths of central differences, in turn, each from where the one before ended: small jumps hide the way down from some of them.
STEPS = (0.1, 0.05, 0.02, 0.01)

# What may be apart: in cost, where 1 is one standard deviation, and in each free parameter's standard deviations.
most_cost, most_apart = map(float, sys.argv[1:3])
served = subprocess.Popen(sys.argv[3:], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
ours = json.loads(served.stdout.readline())
low, high = np.array(ours["ranges"]).T
asked = 0


def residuals(positions):
    global asked
    asked += 1
    served.stdin.write(json.dumps(list(map(float, positions))) + "\n")
    served.stdin.flush()
    return np.array(json.loads(served.stdout.readline()))


def slopes(positions, width):
    columns = []
    for k in range(len(positions)):
        ends = []
        for step in (-width, width):
            moved = np.array(positions)
            moved[k] = np.clip(moved[k] + step, low[k], high[k])
            ends.append((moved[k], residuals(moved)))
        columns.append((ends[1][1] - ends[0][1]) / (ends[1][0] - ends[0][0]))
    return np.stack(columns, axis=1)


own = np.array(ours["positions"])
own_cost = float(np.sum(residuals(own) ** 2))
assert abs(own_cost - ours["cost"]) < 1e-6 * ours["cost"], (own_cost, ours["cost"])

# An independent start: the sheet, effects at their typical size.
start = np.array([1.0 if "." in key and key.split(".")[0] == "backlash" else 0.0 for key in ours["keys"]])
for width in STEPS:
    start = np.clip(start, low + 1e-6, high - 1e-6)
    found = least_squares(
        residuals, start, jac=lambda x: slopes(x, width), bounds=(low, high), xtol=1e-8, ftol=1e-10, max_nfev=40
    )
    start = found.x
served.stdin.close()
served.wait()

apart = np.abs(own - found.x) / np.array(ours["deviations"])
worst = int(np.argmax(apart))
cost = 2.0 * found.cost
print(f"check_fit: {len(own)} free parameters, {len(found.fun)} residuals, {asked} simulations asked by scipy ({found.message})")
print(f"check_fit: sum of squares {own_cost:.4f} by govtwin, {cost:.4f} by scipy, difference {own_cost - cost:+.4f}")
print(f"check_fit: farthest apart is {ours['keys'][worst]}: {apart[worst]:.3f} of its standard deviation; RMS {np.sqrt(np.mean(apart**2)):.3f}")
limits = f"{most_cost} of cost and {most_apart} standard deviations"
if own_cost - cost > most_cost or apart[worst] > most_apart:
    sys.exit(f"check_fit: FAILED: they do not agree within {limits}")
print(f"check_fit: ok: they agree within {limits}")
