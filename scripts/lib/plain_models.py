"""Plain models of a servomotor stage, fitted to one half of a recording and run freely over the other: ARX and boosted trees.

Free runs are those of `govtwin diagnose`: each from the measured position on, one behind another, in either half. A model knows the spool,
and of the position what it predicted itself, but for the first samples. Orders, sampling and trees are chosen by free runs within the fitted half.
"""

import csv
import itertools
import struct

import numpy

# Every so many-th sample: noise hides what changes between neighbours of a fast recording.
STEPS = (1, 4, 16)
TREES = 300


def exported(path, rate_hz, spool, position):
    """A table with a column for each channel."""
    rows = list(csv.DictReader(open(path)))
    return 1 / rate_hz, numpy.array([float(row[spool]) for row in rows]), numpy.array([float(row[position]) for row in rows])


def recorded(path):
    """A bag of `/plant/servo_state`, whose rows are equally far apart."""
    from mcap.reader import make_reader

    times, spool, position = [], [], []
    with open(path, "rb") as file:
        for _, _, message in make_reader(file).iter_messages(topics=["/plant/servo_state"]):
            # CDR: four bytes of encapsulation, stamp, frame_id behind its length, then doubles at multiples of eight.
            body = message.data[4:]
            seconds, nanos, length = struct.unpack_from("<iII", body)
            at = (12 + length + 7) // 8 * 8
            values = struct.unpack_from("<2d", body, at)
            times.append(seconds + 1e-9 * nanos)
            spool.append(values[0])
            position.append(values[1])
    return (times[-1] - times[0]) / (len(times) - 1), numpy.array(spool), numpy.array(position)


class Half:
    """Free runs of one half, all of the same length: a row for each run."""

    def __init__(self, period_s, spool, position, run_s):
        length = int(round(run_s / period_s))
        count = int(len(spool) * period_s / run_s * (1 + 1e-9))
        self.spool = spool[: count * length].reshape(count, length)
        self.position = position[: count * length].reshape(count, length)

    def part(self, rows):
        one = object.__new__(Half)
        one.spool, one.position = self.spool[rows], self.position[rows]
        return one


def features(spool, position, at, model):
    """What a model sees of each run before its sample `at`."""
    step, lags, own = model["step"], model["lags"], model["own"]
    inputs = [spool[:, at - k * step] for k in range(lags)]
    if model["kind"] == "arx":
        return numpy.stack([position[:, at - k * step] for k in range(1, own + 1)] + inputs + [numpy.ones(len(spool))], axis=1)
    speeds = [position[:, at - k * step] - position[:, at - (k + 1) * step] for k in range(1, own + 1)]
    return numpy.stack(speeds + inputs + [position[:, at - step]] * model["place"], axis=1)


def first(model):
    return model["step"] * max(model["lags"] - 1, model["own"] + 1)


def fitted(half, model):
    begin, length = first(model), half.spool.shape[1]
    rows = [features(half.spool, half.position, at, model) for at in range(begin, length)]
    seen = numpy.concatenate(rows)
    if model["kind"] == "arx":
        told = numpy.concatenate([half.position[:, at] for at in range(begin, length)])
        weights = numpy.linalg.lstsq(seen, told, rcond=None)[0]
        return lambda features: features @ weights
    import lightgbm

    told = numpy.concatenate([half.position[:, at] - half.position[:, at - model["step"]] for at in range(begin, length)])
    settings = {"objective": "regression", "num_leaves": model["leaves"], "learning_rate": 0.05, "min_data_in_leaf": 20, "verbosity": -1,
                "seed": 1, "deterministic": True, "num_threads": 1}
    trees = lightgbm.train(settings, lightgbm.Dataset(seen, told), TREES)
    return lambda features: trees.predict(features, num_threads=1)


def error(half, model, predict):
    """RMS error of free runs."""
    position = half.position.copy()
    for at in range(first(model), position.shape[1]):
        told = predict(features(half.spool, position, at, model))
        position[:, at] = told if model["kind"] == "arx" else position[:, at - model["step"]] + told
        # A model that runs away is far off, not infinite.
        position[:, at] = numpy.clip(position[:, at], -10, 10)
    return float(numpy.sqrt(numpy.mean((position - half.position) ** 2)))


def candidates(kind, period_s, length):
    for step in STEPS:
        # Slower than two samples a second nothing of a servomotor is left; faster than they come there are none.
        if step * period_s > 0.5 and step > 1:
            continue
        if kind == "arx":
            orders = itertools.product((1, 2, 3, 5), (1, 2, 3, 5, 8))
            found = [{"kind": kind, "step": step, "own": own, "lags": lags} for own, lags in orders]
        else:
            orders = itertools.product((0, 2), (1, 4, 8, 12), (0, 1), (7, 31))
            found = [{"kind": kind, "step": step, "own": own, "lags": lags, "place": place, "leaves": leaves} for own, lags, place, leaves in orders]
        yield from (model for model in found if first(model) < length // 4)


def chosen(half, kind, period_s):
    """The model of best free runs on the last third of the half, fitted to the rest of it."""
    count = len(half.spool)
    cut = max(1, count - max(1, count // 3))
    inner, outer = half.part(slice(0, cut)), half.part(slice(cut, count))
    return min(candidates(kind, period_s, half.spool.shape[1]), key=lambda model: error(outer, model, fitted(inner, model)))


def study(period_s, spool, position, run_s):
    """Rows of a table: model, half that it was fitted to, and RMS errors there and on the other half, of what was travelled."""
    travelled = position.max() - position.min()
    middle = (len(spool) + 1) // 2
    halves = [Half(period_s, spool[:middle], position[:middle] / travelled, run_s), Half(period_s, spool[middle:], position[middle:] / travelled, run_s)]
    for kind, name in (("arx", "ARX"), ("trees", "boosted trees")):
        for half, words in ((0, "first half"), (1, "second half")):
            model = chosen(halves[half], kind, period_s)
            predict = fitted(halves[half], model)
            settings = ", ".join(f"{key} {value}" for key, value in model.items() if key != "kind")
            yield name, words, error(halves[half], model, predict), error(halves[1 - half], model, predict), settings
