"""The physical rig with its yielding specimen, written here a second time from the equations and
integrated by SciPy's Radau: trajectories of the project must agree.

Arguments: a CSV whose columns are time, valve_command (held until the next row), displacement,
velocity, acceleration, actuator_force, supply_pressure, drift, in inch, pound-force, second, volt
and psi. Prints one line per column and fails when one is off by more than its tolerance.
"""

import csv
import sys

import numpy as np
from scipy.integrate import solve_ivp

# Inch, pound-force, second, volt.
AREA, VOLUME, BULK = 0.40, 24.0, 4e4
FLOW, LEAK, NULL_LEAK = 0.0418, 3.6e-4, 4e-5
OMEGA, ZETA, TRAVEL = 2 * np.pi * 60, 0.9, 10.0
MASS = 1 / 8.248
DAMPING, STIFFNESS = 2.034 * MASS, 192.4 * MASS
COULOMB, STATIC, STRIBECK, VISCOUS = 3.0, 4.0, 0.1, 5.0
SEAL, SEAL_DAMPING = 4000.0, 14.0
PUMP, PUMP_GAIN, PUMP_LIMIT, GAS, POLYTROPIC = 3000.0, 0.05, 12.0, 120.0, 1.4
CUSHION_FROM, STROKE, CUSHION, STOP, STOP_LOSS = 1.4, 1.5, 200.0, 5e4, 0.02
YIELD_FORCE, YIELD_DRIFT, POST_YIELD, SHARPNESS = 6.0, 0.147, 0.05, 1.5
SPECIMEN_MASS = YIELD_FORCE / YIELD_DRIFT * (0.5 / (2 * np.pi)) ** 2
SPECIMEN_DAMPING = 2 * 0.05 * SPECIMEN_MASS * 2 * np.pi / 0.5


def root(drop):
    """Signed square root, laminar within about 1 psi."""
    return drop / (drop**2 + 1.0) ** 0.25


def seals(z, v):
    """Friction force and rate of deflection (Dupont and others 2002)."""
    bump = np.exp(-((v / STRIBECK) ** 2))
    steady = (COULOMB + (STATIC - COULOMB) * bump) / SEAL
    start = 0.7 * COULOMB / SEAL
    if z * v <= 0 or abs(z) <= start:
        sliding = 0.0
    else:
        s = min((abs(z) - start) / (steady - start), 1.0)
        sliding = s * s * (3 - 2 * s)
    rate = v - sliding * abs(v) * z / steady
    return SEAL * z + SEAL_DAMPING * bump * rate + VISCOUS * v, rate


def ends(x, v):
    depth = abs(x) - CUSHION_FROM
    if depth <= 0:
        return 0.0
    side = np.sign(x)
    out = v * side
    cushion = CUSHION * min(depth / (STROKE - CUSHION_FROM), 1.0) ** 2 * max(out, 0.0)
    spring = STOP * max(abs(x) - STROKE, 0.0)
    return -side * (cushion + max(spring * (1 + STOP_LOSS * out), 0.0))


def outputs(state):
    _, _, pa, pb, x, v, z, supply, drift, drift_velocity, h = state
    friction, z_rate = seals(z, v)
    force = AREA * (pa - pb) - friction + ends(x, v)
    columns = (
        POST_YIELD * YIELD_FORCE / YIELD_DRIFT * drift
        + (1 - POST_YIELD) * YIELD_FORCE * h
        + SPECIMEN_DAMPING * drift_velocity
    )
    acceleration = (force + columns - DAMPING * v - STIFFNESS * x) / MASS
    return x, v, acceleration, force, supply, drift, columns, z_rate


def rates(state, u):
    y, yv, pa, pb, x, v, z, supply, drift, drift_velocity, h = state
    _, _, acceleration, _, _, _, columns, z_rate = outputs(state)
    opening = FLOW * np.clip(y, -TRAVEL, TRAVEL)
    if opening >= 0:
        qa, qb, drawn = opening * root(supply - pa), -opening * root(pb), opening * root(supply - pa)
    else:
        qa, qb, drawn = opening * root(pa), -opening * root(supply - pb), -opening * root(supply - pb)
    qa += NULL_LEAK * (supply - 2 * pa)
    qb += NULL_LEAK * (supply - 2 * pb)
    drawn += NULL_LEAK * (2 * supply - pa - pb)
    across = LEAK * (pa - pb)
    pump = np.clip(PUMP_GAIN * (PUMP - supply), 0.0, PUMP_LIMIT)
    gas = GAS * (PUMP / supply) ** (1 / POLYTROPIC)
    power = abs(h) ** SHARPNESS
    h_rate = drift_velocity / YIELD_DRIFT * (
        1 - power * (0.5 + 0.5 * (1.0 if drift_velocity * h >= 0 else -1.0))
    )
    return [
        yv,
        OMEGA**2 * (np.clip(u, -TRAVEL, TRAVEL) - y) - 2 * ZETA * OMEGA * yv,
        BULK / (VOLUME / 2 + AREA * x) * (qa - across - AREA * v),
        BULK / (VOLUME / 2 - AREA * x) * (qb + across + AREA * v),
        v,
        acceleration,
        z_rate,
        POLYTROPIC * supply / gas * (pump - drawn),
        drift_velocity,
        -columns / SPECIMEN_MASS - acceleration,
        h_rate,
    ]


def main(path):
    with open(path, newline="") as file:
        rows = list(csv.reader(file))
    names = rows[0]
    data = np.array([[float(cell) for cell in row] for row in rows[1:]])
    time, command, expected = data[:, 0], data[:, 1], data[:, 2:]
    supply = PUMP * PUMP_GAIN / (PUMP_GAIN + NULL_LEAK)
    state = np.array([0, 0, supply / 2, supply / 2, 0, 0, 0, supply, 0, 0, 0], dtype=float)
    scale = np.array([1, 100, 1e3, 1e3, 1, 10, 1e-3, 1e3, 1, 10, 1])
    got = [outputs(state)[:6]]
    for k in range(len(time) - 1):
        solution = solve_ivp(
            lambda t, x, u=command[k]: rates(x, u), (time[k], time[k + 1]), state,
            method="Radau", rtol=1e-8, atol=1e-9 * scale,
        )
        if not solution.success:
            sys.exit(f"Radau gave up at {time[k]} s: {solution.message}")
        state = solution.y[:, -1]
        got.append(outputs(state)[:6])
    got = np.array(got)
    failed = False
    # Relative to the largest value; acceleration and force carry the seals' quick motion.
    for i, name in enumerate(names[2:]):
        largest = np.abs(got[:, i]).max()
        if name == "supply_pressure":
            largest = np.ptp(got[:, i])
        worst = np.abs(got[:, i] - expected[:, i]).max() / largest
        allowed = 1e-3 if name in ("acceleration", "actuator_force") else 1e-4
        verdict = "ok" if worst < allowed else "FAILED"
        failed |= worst >= allowed
        print(f"{verdict} {name}: off by {worst:.1e} of {largest:.4g}, allowed {allowed:.0e}")
    sys.exit(1 if failed else 0)


if __name__ == "__main__":
    main(sys.argv[1])
