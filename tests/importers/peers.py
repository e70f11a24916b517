"""Compares identification with one- and two-pole output-error fits (SciPy) and N4SID (SIPPY) on the same data.

Usage: peers.py PROGRAM RIG [MEASURED]
PROGRAM is `shakebench`, RIG a folder that `shakebench commission` wrote, MEASURED one with recordings
of a press (servohydraulic_press/chirp_0A.csv) and of a drive (positioning_drive/DATA_EMPS.csv).

On the simulated rig and on the drive every model is fitted to command and displacement of one
recording and predicts the displacement of others (the other half) in closed loop, under the same law
and from the reference alone. On the press, a sweep, the last and the first quarter are predicted from the command
by models of the rest. Ours are `identify --one-input`, with exactly these two columns and the reference; and,
where other channels are there, what `commission` found from all of them. Prints a table: errors in
per cent of the signal's root mean square, and each peer's over ours.
"""
import csv
import json
import subprocess
import sys
import tempfile
import tomllib
from pathlib import Path

import numpy as np
from scipy.linalg import expm
from scipy.optimize import least_squares
from scipy.signal import lfilter


def read(path):
    with open(path, newline="") as file:
        rows = csv.reader(file)
        names = [name.split(" [")[0].strip() for name in next(rows)]
        data = np.array([[float(cell) for cell in row] for row in rows])
    return {name: data[:, i] for i, name in enumerate(names)}


def percent(error, signal):
    return 100 * np.sqrt(np.mean(error**2) / np.mean((signal - signal.mean()) ** 2))


class Poles:
    """`gain / ((s + a) s)` or `gain / ((s + a)(s + b) s)`, or without the integrator, after a delay."""

    def __init__(self, poles, integrates, u, y, period):
        self.period, self.poles, self.integrates = period, poles, integrates
        best = None
        for delay in (1, 2, 4, 6):
            start = np.r_[self.gain(u, y), np.log([60.0, 200.0])[:poles], delay]
            fit = least_squares(
                lambda p: self.errors(p, u, y), start, x_scale=[0.1] + [0.3] * poles + [0.5], max_nfev=60
            )
            if best is None or fit.cost < best.cost:
                best = fit
        self.parameters = best.x

    def gain(self, u, y):
        """Of the slow motion, for the start."""
        input = np.cumsum(u) * self.period if self.integrates else u
        input = input - input.mean()
        return np.log(max(np.dot(input, y - y.mean()) / np.dot(input, input), 1e-9))

    def errors(self, p, u, y):
        """Less offset and, of a model that integrates, the drift of a command not quite at null."""
        error = self.simulate(p, u) - y
        if not self.integrates:
            return error - error.mean()
        time = np.linspace(-1, 1, len(u))
        return error - np.polyval(np.polyfit(time, error, 1), time)

    def filters(self, p):
        """Numerator and denominator in 1/z, matched poles, and the delay in samples."""
        den = np.array([1.0])
        gain = np.exp(p[0])
        for pole in np.exp(np.clip(p[1 : 1 + self.poles], -2, 8)):
            z = np.exp(-pole * self.period)
            den = np.convolve(den, [1, -z])
            gain *= 1 - z
        if self.integrates:
            den = np.convolve(den, [1, -1])
            gain *= self.period
        delay = float(np.clip(p[-1], 0, 40))
        whole, part = int(delay), delay - int(delay)
        num = np.r_[np.zeros(whole + 1), gain * (1 - part), gain * part]
        return num, den

    def simulate(self, p, u):
        num, den = self.filters(p)
        return lfilter(num, den, u)

    def predict(self, u):
        return self.simulate(self.parameters, u)

    def stepper(self):
        num, den = self.filters(self.parameters)
        ins, outs = np.zeros(len(num)), np.zeros(len(den) - 1)

        def step(u):
            """The output after the command `u` has been held for a sample."""
            nonlocal ins, outs
            ins = np.r_[u, ins[:-1]]
            # The numerator's first coefficient is zero: the output of the next sample.
            y = num[1:] @ ins[:-1] - den[1:] @ outs
            outs = np.r_[y, outs[:-1]]
            return y

        return step


class StateSpace:
    """A discrete model `x+ = A x + B u`, `y = C x` after whole samples of delay."""

    a = b = c = None

    def predict(self, u):
        step, y = self.stepper(), np.zeros(len(u))
        for k in range(1, len(u)):
            y[k] = step(u[k - 1])
        return y

    def stepper(self):
        x = np.zeros((self.a.shape[0], 1))

        def step(u):
            nonlocal x
            x = self.a @ x + self.b * u
            return float((self.c @ x)[0, 0])

        return step


class N4sid(StateSpace):
    """Order by the best prediction of the last quarter, the best a user of the peer would get."""

    def __init__(self, u, y, period):
        from sippy_unipi import system_identification

        cut = 3 * len(u) // 4
        best = None
        for order in (2, 3, 4, 5, 6):
            try:
                model = system_identification(
                    y[None, :cut], u[None, :cut], "N4SID", SS_fixed_order=order, SS_f=20, SS_p=20, tsample=period
                )
            except Exception:  # a fit that fails is no candidate
                continue
            self.a, self.b, self.c = (np.asarray(m) for m in (model.A, model.B, model.C))
            with np.errstate(all="ignore"):
                error = self.predict(u)[cut:] - y[cut:]
                error = percent(error - error.mean(), y)
            if best is None or (np.isfinite(error) and error < best[0]):
                best = (error, self.a, self.b, self.c)
        _, self.a, self.b, self.c = best


class Ours(StateSpace):
    """What `identify --one-input` writes, with its delay as states: exact for a held input."""

    def __init__(self, program, columns, period):
        with tempfile.TemporaryDirectory() as folder:
            data, model = Path(folder) / "data.csv", Path(folder) / "model.toml"
            stamps = np.arange(len(next(iter(columns.values())))) * period
            head = ",".join(["time [s]", *columns])
            np.savetxt(data, np.column_stack([stamps, *columns.values()]), delimiter=",", header=head, comments="")
            subprocess.run(
                [program, "identify", data, "--one-input", "--out", model, "--json"],
                check=True,
                capture_output=True,
                text=True,
            )
            found = tomllib.loads(model.read_text())["transfer_function"]
        self.straight = found["between_samples"] == "straight"
        den, num = np.array(found["denominator"]), np.array(found["numerator"])
        n = len(den) - 1
        rate = 100.0  # 1/s, the unit of time in which the powers are of a size
        num = np.r_[np.zeros(n - len(num)), num] / rate ** np.arange(1, n + 1)
        den = den[1:] / rate ** np.arange(1, n + 1)
        a = np.zeros((n, n))
        a[:, 0] = -den
        a[:-1, 1:] += np.eye(n - 1)
        h = period * rate
        late = found["delay"] / period
        whole, part = int(late), late - int(late)
        # Input of the sample before and of this one reach the plant one after the other.
        first, second = self.held(a, num, part * h), self.held(a, num, (1 - part) * h)
        transition = second[0] @ first[0]
        early, later = second[0] @ first[1], second[1]
        size = n + whole + 1
        self.a, self.b, self.c = np.zeros((size, size)), np.zeros((size, 1)), np.zeros((1, size))
        self.a[:n, :n] = transition
        line = n + np.arange(whole + 1)  # the inputs of 1, 2, ... samples ago
        self.a[:n, line[whole]] += early
        if whole:
            self.a[:n, line[whole - 1]] += later
        else:
            self.b[:n, 0] += later
        self.b[line[0], 0] = 1
        for i in range(whole):
            self.a[line[i + 1], line[i]] = 1
        self.c[0, 0] = 1

    @staticmethod
    def held(a, b, time):
        n = len(b)
        block = np.zeros((n + 1, n + 1))
        block[:n, :n], block[:n, n] = a * time, b * time
        block = expm(block)
        return block[:n, :n], block[:n, n]

    def predict(self, u):
        if self.straight:
            # The mean over the sample of a line: half a sample's hold earlier.
            u = np.r_[(u[1:] + u[:-1]) / 2, u[-1]]
        return super().predict(u)


def closed_loop(model, law, reference):
    """The displacement under a law; infinite where the model does not hold."""
    step, x = model.stepper(), 0.0
    out = np.empty(len(reference))
    for k, wanted in enumerate(reference):
        out[k] = x
        x = step(law(wanted, x))
        if not abs(x) < 10:
            return np.full(len(reference), np.inf)
    return out


def pid(period, kp=3 / 0.0254, ki=0.4 / 0.0254):
    """Eq 3-6."""
    integral = 0.0

    def law(wanted, x):
        nonlocal integral
        integral += ki * (wanted - x) * period
        return np.clip(kp * (wanted - x) + integral, -10, 10)

    return law


def cascade(period, kp=160.18, kv=243.45):
    """The law of the drive (Janot, Gautier and Brunot 2019)."""
    before = None

    def law(wanted, x):
        nonlocal before
        speed = 0.0 if before is None else (x - before) / period
        before = x
        return np.clip(kp * kv * (wanted - x) - kv * speed, -10, 10)

    return law


def fit_all(program, integrates, columns, u, y, period):
    u, y = u - u.mean(), y - y.mean()
    return {
        "identify": Ours(program, columns, period),
        "one pole": Poles(1, integrates, u, y, period),
        "two poles": Poles(2, integrates, u, y, period),
        "N4SID": N4sid(u, y, period),
    }


def simulated(program, rig):
    data = read(rig / "recordings/excitation.csv")
    period = float(np.median(np.diff(data["time"])))
    u, x, r = (data[name] for name in ("valve_command", "displacement", "reference"))
    columns = {"valve_command [V]": u, "displacement [m]": x, "reference [m]": r}
    models = fit_all(program, True, columns, u, x, period)
    for own in json.loads((rig / "commission.json").read_text())["predictions"]:
        other = read(rig / f"recordings/{own['motion']}.csv")
        errors = {"commission": own["displacement_percent"]}
        for name, model in models.items():
            played = closed_loop(model, pid(period), other["reference"])
            errors[name] = percent(played - other["displacement"], other["displacement"])
        yield f"simulated rig, {own['motion']}", errors


def press(program, record):
    data = np.loadtxt(record, delimiter=",", skiprows=1)
    period = 1e-3
    u, y = data[:, 1] * 1e-3, data[:, 2] * 1e-3
    quarter = len(u) // 4
    first, rest = slice(0, quarter), slice(quarter, len(u))
    last, before = slice(3 * quarter, len(u)), slice(0, 3 * quarter)
    for own, other, name in [(before, last, "last quarter"), (rest, first, "first quarter")]:
        columns = {"reference [m]": u[own], "displacement [m]": y[own]}
        models = fit_all(program, False, columns, u[own], y[own], period)
        errors = {"commission": float("nan")}
        for key, model in models.items():
            error = model.predict(u[other] - u[own].mean()) - y[other]
            # Its zero is no matter of a model's.
            errors[key] = percent(error - error.mean(), y[other])
        yield f"press, {name}", errors


def drive(program, record):
    data = np.loadtxt(record, delimiter=",", skiprows=1)
    period = 1e-3
    r, x, u = data[:, 1], data[:, 2], data[:, 3]
    half = len(u) // 2
    columns = {"valve_command [V]": u[:half], "displacement [m]": x[:half], "reference [m]": r[:half]}
    models = fit_all(program, True, columns, u[:half], x[:half], period)
    errors = {"commission": float("nan")}
    for key, model in models.items():
        played = closed_loop(model, cascade(period), r[half:] - x[half]) + x[half]
        errors[key] = percent(played - x[half:], x[half:])
    yield "drive, second half", errors


def main():
    program, rig = Path(sys.argv[1]).resolve(), Path(sys.argv[2])
    rows = list(simulated(program, rig))
    if len(sys.argv) > 3:
        measured = Path(sys.argv[3])
        rows += press(program, measured / "servohydraulic_press/chirp_0A.csv")
        rows += drive(program, measured / "positioning_drive/DATA_EMPS.csv")
    peers = ["one pole", "two poles", "N4SID"]
    heads = ["commission", "identify", *peers]
    print(" | ".join([f"{'data':>24}"] + [f"{head:>10}" for head in heads]) + " | peers over identify")
    for name, errors in rows:
        ratios = ", ".join(f"{errors[peer] / errors['identify']:.2f}" for peer in peers)
        print(" | ".join([f"{name:>24}"] + [f"{errors[head]:9.3f}%" for head in heads]) + f" | {ratios}")
    print("RESULT " + json.dumps([{"data": name, **errors} for name, errors in rows]))


main()
