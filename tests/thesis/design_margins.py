"""Margins and synthesis of `shakebench design --json`, computed again with NumPy and SciPy from the
printed equations in thesis units (inch, lbf, second, volt). Shares no code and no formulation with the
program: loops are ratios of polynomials and sampled plants come from scipy.signal.

    python design_margins.py design.json
"""

import json
import sys

import numpy as np
from scipy import linalg, optimize, signal

H = 0.002
DECIBEL, DEGREES, RELATIVE = 0.1, 0.2, 1e-3
BAND = 2 * np.pi * 0.25

# Eq 2-13, 2-14, 2-28.
DEN = [1, 56.18, 1.333e4, 178.2]
G1 = [3430, 3.86e4, 403.3]
G2 = [565.1, -1818, 3.12e5]
B, C, K = 8.248, 2.034, 192.4
M, CT, KT = 1 / B, C / B, K / B
TABLE = [1, C, K]

# V to x, v, a and F over one denominator (Eq 3-4, 3-5).
CLOSED = np.polysub(np.polymul(DEN, TABLE), np.polymul(np.polymul(G2, [1, 0]), [B]))
TO_X = np.polymul(G1, [B])
NUMERATORS = {
    "x": TO_X,
    "v": np.polymul(TO_X, [1, 0]),
    "a": np.polymul(TO_X, [1, 0, 0]),
    "F": np.polymul(G1, TABLE),
}


def sampled_plant():
    """Numerators and denominator in z behind a zero-order hold."""
    rows = np.zeros((4, len(CLOSED)))
    for row, numerator in zip(rows, NUMERATORS.values()):
        row[len(CLOSED) - len(numerator):] = numerator
    a, b, c, d = signal.tf2ss(rows, CLOSED)
    a, t = linalg.matrix_balance(a, permute=False)
    b, c = np.linalg.solve(t, b), c @ t
    a, b, c, d, _ = signal.cont2discrete((a, b, c, d), H)

    def at(z):
        return dict(zip(NUMERATORS, (c @ np.linalg.solve(z * np.eye(len(a)) - a, b) + d)[:, 0]))

    return at, (a, b, c, d)


def continuous_plant(s):
    return {name: np.polyval(n, s) / np.polyval(CLOSED, s) for name, n in NUMERATORS.items()}


SAMPLED, MATRICES = sampled_plant()


def pi_continuous(p, i, leak=0.0):
    return lambda s: p + i / (s + leak)


def pi_sampled(p, i, leak=0.0):
    """The integral takes in the present error: i h z / (z - exp(-leak h))."""
    return lambda z: p + i * H * z / (z - np.exp(-leak * H))


def tustin(numerator, denominator):
    return lambda z: (lambda s: np.polyval(numerator, s) / np.polyval(denominator, s))(
        2 / H * (z - 1) / (z + 1))


def ratio(numerator, denominator):
    return lambda s: np.polyval(numerator, s) / np.polyval(denominator, s)


def loops(coefficients, rate):
    """name -> (open loop, closed loop) of (variable, plant, s), for s and z laws."""
    g, n1, n0, p = coefficients

    def make(pi, second_order):
        cd, cf = pi(3, 0.4), pi(0.366, 3.222)
        leaking = pi(3, 0.4, BAND)
        integral = pi(0, 0.161)
        printed = second_order(6.986 * np.array([1, 0.2975, 0.5892]), [1, 0.01046, 0])
        designed = second_order(g * np.array([1, n1, n0]), [1, p, 0])

        def single(c, out):
            return (lambda q, y, s: c(q) * y[out], lambda q, y, s: c(q) * y[out])

        def three(q, y, s):
            return 6.15 * y["x"] + 0.005 * y["v"] + 1e-4 * y["a"] + integral(q) * y["x"]

        def three_reference(q, y, s):
            return y["x"] * (6.35 + 0.13 * s + 1e-4 * s * s + integral(q))

        def hierarchy(q, y, s):
            surface = M * (rate * rate * y["x"] + 2 * rate * y["v"])
            force = surface - KT * y["x"] - CT * y["v"] + y["F"]
            return 0.5 * leaking(q) * M * rate**2 / KT * y["x"] + 0.5 * cf(q) * force

        def hierarchy_reference(q, y, s):
            wanted = M * (rate * rate + 2 * rate * s + s * s)
            return y["x"] * (0.5 * leaking(q) * M * rate**2 / KT + 0.5 * cf(q) * wanted)

        return {
            "displacement-pid": single(cd, "x"),
            "force-pid": single(cf, "F"),
            "loop-shaping": single(printed, "x"),
            "loop-shaping-synthesis": single(designed, "x"),
            "three-variable": (three, three_reference),
            "sliding-mode": (hierarchy, hierarchy_reference),
        }

    return make(pi_continuous, ratio), make(pi_sampled, tustin)


def crossings(function, grid):
    values = np.array([function(w) for w in grid])
    places = np.nonzero(values[:-1] * values[1:] < 0)[0]
    return [optimize.brentq(function, grid[i], grid[i + 1], xtol=1e-13, rtol=1e-13) for i in places]


def margins(open_loop, last):
    grid = np.geomspace(1e-3, last, 6000)
    crossover = [
        (np.degrees(np.angle(-open_loop(w))), w)
        for w in crossings(lambda w: abs(open_loop(w)) - 1, grid)
    ]
    phase, at = min(crossover, key=lambda pair: abs(pair[0]), default=(None, None))
    gains = [
        -20 * np.log10(abs(open_loop(w)))
        for w in crossings(lambda w: open_loop(w).imag, grid)
        if open_loop(w).real < 0
    ]
    end = open_loop(last)
    if abs(end.imag) < 1e-7 * abs(end.real) and end.real < 0:
        gains.append(-20 * np.log10(abs(end)))
    return at, phase, min(gains, key=abs, default=None)


def bandwidth(closed, last):
    threshold = abs(closed(1e-3)) * 10 ** (-3 / 20)
    falls = [
        w for w in crossings(lambda w: abs(closed(w)) - threshold, np.geomspace(BAND, last, 6000))
        if abs(closed(w * 1.0001)) < threshold
    ]
    return falls[0] / (2 * np.pi) if falls else None


def check(where, what, got, want, tolerance, relative=False):
    if got is None or want is None:
        ok = got is None and want is None
    else:
        ok = abs(got - want) <= tolerance * (abs(want) if relative else 1)
    print(f"{'ok ' if ok else 'BAD'} {where:36} {what:18} {got!s:22} {want!s:22}")
    return ok


def unstable_poles(kind, back, plant):
    """Closed-loop poles right of Re s = 1e-3 or outside |z| = exp(1e-3 h), by the argument principle:
    1 + L has the unstable poles of the plant there (the laws have none) and tends to 1 far away."""
    shift = 1e-3
    if kind == "continuous":
        w = np.geomspace(1e-5, 1e8, 40000)
        points = shift + 1j * np.r_[-w[::-1], w]
        open_unstable = sum(np.roots(CLOSED).real > shift)
    else:
        angle = np.geomspace(1e-7, np.pi, 40000)
        points = np.exp(shift * H) * np.exp(1j * np.r_[-angle[::-1], angle])
        open_unstable = sum(abs(np.linalg.eigvals(MATRICES[0])) > np.exp(shift * H))
    values = np.array([1 + back(q, plant(q), None) for q in points])
    turns = np.sum(np.angle(values[1:] / values[:-1])) / (2 * np.pi)
    return round(open_unstable - turns)


def synthesis(design):
    """gamma_min of the shaped plant by both Riccati equations and by the Hankel norm of its
    coprime factors, with SciPy's solver; the plant in time of one over the crossover."""
    wn = design["crossover_rad_s"]
    poles, zeros = np.roots(CLOSED), np.roots(G1)
    poles, zeros = poles[np.argsort(abs(poles))], zeros[np.argsort(abs(zeros))]
    weight = [-abs(p.real) + 1j * p.imag for p in poles[:2]]
    numerator = np.poly(np.r_[zeros[1:], weight] / wn).real
    denominator = np.poly(np.r_[poles, 0] / wn).real
    numerator *= denominator[-2] / numerator[-1]
    a, b, c, _ = signal.tf2ss(numerator, denominator)
    x = linalg.solve_continuous_are(a, b, c.T @ c, np.eye(1))
    z = linalg.solve_continuous_are(a.T, c.T, b @ b.T, np.eye(1))
    riccati = np.sqrt(1 + max(np.linalg.eigvals(x @ z).real))
    h = -z @ c.T
    stable = a + h @ c
    p = linalg.solve_continuous_lyapunov(stable, -(b @ b.T + h @ h.T))
    q = linalg.solve_continuous_lyapunov(stable.T, -c.T @ c)
    hankel = 1 / np.sqrt(1 - max(np.linalg.eigvals(p @ q).real))
    got = design["gamma_min"]
    return [check("synthesis", "gamma (Riccati)", got, riccati, 1e-6, True),
            check("synthesis", "gamma (Hankel)", got, hankel, 1e-6, True)]


def main(path):
    with open(path, encoding="utf-8") as file:
        report = json.load(file)
    design = report["synthesis"]
    inch = 0.0254
    coefficients = (design["gain_v_m"] * inch, design["numerator_rate_1_s"],
                    design["numerator_constant_1_s2"], design["pole_1_s"])
    continuous, sampled = loops(coefficients, report["sliding_mode_rate_1_s"])
    results = synthesis(design)
    nyquist = np.pi / H
    for row in report["loops"]:
        name = row["name"]
        for kind, figures, (back, ahead), plant, to_q, last in [
            ("continuous", row, continuous[name], continuous_plant, lambda s: s, 100 * nyquist),
            ("500 Hz", row["sampled"], sampled[name], SAMPLED, lambda s: np.exp(s * H), nyquist),
        ]:
            def open_loop(w):
                q = to_q(1j * w)
                return back(q, plant(q), 1j * w)

            def closed_loop(w):
                q = to_q(1j * w)
                return ahead(q, plant(q), 1j * w) / (1 + open_loop(w))

            where = f"{name}, {kind}"
            at, phase, gain = margins(open_loop, last)
            width = bandwidth(closed_loop, last) if figures["stable"] else None
            unstable = unstable_poles(kind, back, plant)
            results += [
                check(where, "stable", float(figures["stable"]), float(unstable == 0), 0),
                check(where, "crossover", figures["crossover_rad_s"], at, RELATIVE, True),
                check(where, "phase margin", figures["phase_margin_deg"], phase, DEGREES),
                check(where, "gain margin", figures["gain_margin_db"], gain, DECIBEL),
                check(where, "bandwidth", figures["bandwidth_hz"], width, RELATIVE, True),
            ]
    if not all(results):
        sys.exit(f"{results.count(False)} of {len(results)} disagree")
    print(f"{len(results)} figures agree")


main(sys.argv[1])
