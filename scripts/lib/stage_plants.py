"""Generated servomotor stages and position loops, each with what a report on it should say. Times in travels, positions in strokes, until exported."""
import math
import random

import stage_rigs as rigs

# Seconds for a full travel at the fastest: a servo-hydraulic axis, a press, a gate.
TRAVELS_S = (0.05, 5.0, 300.0)
ROWS = 2400
STEPS = 8

# Effects by which the two directions of a stage may differ, and others that look like a law here.
UNEQUAL = {"port_asymmetry", "load", "supply_loss", "return_loss", "port_wear"}
CURVED = {"flow_saturation", "supply_loss", "return_loss"}
LATE = {"valve_lag"}


class Valve:
    """What an operator gives a valve: pauses and movements of random size, away from the ends of the stroke."""

    def __init__(self, rng, row, levels, ends):
        self.rng, self.row, self.levels, self.ends = rng, row, levels, ends
        self.goal = self.now = 0.0
        self.until = 0.0

    def at(self, time, position):
        rng = self.rng
        low, high = self.ends
        if time >= self.until or (self.goal > 0 and position > high) or (self.goal < 0 and position < low):
            up = rng.random() < 0.5
            if position > high - 0.05:
                up = False
            if position < low + 0.05:
                up = True
            size = 1.0 if self.levels else rng.uniform(0.15, 1.0)
            pause = rng.random() < 0.25
            self.goal = 0.0 if pause else (size if up else -size)
            self.until = time + (rng.uniform(0.2, 0.8) if pause else rng.uniform(0.2, 1.2) / size)
        if self.levels:
            self.now = self.goal
        else:
            most = self.row / 0.1
            self.now += max(-most, min(most, self.goal - self.now))
        return self.now


def constant(lag, step):
    """Time constant of what settles by `step / lag` of its way in each step."""
    return -step / math.log(1 - step / lag)


def dead(u, half):
    return math.copysign(max(abs(u) - half, 0.0), u)


def stage(rng, law):
    """A valve signal and a position behind it."""
    per_travel = rng.uniform(25, 70)
    row = 1.0 / per_travel
    held = rng.random() < 0.5 or law == "two-level valve"
    half = rng.uniform(0.02, 0.12) if law in ("dead zone", "end stops", "second-order valve", "two-level valve") else rng.uniform(0.0, 0.02)
    ratio = rng.uniform(1.3, 2.5) if law in ("two gains", "two-level valve") else 1.0
    lag = rng.uniform(0.08, 0.25) if law in ("valve lag",) else 0.0
    omega, damping = rng.uniform(12, 30), rng.uniform(0.5, 1.0)
    delay = rng.uniform(0.05, 0.12) if law == "two-level valve" else 0.0
    knee = rng.uniform(0.35, 0.6)
    load = rng.uniform(0.3, 0.6)
    play = rng.uniform(0.01, 0.03) if law == "backlash" else 0.0
    gain = 1.0 / (1.0 - half) if law != "saturation" else 1.0
    gains = (gain, gain / ratio)
    if rng.random() < 0.5:
        gains = gains[::-1]
    valve = Valve(rng, row, law == "two-level valve", (-1.0, 2.0) if law == "end stops" else (0.25, 0.75))
    x = 0.5
    at, spool, speed, late = x, 0.0, 0.0, [0.0] * round(delay / row * STEPS)
    rows = []
    now = valve.at(0.0, at)
    for k in range(ROWS):
        rows.append((k * row, now, at))
        coming = valve.at((k + 1) * row, at)
        for step in range(STEPS):
            h = row / STEPS
            # Held from row to row, as a digital controller's output is, or straight to the next.
            late.append(now if held else now + (coming - now) * (step + 0.5) / STEPS)
            asked = late.pop(0)
            if law == "second-order valve":
                speed += h * (omega * omega * (asked - spool) - 2 * damping * omega * speed)
                spool += h * speed
            elif lag > 0:
                spool += h * (asked - spool) / lag
            else:
                spool = asked
            flow = dead(spool, half)
            if law == "saturation":
                flow = max(-knee, min(knee, flow)) / knee
            v = flow * (gains[0] if flow > 0 else gains[1])
            if law == "load on position":
                # A load that helps one way, and more of it the farther out.
                push = load * (2 * x - 0.2)
                v *= math.sqrt(max(0.05, 1 - math.copysign(1, flow) * push))
            x += h * v
            x = max(0.0, min(1.0, x))
            at = max(min(at, x + play), x - play)
        now = coming
    rows = [(t, u if law == "two-level valve" else u + rng.gauss(0, 0.001), x) for t, u, x in rows]
    u_most, u_least = max(u for _, u, _ in rows), min(u for _, u, _ in rows)

    def v_of(u):
        flow = dead(u, half)
        if law == "saturation":
            flow = max(-knee, min(knee, flow)) / knee
        return flow * (gains[0] if flow > 0 else gains[1])

    truth = {"rising_speed": v_of(u_most), "falling_speed": v_of(u_least)}
    if law == "load on position":
        truth = {}
    if law not in ("two-level valve",):
        truth |= {"spool_zero": 0.0, "dead_band": 2 * half, "rises_from": half, "falls_from": -half}
    if law == "valve lag":
        truth["lag_s"] = constant(lag, row / STEPS)
    elif law == "second-order valve":
        truth["lag_s"] = 2 * damping / omega
    elif law == "two-level valve":
        truth["lag_s"] = len(late) * row / STEPS
    return rows, truth


def loop(rng, law):
    """A command and the position of a closed loop."""
    per_travel = rng.uniform(25, 70)
    row = 1.0 / per_travel
    up, down = 1.0, rng.uniform(0.6, 1.0)
    if rng.random() < 0.5:
        up, down = down, up
    kp = rng.uniform(4, 12)
    ki = kp * rng.uniform(0.5, 2.0) if law == "PI loop" else 0.0
    delay = rng.uniform(0.03, 0.12)
    play = rng.uniform(0.008, 0.025) if law == "loop with backlash" else 0.0
    band = rng.uniform(0.01, 0.03) if law == "loop with dead band" else 0.0
    gain = rng.choice([1.0, rng.uniform(0.9, 1.1)]) if law != "PI loop" else 1.0
    lag = rng.uniform(0.03, 0.08) if law == "PI loop" else 0.0
    winds_up = law == "PI loop" and rng.random() < 0.5
    command, goal, slope, until = 0.5, 0.5, 0.0, 0.0
    kind = rng.choice(["steps", "ramps"])
    x = at = 0.5
    spool, total = 0.0, 0.0
    late = [0.5] * max(1, round(delay / row * STEPS))
    rows, signals = [], []
    for k in range(ROWS):
        time = k * row
        if time >= until:
            goal = rng.uniform(0.12, 0.88) / gain
            until = time + rng.uniform(0.5, 2.5)
            slope = rng.uniform(0.3, 1.5)
        step = goal - command
        command += step if kind == "steps" else math.copysign(min(abs(step), slope * row), step)
        rows.append((time, command, at))
        signals.append(spool)
        for _ in range(STEPS):
            h = row / STEPS
            late.append(command)
            asked = late.pop(0)
            error = gain * asked - x
            u = dead(error, band) * kp + ki * total
            limited = max(-down, min(up, u))
            if winds_up or u == limited:
                total += h * error
            spool = limited if lag == 0 else spool + h * (limited - spool) / lag
            x += h * spool
            at = max(min(at, x + play), x - play)
    truth = {"gain": gain, "level": 0.0}
    if law in ("position loop", "loop with backlash"):
        truth |= {"lag": constant(1 / kp, row / STEPS), "delay": len(late) * row / STEPS, "rate limit, rising": up, "rate limit, falling": down}
    if ki:
        truth["integral time"] = kp / ki
    if play:
        truth["backlash or dead band, full width"] = 2 * play
    if band:
        truth["backlash or dead band, full width"] = 2 * band
    return rows, truth


def apart(rng, law):
    """A position that the drive says nothing of."""
    rows, _ = stage(rng, "two gains")
    other, _ = stage(rng, "dead zone")
    return [(t, u, x) for (t, _, x), (_, u, _) in zip(rows, other)], {}


STAGES = ["dead zone", "end stops", "two gains", "saturation", "valve lag", "second-order valve", "two-level valve", "load on position", "backlash"]
LOOPS = ["position loop", "PI loop", "loop with backlash", "loop with dead band"]
PLAIN = STAGES + LOOPS + ["not of one unit"]
RIGS = [*rigs.LOOPS, *rigs.STAGES]
STAGES, LOOPS = STAGES + [*rigs.STAGES], LOOPS + [*rigs.LOOPS]


def rig(rng, law):
    """An axis as a machine or test rig has it."""
    return rigs.axis(rng, law, lambda rng, row: Valve(rng, row, False, (0.25, 0.75)), ROWS, STEPS)


def made(place, seed, laws):
    """The plant of some laws at a place: law, time of a travel, columns as exported, and truth in their units."""
    rng = random.Random(seed * 1_000_003 + place)
    law = laws[place % len(laws)]
    travel_s = TRAVELS_S[place // len(laws) % len(TRAVELS_S)]
    maker = rig if law in RIGS else stage if law in STAGES else loop if law in LOOPS else apart
    rows, truth = maker(rng, law)
    # Units of drive and position: name, scale, zero, resolution.
    drive = rng.choice([("V", 10.0, 0.0, 0.005), ("mA", 8.0, 12.0, 0.004), ("%", 100.0, 0.0, 0.05), ("V", -5.0, 0.13, 0.0025), ("counts", 13824.0, 0.0, 1.0)])
    position = rng.choice([("mm", 400.0, 0.0, 0.05), ("mm", -120.0, 150.0, 0.02), ("V", 10.0, 0.0, 0.0025), ("counts", 30000.0, 1200.0, 4.0), ("%", 100.0, 0.0, 0.02)])
    if law in LOOPS and rng.random() < 0.5:
        drive = position
    noise = 10 ** rng.uniform(-3.7, -2.8)
    def told(value, unit, sigma):
        _, scale, zero, step = unit
        return round(((value + rng.gauss(0, sigma)) * scale + zero) / step) * step
    columns = [(t * travel_s, told(u, drive, 0.0), told(x, position, noise)) for t, u, x in rows]
    _, cs, c0, _ = drive
    _, ps, p0, _ = position
    out = {}
    for name, value in truth.items():
        if name in ("spool_zero", "rises_from", "falls_from"):
            key = name
            if ps < 0 and name != "spool_zero":
                key = {"rises_from": "falls_from", "falls_from": "rises_from"}[name]
            out[key] = value * cs + c0
        elif name == "dead_band":
            out[name] = value * abs(cs)
        elif name in ("rising_speed", "falling_speed"):
            key = name if ps > 0 else {"rising_speed": "falling_speed", "falling_speed": "rising_speed"}[name]
            out[key] = value * ps / travel_s
        elif name in ("lag_s", "lag", "delay", "integral time"):
            out[name] = value * travel_s
        elif name.startswith("rate limit"):
            key = name if ps > 0 else {"rate limit, rising": "rate limit, falling", "rate limit, falling": "rate limit, rising"}[name]
            out[key] = value * abs(ps) / travel_s
        elif name == "gain":
            out[name] = value * ps / cs
        elif name == "level":
            out[name] = p0 - truth["gain"] * ps / cs * c0
        else:
            out[name] = value * abs(ps)
    return {"law": law, "travel_s": travel_s, "drive": drive[0], "position": position[0], "columns": columns, "truth": out, "noise": noise}
