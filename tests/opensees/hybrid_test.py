"""A hybrid test: a mass on a specimen that is an experimental element, against the same all in OpenSees.

usage: hybrid_test.py PORT SECONDS

The specimen is that of the single-axis benchmark of hybrid simulation; N, m. Prints a JSON object: the
largest displacement, the RMS error of the displacement as a share, and how the last quarter compares.
"""

import json
import math
import sys

import openseespy.opensees as ops

PORT, SECONDS = int(sys.argv[1]), float(sys.argv[2])
DT = 1.0 / 1024.0
MASS = 5000.0
SPECIMEN = dict(mass=29.13, stiffness=1.19e6, ratio=0.0382)
DAMPING = 0.05


def ground(time):
    """A few sines that come and go, m/s2."""
    envelope = min(1.0, time / 2.0, max(0.0, (SECONDS - 2.0 - time) / 2.0))
    waves = ((0.9, 0.12), (1.7, 0.10), (2.6, 0.06), (4.1, 0.05))
    return envelope * sum(a * math.sin(2.0 * math.pi * f * time + f) for f, a in waves)


def run(remote):
    ops.wipe()
    ops.model("basic", "-ndm", 1, "-ndf", 1)
    ops.node(1, 0.0)
    ops.node(2, 0.0)
    ops.fix(1, 1)
    stiffness = SPECIMEN["stiffness"]
    omega = math.sqrt(stiffness / MASS)
    ops.uniaxialMaterial("Viscous", 1, 2.0 * DAMPING * MASS * omega, 1.0)
    ops.element("zeroLength", 1, 1, 2, "-mat", 1, "-dir", 1)
    if remote:
        ops.mass(2, MASS)
        ops.element("genericClient", 2, "-node", 2, "-dof", 1, "-server", PORT, "127.0.0.1")
    else:
        ops.mass(2, MASS + SPECIMEN["mass"])
        damping = 2.0 * SPECIMEN["ratio"] * math.sqrt(SPECIMEN["mass"] * stiffness)
        ops.uniaxialMaterial("Elastic", 2, stiffness)
        ops.uniaxialMaterial("Viscous", 3, damping, 1.0)
        ops.element("zeroLength", 2, 1, 2, "-mat", 2, 3, "-dir", 1, 1)
    steps = int(SECONDS / DT)
    # The ground pushes the mass that is computed in both.
    force = [-MASS * ground(i * DT) for i in range(steps + 2)]
    ops.timeSeries("Path", 1, "-dt", DT, "-values", *force)
    ops.pattern("Plain", 1, 1)
    ops.load(2, 1.0)
    ops.constraints("Plain")
    ops.numberer("Plain")
    ops.system("FullGeneral")
    ops.algorithm("Linear")
    ops.integrator("NewmarkExplicit", 0.5)
    ops.analysis("Transient")
    found = []
    for _ in range(steps):
        if ops.analyze(1, DT) != 0 or abs(ops.nodeDisp(2, 1)) > 0.1:
            break
        found.append(ops.nodeDisp(2, 1))
    return found


alone = run(False)
hybrid = run(True)
ops.wipe()
count = len(hybrid)
pairs = list(zip(alone, hybrid))
rms = math.sqrt(sum((a - b) ** 2 for a, b in pairs) / max(1e-30, sum(a * a for a in alone[:count])))
print(
    json.dumps(
        {
            "peak": max(map(abs, alone)),
            "hybrid_peak": max(map(abs, hybrid), default=0.0),
            "rms": rms,
            "steps": count,
            "complete": count == len(alone),
        }
    )
)
