"""Compares identification with one- and two-pole output-error fits (SciPy) and N4SID (SIPPY) on the same data.

Usage: peers.py PROGRAM RIG [PRESS.toml CHIRP.csv]
PROGRAM is `shakebench`, RIG a folder that `shakebench commission` wrote. Every model is fitted to
RIG/recordings/excitation.csv (command to displacement) and predicts the displacement of the other
recordings in the closed loop, under the same PID and from the reference alone. With a rig's
description and its record the models also predict that record from its command: one input and one
output, fitted to the first half and judged on the second. Prints a table: errors in per cent of the
signal's root mean square, and each peer's over ours.
"""
import csv
import json
import subprocess
import sys
from pathlib import Path

import numpy as np
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
            start = np.r_[np.log(y.std() / u.std()), np.log([60.0, 200.0])[:poles], delay]
            fit = least_squares(
                lambda p: self.simulate(p, u) - y, start, x_scale=[0.1] + [0.3] * poles + [0.5], max_nfev=60
            )
            if best is None or fit.cost < best.cost:
                best = fit
        self.parameters = best.x

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
            gain *= self.period * 60
        delay = float(np.clip(p[-1], 0, 40))
        whole, part = int(delay), delay - int(delay)
        num = np.r_[np.zeros(whole + 1), gain * (1 - part), gain * part]
        return num, den

    def simulate(self, p, u):
        num, den = self.filters(p)
        y = lfilter(num, den, u)
        return y - y.mean() if self.integrates else y

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


class N4sid:
    """Order by the best prediction of the last quarter."""

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
            self.model = model
            error = percent(self.predict(u)[cut:] - y[cut:], y)
            if np.isfinite(error) and (best is None or error < best[0]):
                best = (error, model)
        self.model = best[1]

    def predict(self, u):
        step, y = self.stepper(), np.zeros(len(u))
        for k in range(1, len(u)):
            y[k] = step(u[k - 1])
        return y

    def stepper(self):
        a, b, c = (np.asarray(m) for m in (self.model.A, self.model.B, self.model.C))
        x = np.zeros((a.shape[0], 1))

        def step(u):
            nonlocal x
            x = a @ x + b * u
            return float((c @ x)[0, 0])

        return step


def closed_loop(model, reference, period, kp=3 / 0.0254, ki=0.4 / 0.0254):
    """The displacement under Eq 3-6; infinite where the model does not hold."""
    step, x, integral = model.stepper(), 0.0, 0.0
    out = np.empty(len(reference))
    for k, wanted in enumerate(reference):
        out[k] = x
        error = wanted - x
        integral += ki * error * period
        x = step(np.clip(kp * error + integral, -10, 10))
        if not abs(x) < 10:
            return np.full(len(reference), np.inf)
    return out


def main():
    program, rig = sys.argv[1], Path(sys.argv[2])
    rows = []
    data = read(rig / "recordings/excitation.csv")
    period = float(np.median(np.diff(data["time"])))
    u, y = data["valve_command"], data["displacement"]
    u, y = u - u.mean(), y - y.mean()
    peers = {
        "one pole": Poles(1, True, u, y, period),
        "two poles": Poles(2, True, u, y, period),
        "N4SID": N4sid(u, y, period),
    }
    report = json.loads((rig / "commission.json").read_text())
    for own in report["predictions"]:
        other = read(rig / f"recordings/{own['motion']}.csv")
        errors = {"ours": own["displacement_percent"]}
        for name, model in peers.items():
            x = closed_loop(model, other["reference"], period)
            errors[name] = percent(x - other["displacement"], other["displacement"])
        rows.append((f"simulated rig, {own['motion']}", errors))
    if len(sys.argv) > 4:
        rows.append(press(program, Path(sys.argv[3]), Path(sys.argv[4])))
    heads = ["data", "ours", *peers]
    print("RESULT " + json.dumps([{"data": name, **errors} for name, errors in rows]))
    print(" | ".join(f"{head:>18}" for head in heads) + " | peers over ours")
    for name, errors in rows:
        ratios = ", ".join(f"{errors[peer] / errors['ours']:.2f}" for peer in peers)
        print(" | ".join([f"{name:>18}"] + [f"{errors[h]:17.2f}%" for h in heads[1:]]) + f" | {ratios}")


def press(program, description, record):
    """The measured press: command to displacement."""
    data = np.loadtxt(record, delimiter=",", skiprows=1)
    period = 1e-3
    u, y = data[:, 0], data[:, 1]
    half = len(u) // 2
    fitted = (u[:half] - u[:half].mean(), y[:half] - y[:half].mean())
    models = {
        "one pole": Poles(1, False, *fitted, period),
        "two poles": Poles(2, False, *fitted, period),
        "N4SID": N4sid(*fitted, period),
    }
    done = subprocess.run(
        [program, "diagnose", description, "--data", record, "--out", "peers-press", "--json"],
        capture_output=True,
        text=True,
        check=True,
    )
    found = json.loads(done.stdout)
    errors = {"ours": ours_on(found)}
    for name, model in models.items():
        x = model.predict(u - u[:half].mean()) + y[:half].mean()
        errors[name] = percent((x - y)[half:], y[half:])
    return ("press", errors)


def ours_on(found):
    """Error of the extended model on the part that was not fitted, per cent."""
    for key in ("validation", "second_half", "rest"):
        if key in found:
            return 100 * found[key]["extended_error"]
    gain = found["gain"]
    return 100 * gain["after_nrmse"]


main()
