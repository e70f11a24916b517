"""Runs an OpenSees model behind an `adapter` element.

The first line of standard input is a JSON object: what is wanted. A second line, the time step in
seconds, starts the analysis. Events are JSON objects, a line each, on standard output; whatever the
model prints goes to standard error. This process ends the analysis when its input ends, so that
nothing is left behind when its owner is killed; the analysis itself runs in a child, for OpenSees holds
the interpreter while it waits.
"""

import json
import os
import signal
import socket
import subprocess
import sys
import threading
import traceback


def supervise():
    """Passes lines to a child and ends it when they end."""
    script = os.environ["SHAKEBENCH_OPENSEES_DRIVER"]
    child = subprocess.Popen(
        [sys.executable, "-u", "-c", script, "analyse"], stdin=subprocess.PIPE
    )

    def forward():
        try:
            for line in sys.stdin.buffer:
                child.stdin.write(line)
                child.stdin.flush()
        except OSError:
            pass
        child.kill()

    threading.Thread(target=forward, daemon=True).start()
    status = child.wait()
    if status < 0:
        try:
            name = signal.Signals(-status).name
        except ValueError:
            name = "signal %d" % -status
        say(sys.stdout.buffer, event="ended", by=name)
    else:
        say(sys.stdout.buffer, event="ended", status=status)
    os._exit(0)


def say(to, **what):
    try:
        to.write((json.dumps(what) + "\n").encode())
        to.flush()
    except OSError:
        pass


class Refused(Exception):
    """What the model lacks, for people."""


def die_with_parent():
    """On Linux the kernel ends this process with its parent, however that ends."""
    try:
        import ctypes

        ctypes.CDLL(None).prctl(1, signal.SIGKILL)
    except (OSError, AttributeError, ImportError):
        pass


def free_port():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def analyse():
    die_with_parent()
    events = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    wanted = json.loads(sys.stdin.readline())
    try:
        import openseespy.opensees as ops
    except BaseException as error:  # The library says its own troubles in many ways.
        say(events, event="failed", kind="missing", message=str(error))
        os._exit(3)
    try:
        model = Model(ops, wanted)
        say(events, event="ready", **model.ready)
        model.join()
        model.analysis(wanted)
        say(events, event="joined")
    except Refused as error:
        say(events, event="failed", kind="refused", message=str(error))
        os._exit(3)
    except BaseException as error:
        say(events, event="failed", kind="python", message=where(error, wanted["model"]))
        os._exit(3)
    step = float(sys.stdin.readline())
    done = 0
    try:
        while True:
            status = ops.analyze(1, step)
            if status != 0:
                say(events, event="failed", kind="convergence", step=done + 1, status=status,
                    time=ops.getTime())
                os._exit(3)
            done += 1
    except BaseException as error:
        say(events, event="failed", kind="python", message=where(error, wanted["model"]))
        os._exit(3)


def where(error, path):
    """The error with the line of the model that it comes from."""
    if isinstance(error, SyntaxError):
        return "line %s: %s: %s" % (error.lineno, type(error).__name__, error.msg)
    lines = [f.lineno for f in traceback.extract_tb(error.__traceback__) if f.filename == path]
    place = "line %d: " % lines[-1] if lines else ""
    text = str(error) or "see what OpenSees printed"
    return "%s%s: %s" % (place, type(error).__name__, text)


class Model:
    """A structure as its script makes it, put on an `adapter`."""

    def __init__(self, ops, wanted):
        self.ops = ops
        self.mass_damping = 0.0
        self.element_mass = False
        rayleigh, element = ops.rayleigh, ops.element

        def record_rayleigh(alpha, *betas):
            # Against the moving base and not against the room: see `damp`.
            self.mass_damping = alpha
            return rayleigh(0.0 if wanted["role"] == "table" else alpha, *betas)

        def record_element(*arguments):
            self.element_mass |= "-mass" in arguments or "-rho" in arguments
            return element(*arguments)

        ops.rayleigh, ops.element = record_rayleigh, record_element
        path = wanted["model"]
        with open(path, encoding="utf-8") as file:
            source = file.read()
        folder = os.path.dirname(os.path.abspath(path))
        sys.path.insert(0, folder)
        os.chdir(folder)
        names = {"__name__": "__specimen__", "__file__": path}
        exec(compile(source, path, "exec"), names)
        ops.rayleigh, ops.element = rayleigh, element
        if not ops.getNodeTags():
            raise Refused("the model has no nodes; it must make them when it is run, not only under "
                          "`if __name__ == \"__main__\"`")
        self.names = names
        self.direction = int(wanted.get("direction") or names.get("direction", 1))
        self.notes = []
        ops.wipeAnalysis()
        # What has stood until now (gravity) stays; time begins with the motion.
        if names.get("keep_loads") is not True:
            ops.loadConst("-time", 0.0)
        role = wanted["role"]
        self.port = free_port()
        node = self.base() if role == "table" else self.interface()
        mass = self.mass()
        stiffness = self.adapter_stiffness(role, mass)
        self.node, self.stiffness = node, stiffness
        self.ready = dict(port=self.port, mass=mass, stiffness=stiffness, notes=self.notes,
                          units=names.get("units"))

    def join(self):
        """Adds the adapter, which waits until somebody connects."""
        tag = max(self.ops.getEleTags() or [0]) + 1
        self.ops.element("adapter", tag, "-node", self.node, "-dof", self.direction,
                         "-stif", self.stiffness, self.port)

    def base(self):
        """Frees what is fixed to the ground in the direction of motion and ties it together."""
        ops, direction = self.ops, self.direction
        named = self.names.get("base")
        nodes = [int(node) for node in named] if named is not None else [
            node for node in ops.getFixedNodes() if direction in ops.getFixedDOFs(node)
        ]
        if not nodes:
            raise Refused("no node is fixed in direction %d, so that there is nothing to move; fix the "
                          "base, or name it: base = [1, 2]" % direction)
        for node in nodes:
            if direction in ops.getFixedDOFs(node):
                ops.remove("sp", node, direction)
        for node in nodes[1:]:
            ops.equalDOF(nodes[0], node, direction)
        if self.mass_damping:
            self.damp(nodes)
        return nodes[0]

    def damp(self, base):
        """Mass-proportional damping between each mass and the base."""
        ops = self.ops
        if self.element_mass:
            raise Refused("mass-proportional damping (the first number of `rayleigh`) with masses of "
                          "elements cannot be put between mass and base; give the masses to nodes, or "
                          "damp with stiffness")
        tag = 1 + max(ops.getEleTags() or [0])
        companion = 1 + max(ops.getNodeTags())
        material = 987650000
        for node in ops.getNodeTags():
            masses = ops.nodeMass(node)
            held = ops.getFixedDOFs(node) if node in ops.getFixedNodes() else []
            free = [dof for dof, mass in enumerate(masses, 1) if mass > 0.0 and dof not in held]
            if node in base or not free:
                continue
            # At the same place, moving as the base does.
            ops.node(companion, *ops.nodeCoord(node))
            ops.fix(companion, *[int(dof != self.direction) for dof in range(1, len(masses) + 1)])
            ops.equalDOF(base[0], companion, self.direction)
            materials, directions = [], []
            for dof in free:
                material += 1
                ops.uniaxialMaterial("Viscous", material, self.mass_damping * masses[dof - 1], 1.0)
                materials.append(material)
                directions.append(6 if ops.getNDM()[0] == 2 and dof == 3 else dof)
            ops.element("zeroLength", tag, companion, node, "-mat", *materials, "-dir", *directions)
            tag += 1
            companion += 1
        self.notes.append("mass-proportional damping acts between the masses and the base")

    def interface(self):
        named = self.names.get("interface")
        if named is None:
            raise Refused("a numerical substructure names the node where the specimen is: "
                          "interface = 2")
        return int(named)

    def mass(self):
        ops = self.ops
        total = sum(ops.nodeMass(node)[self.direction - 1] for node in ops.getNodeTags())
        if self.element_mass or total <= 0.0:
            try:
                ops.system("FullGeneral")
                ops.eigen("-fullGenLapack", 1)
                given = ops.modalProperties("-return")
                total = max(total, given["totalMass"][self.direction - 1])
                ops.wipeAnalysis()
            except BaseException:
                pass
        return total

    def adapter_stiffness(self, role, mass):
        named = self.names.get("adapter_stiffness")
        if named is not None:
            return float(named)
        if mass <= 0.0:
            raise Refused("no mass moves in direction %d, from which the stiffness of the adapter would "
                          "be taken; give it: adapter_stiffness = 1e9 times that of the model"
                          % self.direction)
        return 1e10 * mass if role == "table" else 1e-4 * mass

    def analysis(self, wanted):
        ops, own = self.ops, self.names.get("analysis")
        if own is not None:
            own()
            return
        ops.constraints("Transformation")
        ops.numberer("RCM")
        ops.system("UmfPack")
        ops.test("NormDispIncr", wanted["tolerance"], 100, 0)
        ops.algorithm("Newton")
        ops.integrator("Newmark", 0.5, 0.25)
        ops.analysis("Transient")


if sys.argv[1:] == ["analyse"]:
    analyse()
else:
    supervise()
