"""Three-variable control of the shake table in ecos.

    python ecos_loop.py FMUS/fmi3/ShakeTable.fmu FMUS/fmi3/ThreeVariableControl.fmu

ecos is a Jacobi master: it steps all components at once and then passes values on, so every connection
is a step late: the controller sees the table of the sample before, and the table the command of the
sample before. The step is a quarter of the controller's period to keep that delay short.
"""

import sys

from ecospy import EcosSimulation, EcosSimulationStructure
from motion import DURATION, STEP, reference, report

CONNECTIONS = [
    ("table::displacement", "control::measured_displacement"),
    ("table::velocity", "control::measured_velocity"),
    ("table::acceleration", "control::measured_acceleration"),
    ("control::valve_command", "table::valve_command"),
]


def main(table_file, control_file, step=STEP / 4):
    rows = []
    with EcosSimulationStructure() as structure:
        structure.add_model("table", table_file)
        structure.add_model("control", control_file)
        for source, sink in CONNECTIONS:
            structure.make_real_connection(source, sink)
        with EcosSimulation(structure=structure, step_size=step) as simulation:
            simulation.init()
            for tick in range(round(DURATION / step)):
                wanted = reference(tick * step)
                names = ("displacement", "velocity", "acceleration")
                for name, value in zip(names, wanted):
                    simulation.set_real(f"control::reference_{name}", value)
                rows.append((wanted[0], simulation.get_real("table::displacement")))
                simulation.step()
    return report(rows)


if __name__ == "__main__":
    main(*sys.argv[1:])
