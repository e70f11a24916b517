"""Times what a script waits for: a step from Python, a controller of Python, a short run.

    python python/examples/speed.py
"""

import os
import tempfile
import time

import shakebench


def seconds(action):
    begin = time.process_time()
    action()
    return time.process_time() - begin


def stepped(sim, steps):
    for _ in range(steps):
        sim.step()
        sim["table.displacement"]


def steps_from_python():
    """The physical rig (controller, interlock, table, sensors and specimen), turn about inside and from Python."""
    sim = shakebench.Simulation("three-variable", plant="servohydraulic", duration="120 s")
    steps = 5000
    pairs = [(seconds(lambda: sim.step(steps)), seconds(lambda: stepped(sim, steps))) for _ in range(5)]
    inside, outside = (min(column) / steps for column in zip(*pairs))
    print(f"a step: {inside * 1e6:.2f} us inside, {(outside - inside) * 1e6:.2f} us more from Python")


class Follower:
    """A proportional law with an integral."""

    def __init__(self):
        self.sum = 0.0

    def __call__(self, step, displacement, reference_displacement):
        error = reference_displacement - displacement
        self.sum += error * step
        return 30.0 * error + 2.0 * self.sum


def controller_of_python():
    control = shakebench.Function(Follower(), inputs={"displacement": "table.displacement"})
    sim = shakebench.Simulation("three-variable", duration="20 s", functions={"control": control})
    print(f"a controller of Python at 500 Hz: {20 / seconds(sim.run):.0f} times real time")


def short_run():
    runs = [seconds(lambda: shakebench.Simulation("mpc", duration="2 s").run()) for _ in range(5)]
    print(f"a run of 2 s: {min(runs):.3f} s, the first {runs[0]:.3f} s")


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        steps_from_python()
        controller_of_python()
        short_run()
