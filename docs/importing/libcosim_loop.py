"""Three-variable control of the shake table in libcosim (through libcosimpy; FMI 2.0).

    python libcosim_loop.py FMUS/fmi2/ShakeTable.fmu FMUS/fmi2/ThreeVariableControl.fmu

libcosim is a Jacobi master as well, see ecos_loop.py. It knows variables by their references, which
are those of modelDescription.xml.
"""

import sys
import xml.etree.ElementTree as ElementTree
import zipfile

from libcosimpy.CosimExecution import CosimExecution
from libcosimpy.CosimLogging import CosimLogLevel, log_output_level
from libcosimpy.CosimManipulator import CosimManipulator
from libcosimpy.CosimObserver import CosimObserver
from libcosimpy.CosimSlave import CosimLocalSlave
from motion import DURATION, STEP, reference, report


def references(path):
    with zipfile.ZipFile(path) as archive:
        root = ElementTree.fromstring(archive.read("modelDescription.xml"))
    return {v.get("name"): int(v.get("valueReference")) for v in root.iter("ScalarVariable")}


def main(table_file, control_file, step=STEP / 4):
    execution = CosimExecution.from_step_size(round(step * 1e9))
    table = execution.add_local_slave(CosimLocalSlave(fmu_path=table_file, instance_name="table"))
    control = execution.add_local_slave(
        CosimLocalSlave(fmu_path=control_file, instance_name="control")
    )
    of_table, of_control = references(table_file), references(control_file)
    for name in ("displacement", "velocity", "acceleration"):
        execution.connect_real_variables(
            output_slave_index=table,
            output_variable_reference=of_table[name],
            input_slave_index=control,
            input_variable_reference=of_control[f"measured_{name}"],
        )
    execution.connect_real_variables(
        output_slave_index=control,
        output_variable_reference=of_control["valve_command"],
        input_slave_index=table,
        input_variable_reference=of_table["valve_command"],
    )
    observer, manipulator = CosimObserver.create_last_value(), CosimManipulator.create_override()
    execution.add_observer(observer)
    execution.add_manipulator(manipulator)
    inputs = [of_control[f"reference_{n}"] for n in ("displacement", "velocity", "acceleration")]
    rows = []
    for tick in range(round(DURATION / step)):
        wanted = reference(tick * step)
        manipulator.slave_real_values(control, inputs, wanted)
        execution.step()
        # What is observed after the step belongs to its end.
        reached = observer.last_real_values(table, [of_table["displacement"]])[0]
        rows.append((reference((tick + 1) * step)[0], reached))
    return report(rows)


if __name__ == "__main__":
    log_output_level(CosimLogLevel.WARNING)
    main(*sys.argv[1:])
