"""A model in OpenSees whose base is moved by a prescribed displacement, without an adapter.

usage: moved_base.py MODEL.py BASE.json STEP

BASE.json holds the displacement of the base at the end of each step, m. Prints the force on the ground,
N, after each step: minus the mass times its absolute acceleration. The model is in relative coordinates:
it stays fixed and the ground's inertia is applied, so that damping and mass are not those of the adapter.
"""

import json
import sys

import openseespy.opensees as ops

model, base, step = sys.argv[1], json.load(open(sys.argv[2])), float(sys.argv[3])
names = {"__name__": "__specimen__"}
exec(compile(open(model).read(), model, "exec"), names)
LENGTH, FORCE = 0.0254, 4448.2216152605
direction = 1
ops.wipeAnalysis()
ops.loadConst("-time", 0.0)
# Newmark's method makes the acceleration of the base from its displacement, as it does behind an adapter.
ground, u, v, a = [0.0], 0.0, 0.0, 0.0
for wanted in base:
    wanted /= LENGTH
    new = 4.0 * ((wanted - u) / step - v) / step - a
    u, v, a = wanted, v + 0.5 * step * (a + new), new
    ground.append(a)
ops.timeSeries("Path", 9001, "-dt", step, "-values", *ground)
ops.pattern("UniformExcitation", 9001, direction, "-accel", 9001)
ops.constraints("Transformation")
ops.numberer("RCM")
ops.system("FullGeneral")
ops.test("NormDispIncr", 1e-12, 50)
ops.algorithm("Newton")
ops.integrator("Newmark", 0.5, 0.25)
ops.analysis("Transient")
forces = []
for k in range(1, len(base)):
    if ops.analyze(1, step) != 0:
        sys.exit("no solution")
    force = 0.0
    for node in ops.getNodeTags():
        force += ops.nodeMass(node, direction) * (ops.nodeAccel(node, direction) + ground[k])
    forces.append(-FORCE * force)
print(json.dumps(forces))
