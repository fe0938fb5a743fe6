"""Axes as machines and test rigs have them: a reference, a regulator, a valve with dead time and a spool of second order, and what disturbs them."""
import math
import random

# What each law has beside a valve and an integrator; a range is drawn from.
LOOPS = {
    "PID loop": {"kp": (4, 9), "ki": (0.2, 1.0), "kd": (0.01, 0.04), "spool": (40, 90)},
    "loop with feed-forward": {"kp": (4, 9), "forward": (0.4, 0.95), "shape": "waves", "delay": (0.0, 0.03)},
    "loop behind a ramp": {"kp": (6, 14), "ramp": (0.3, 0.7), "delay": (0.0, 0.05)},
    "swept loop": {"kp": (4, 12), "shape": "sweep", "delay": (0.01, 0.06)},
    "servo rig": {"kp": (3, 10), "shape": "waves", "spool": (40, 90), "delay": (0.0, 0.02), "dips": (0.0, 0.15)},
    "cascade with gravity": {"kp": (4, 9), "spool": (30, 60), "unequal": (1.2, 1.8), "half": (0.0, 0.01), "dips": (0.0, 0.15)},
    "loop with stick-slip": {"kp": (4, 9), "stick": (0.01, 0.04), "spool": (40, 90)},
}
STAGES = {
    "delayed stage": {"half": (0.02, 0.1), "delay": (0.08, 0.2), "spool": (15, 40)},
    "boom": {"half": (0.05, 0.2), "delay": (0.03, 0.12), "spool": (10, 25), "unequal": (1.3, 2.5), "dips": (0.0, 0.2), "jitter": 0.2},
    "counterbalance valve": {"half": (0.03, 0.1), "opens": (0.05, 0.15), "unequal": (1.2, 2.0), "spool": (20, 50)},
    "drifting stage": {"half": (0.05, 0.15), "leak": (0.005, 0.02), "holds": True},
}


def reference(rng, shape, row, rows):
    """What a loop is asked for, row by row, within 0.1 to 0.9."""
    if shape == "sweep":
        low, high, length = rng.uniform(0.05, 0.1), rng.uniform(0.5, 1.2), rows * row
        size = rng.uniform(0.1, 0.25)
        phase = lambda t: 2 * math.pi * low * length / math.log(high / low) * ((high / low) ** (t / length) - 1)
        return [0.5 + size * math.sin(phase(k * row)) for k in range(rows)]
    if shape == "waves":
        waves = [(rng.uniform(0.03, 0.5), rng.uniform(0, 2 * math.pi)) for _ in range(6)]
        sizes = [1 / (1 + 6 * f) for f, _ in waves]
        return [0.5 + 0.38 / sum(sizes) * sum(s * math.sin(2 * math.pi * f * k * row + p) for s, (f, p) in zip(sizes, waves)) for k in range(rows)]
    all, at, until = [], 0.5, 0
    for k in range(rows):
        if k * row >= until:
            at, until = rng.uniform(0.12, 0.88), k * row + rng.uniform(0.8, 3.0) * (4 if rng.random() < 0.1 else 1)
        all.append(at)
    return all


def axis(rng, law, valve, rows_wanted, steps):
    """Rows of time, drive and position, and what is true of them; `valve` makes what an operator gives a stage."""
    has = LOOPS.get(law) or STAGES[law]
    drawn = {name: rng.uniform(*size) for name, size in has.items() if isinstance(size, tuple)}
    of = lambda name, otherwise=0.0: drawn.get(name, otherwise)
    is_loop = law in LOOPS
    row = 1.0 / rng.uniform(25, 120)
    wanted = reference(rng, has.get("shape", "steps"), row, rows_wanted + 1) if is_loop else None
    up, down = 1.0, 1.0 / of("unequal", 1.0)
    if rng.random() < 0.5:
        up, down = down, up
    half, omega = of("half"), of("spool")
    period, phase = rng.uniform(8, 20), rng.uniform(0, 6)
    operator = None if is_loop else valve(rng, row)
    x = 0.5
    moving, spool, speed, total, ramped, slipping = 0.0, 0.0, 0.0, 0.0, 0.5, False
    late = [0.0] * round(of("delay") / row * steps)
    rows, pause = [], 0.0
    h = row / steps
    for k in range(rows_wanted):
        time = k * row
        if is_loop:
            asked = wanted[k]
            drive = asked
        else:
            if has.get("holds") and pause <= time and rng.random() < 0.004:
                pause = time + rng.uniform(2, 6)
            drive = operator.at(time, x) if pause <= time else 0.0
        rows.append((time + row * has.get("jitter", 0.0) * rng.uniform(-1, 1), drive, x))
        for step in range(steps):
            if is_loop:
                before = ramped
                most = of("ramp", math.inf) * h
                goal = wanted[k] + (wanted[k + 1] - wanted[k]) * (step + 1) / steps if has.get("shape") else wanted[k]
                ramped += max(-most, min(most, goal - ramped))
                error = ramped - x
                u = of("kp") * error + of("kp") * of("ki") * total + of("forward") * (ramped - before) / h - of("kd") * of("kp") * moving
                limited = max(-1.0, min(1.0, u))
                if u == limited:
                    total += h * error
                u = limited
            else:
                u = drive
            late.append(u)
            u = late.pop(0)
            if omega:
                speed += h * (omega * omega * (u - spool) - 1.4 * omega * speed)
                spool += h * speed
            else:
                spool = u
            flow = math.copysign(max(abs(spool) - half, 0.0), spool) / (1 - half)
            if of("opens") and flow < 0:
                # A counterbalance valve opens by pilot pressure: later, and then steeply.
                flow = min(0.0, flow + of("opens")) / (1 - of("opens"))
            v = flow * (up if flow > 0 else down) * (1 - of("dips") * (0.5 + 0.5 * math.sin(2 * math.pi * time / period + phase))) - of("leak")
            if of("stick"):
                slipping = abs(v) > (0.3 if slipping else 1.0) * of("stick")
                v = v if slipping else 0.0
            moving, x = v, min(1.0, max(0.0, x + h * v))
    truth = {"gain": 1.0, "level": 0.0} if is_loop else {}
    if is_loop and half:
        truth["backlash or dead band, full width"] = 2 * half / of("kp")
    if law in ("delayed stage", "boom", "drifting stage"):
        truth |= {"spool_zero": 0.0, "dead_band": 2 * half, "rises_from": half, "falls_from": -half}
    if law in ("delayed stage", "counterbalance valve"):
        truth["lag_s"] = len(late) * h + 1.4 / omega
    return rows, truth

