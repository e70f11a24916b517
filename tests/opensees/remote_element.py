"""A mass on two springs, one of which is an experimental element: against the same model in OpenSees alone.

usage: remote_element.py PORT linear|yielding STEPS [INTEGRATOR [ITERATIONS]]

Prints a JSON object: the largest displacement, the largest difference, the seconds of both.
"""

import json
import math
import sys
import time

import openseespy.opensees as ops

PORT, KIND, STEPS = int(sys.argv[1]), sys.argv[2], int(sys.argv[3])
INTEGRATOR = sys.argv[4] if len(sys.argv) > 4 else "Newmark"
ITERATIONS = int(sys.argv[5]) if len(sys.argv) > 5 else 5
DT = 0.01
# kip, inch
STIFFNESS, YIELD, HARDENING, MASS = 2.8, 1.5, 0.02, 0.04


def integrate():
    """The integrator with the algorithm and the test that go with it."""
    if INTEGRATOR == "Newmark":
        ops.test("NormDispIncr", 1e-10, 50)
        ops.algorithm("ModifiedNewton", "-initial")
        ops.integrator("Newmark", 0.5, 0.25)
    elif INTEGRATOR == "NewmarkHSFixedNumIter":
        ops.test("FixedNumIter", ITERATIONS)
        ops.algorithm("Newton")
        ops.integrator("NewmarkHSFixedNumIter", 0.5, 0.25, "-polyOrder", 2)
    elif INTEGRATOR == "HHTHSFixedNumIter":
        ops.test("FixedNumIter", ITERATIONS)
        ops.algorithm("Newton")
        ops.integrator("HHTHSFixedNumIter", 0.9, "-polyOrder", 2)
    elif INTEGRATOR == "AlphaOS":
        ops.algorithm("Linear")
        ops.integrator("AlphaOS", 1.0)
    elif INTEGRATOR == "CentralDifference":
        ops.algorithm("Linear")
        ops.integrator("CentralDifference")
    elif INTEGRATOR == "NewmarkExplicit":
        ops.algorithm("Linear")
        ops.integrator("NewmarkExplicit", 0.5)
    elif INTEGRATOR == "KRAlphaExplicit":
        ops.algorithm("Linear")
        ops.integrator("KRAlphaExplicit", 1.0)
    else:
        raise SystemExit("no integrator " + INTEGRATOR)


def run(remote):
    ops.wipe()
    ops.model("basic", "-ndm", 1, "-ndf", 1)
    ops.node(1, 0.0)
    ops.node(2, 0.0)
    ops.fix(1, 1)
    ops.mass(2, MASS)
    if remote:
        ops.element("genericClient", 1, "-node", 2, "-dof", 1, "-server", PORT, "127.0.0.1")
    else:
        if KIND == "linear":
            ops.uniaxialMaterial("Elastic", 1, STIFFNESS)
        else:
            ops.uniaxialMaterial("Steel01", 1, YIELD, STIFFNESS, HARDENING)
        ops.element("zeroLength", 1, 1, 2, "-mat", 1, "-dir", 1)
    ops.uniaxialMaterial("Elastic", 2, 0.5 * STIFFNESS)
    ops.element("zeroLength", 2, 1, 2, "-mat", 2, "-dir", 1)
    ground = [
        386.09 * 0.3 * math.sin(6.0 * i * DT) * math.exp(-0.1 * i * DT) for i in range(STEPS + 10)
    ]
    ops.timeSeries("Path", 1, "-dt", DT, "-values", *ground)
    ops.pattern("UniformExcitation", 1, 1, "-accel", 1)
    ops.constraints("Plain")
    ops.numberer("Plain")
    ops.system("FullGeneral")
    integrate()
    ops.analysis("Transient")
    found, begun = [], time.time()
    for step in range(STEPS):
        if ops.analyze(1, DT) != 0:
            print(json.dumps({"failed": step + 1, "remote": remote}), flush=True)
            raise SystemExit(1)
        found.append(ops.nodeDisp(2, 1))
    return found, time.time() - begun


alone, alone_s = run(False)
remote, remote_s = run(True)
ops.wipe()
print(
    json.dumps(
        {
            "peak": max(map(abs, alone)),
            "difference": max(abs(a - b) for a, b in zip(alone, remote)),
            "rms": math.sqrt(
                sum((a - b) ** 2 for a, b in zip(alone, remote)) / sum(a * a for a in alone)
            ),
            "alone_s": alone_s,
            "remote_s": remote_s,
        }
    )
)
