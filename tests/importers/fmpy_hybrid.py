"""Virtual real-time hybrid simulation in a loop of fmpy's own: the four partitions as FMUs, called
one after another, and the benchmark's scores J1 to J9.

Arguments: JOB.json FMU...; the job has `ground` (m/s2, one value per sample), `case`, `seed`, `stream`
and the frame's `mass`, `damping`, `stiffness`. Prints RESULT and the scores as JSON. Scores and
reference structure are computed here, apart from the program's.
"""

import json
import sys

import numpy as np
from common import Archive, check

STEP = 1.0 / 4096.0


class Part:
    """An instance with its inputs and outputs by name."""

    def __init__(self, archive, inputs, outputs, **integers):
        self.instance = archive.open()
        if archive.is2:
            self.instance.fmu.setupExperiment(startTime=0.0)
        for name, value in integers.items():
            self.instance.set_integer(name, value)
        if archive.is2:
            self.instance.fmu.enterInitializationMode()
        else:
            self.instance.fmu.enterInitializationMode(startTime=0.0)
        self.instance.fmu.exitInitializationMode()
        self.inputs = [archive.references[name] for name in inputs]
        self.outputs = [archive.references[name] for name in outputs]

    def step(self, time, values):
        self.instance.set(self.inputs, values)
        self.instance.fmu.doStep(currentCommunicationPoint=time, communicationStepSize=STEP)

    def get(self):
        return self.instance.get(self.outputs)


def loop(archives, job):
    """Measured displacement and displacements of the numerical substructure."""
    structure = Part(
        archives["NumericalSubstructure"],
        ["measured_force", "ground_acceleration", "ground_acceleration_next"],
        ["displacement[1]", "displacement[2]", "displacement[3]"],
        case=job["case"],
    )
    plant = Part(archives["TransferSystem"], ["command"], ["displacement", "force"])
    sensors = Part(
        archives["TrackingSensors"],
        ["displacement", "force"],
        ["measured_displacement", "read_displacement", "measured_force"],
        seed=job["seed"],
        stream=job["stream"],
    )
    control = Part(
        archives["AdaptiveInverse"],
        ["desired_displacement", "measured_displacement"],
        ["command"],
    )
    ground = job["ground"]
    measured, floors = np.empty(len(ground)), np.empty((len(ground), 3))
    for k, now in enumerate(ground):
        time = k * STEP
        floors[k] = structure.get()
        sensors.step(time, plant.get())
        measured[k], read, force = sensors.get()
        control.step(time, [floors[k, 0], read])
        if k + 1 < len(ground):
            plant.step(time, control.get())
            structure.step(time, [force, now, ground[k + 1]])
    return measured, floors


def reference(job):
    """The undivided frame under a ground linear between samples, by its modes."""
    mass, damping, stiffness = (
        np.array(job[name]).reshape(3, 3) for name in ("mass", "damping", "stiffness")
    )
    inverse = np.linalg.inv(mass)
    a = np.block([[np.zeros((3, 3)), np.eye(3)], [-inverse @ stiffness, -inverse @ damping]])
    b = np.concatenate([np.zeros(3), -np.ones(3)])
    poles, vectors = np.linalg.eig(a)
    modal = np.linalg.solve(vectors, b.astype(complex))
    decay = np.exp(poles * STEP)
    held = (decay - 1.0) / poles * modal
    ramp = ((decay - 1.0) / poles - STEP) / (poles * STEP) * modal
    ground, state = job["ground"], np.zeros(6, complex)
    states = np.empty((len(ground), 6), complex)
    for k in range(len(ground)):
        states[k] = state
        if k + 1 < len(ground):
            state = decay * state + held * ground[k] + ramp * (ground[k + 1] - ground[k])
    return (states @ vectors.T).real[:, :3]


def scores(measured, floors, wanted):
    """J1 to J9, rounded as the published program rounds them."""

    def deviation(signal, of):
        return round(100 * np.std(signal - of, ddof=1) / np.std(of, ddof=1), 2)

    def peak(signal, of):
        return round(100 * np.max(np.abs(signal - of)) / np.max(np.abs(of)), 2)

    desired, n = floors[:, 0], len(measured)
    fit = [np.corrcoef(measured[j:], desired[: n - j])[0, 1] for j in range(50)]
    return [
        round(1000 * STEP * int(np.argmax(fit)), 1),
        deviation(measured, desired),
        peak(measured, desired),
        deviation(measured, wanted[:, 0]),
        peak(measured, wanted[:, 0]),
        deviation(floors[:, 1], wanted[:, 1]),
        deviation(floors[:, 2], wanted[:, 2]),
        peak(floors[:, 1], wanted[:, 1]),
        peak(floors[:, 2], wanted[:, 2]),
    ]


if __name__ == "__main__":
    job = json.load(open(sys.argv[1]))
    archives = {archive.name: archive for archive in map(Archive, sys.argv[2:])}
    measured, floors = loop(archives, job)
    check(np.all(np.isfinite(measured)), "the loop is not stable")
    print("RESULT " + json.dumps(scores(measured, floors, reference(job))))
