"""Three-variable control of the shake table in fmpy: a loop of your own.

    python fmpy_loop.py FMUS/fmi3/ShakeTable.fmu FMUS/fmi3/ThreeVariableControl.fmu

Within a sample the controller is called before the table moves, as on a real rig: no connection
adds a delay. The first component's outputs are read, the controller steps, then the table does.
"""

import shutil
import sys

from fmpy import extract, read_model_description
from fmpy.fmi3 import FMU3Slave
from motion import DURATION, STEP, reference, report


class Component:
    """A co-simulation instance whose variables are set and got by name."""

    def __init__(self, path, **parameters):
        description = read_model_description(path)
        self.references = {v.name: v.valueReference for v in description.modelVariables}
        self.folder = extract(path)
        self.fmu = FMU3Slave(
            guid=description.guid,
            unzipDirectory=self.folder,
            modelIdentifier=description.coSimulation.modelIdentifier,
            instanceName=description.modelName,
        )
        self.fmu.instantiate()
        if parameters:
            self.set(**parameters)
        self.fmu.enterInitializationMode(startTime=0.0)
        self.fmu.exitInitializationMode()

    def set(self, **values):
        self.fmu.setFloat64([self.references[name] for name in values], list(values.values()))

    def get(self, *names):
        return self.fmu.getFloat64([self.references[name] for name in names])

    def step(self, time):
        self.fmu.doStep(currentCommunicationPoint=time, communicationStepSize=STEP)

    def close(self):
        self.fmu.terminate()
        self.fmu.freeInstance()
        shutil.rmtree(self.folder, ignore_errors=True)


def main(table_file, control_file):
    table, control = Component(table_file), Component(control_file)
    rows = []
    for tick in range(round(DURATION / STEP)):
        time = tick * STEP
        displacement, velocity, acceleration = table.get("displacement", "velocity", "acceleration")
        wanted = reference(time)
        control.set(
            reference_displacement=wanted[0],
            reference_velocity=wanted[1],
            reference_acceleration=wanted[2],
            measured_displacement=displacement,
            measured_velocity=velocity,
            measured_acceleration=acceleration,
        )
        control.step(time)
        table.set(valve_command=control.get("valve_command")[0])
        table.step(time)
        rows.append((wanted[0], displacement))
    table.close()
    control.close()
    return report(rows)


if __name__ == "__main__":
    main(*sys.argv[1:])
