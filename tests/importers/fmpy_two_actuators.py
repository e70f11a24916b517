"""Hybrid simulation with two actuators in a loop of fmpy's own: the parts as FMUs, called one after another.

Arguments: JOB.json FMU...; the job has `ground` (m/s2, one value per sample). Prints RESULT and, as JSON, the strokes of
both actuators and the target of the second, m.
"""

import json
import sys

from common import Archive

STEP = 1.0 / 1024.0
PAIR = "{0}[1] {0}[2]"


class Part:
    """An instance with its inputs and outputs by name."""

    def __init__(self, archive, inputs, outputs, **choices):
        self.instance = archive.open()
        if archive.is2:
            self.instance.fmu.setupExperiment(startTime=0.0)
        for name, value in choices.items():
            self.instance.set_choice(name, value)
        if archive.is2:
            self.instance.fmu.enterInitializationMode()
        else:
            self.instance.fmu.enterInitializationMode(startTime=0.0)
        self.instance.fmu.exitInitializationMode()
        self.inputs = [archive.references[name] for name in inputs.split()]
        self.outputs = [archive.references[name] for name in outputs.split()]

    def get(self):
        return self.instance.get(self.outputs)

    def step(self, time, values):
        self.instance.set(self.inputs, values)
        self.instance.fmu.doStep(currentCommunicationPoint=time, communicationStepSize=STEP)
        return self.get()


def loop(archives, ground):
    plant = Part(archives["CoupledActuators"], PAIR.format("command"), PAIR.format("stroke"))
    sensors = Part(archives["StrokeSensors"], PAIR.format("stroke"), PAIR.format("measured_stroke"))
    kinematics = archives["PlatformKinematics"]
    back = Part(kinematics, PAIR.format("measured_stroke"), "found_translation[1] found_rotation[3]", way_back=1)
    ahead = Part(kinematics, "translation[1] rotation[3]", PAIR.format("stroke"))
    specimen = Part(archives["FrameSpecimen"], "translation rotation", "force moment other_moment")
    frame = Part(
        archives["FrameSubstructure"],
        "force moment other_moment ground_acceleration",
        "translation rotation",
    )
    control = Part(
        archives["CoupledTracking"],
        PAIR.format("target") + " " + PAIR.format("measured_stroke"),
        PAIR.format("command"),
    )
    histories = [[], [], []]
    for k, now in enumerate(ground):
        time = k * STEP
        stroke = list(plant.get())
        measured = list(sensors.step(time, stroke))
        force = list(specimen.step(time, list(back.step(time, measured))))
        target = list(ahead.step(time, list(frame.step(time, [*force, now]))))
        plant.step(time, list(control.step(time, target + measured)))
        for history, value in zip(histories, [*stroke, target[1]]):
            history.append(value)
    return histories


if __name__ == "__main__":
    job = json.load(open(sys.argv[1]))
    archives = {archive.name: archive for archive in map(Archive, sys.argv[2:])}
    print("RESULT " + json.dumps(loop(archives, job["ground"])))
