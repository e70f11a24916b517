"""Every FMU of version 2.0 steps in libcosim and gives what the code without FMI gives."""

import sys

import numpy as np
from common import check, main, run_without_fmi
from libcosimpy.CosimEnums import CosimExecutionState
from libcosimpy.CosimExecution import CosimExecution
from libcosimpy.CosimLogging import CosimLogLevel, log_output_level
from libcosimpy.CosimObserver import CosimObserver
from libcosimpy.CosimSlave import CosimLocalSlave

STEPS = 100


def steps_in_libcosim(archive):
    # libcosim counts whole nanoseconds, and 1/4096 s is none; FMUs take multiples of their step.
    several = next(n for n in range(1, 1025) if (n * archive.step * 1e9).is_integer())
    nanoseconds = several * archive.step * 1e9
    inputs, outputs = archive.variables("input"), archive.variables("output")
    row = [0.02 * (i + 1) * float(v.nominal or 1.0) for i, v in enumerate(inputs)]
    references = [v.valueReference for v in outputs]
    expected = run_without_fmi(archive, np.tile(row, (several * STEPS, 1)), references)[-1]
    execution = CosimExecution.from_step_size(round(nanoseconds))
    slave = execution.add_local_slave(CosimLocalSlave(fmu_path=archive.path, instance_name="it"))
    observer = CosimObserver.create_last_value()
    check(execution.add_observer(observer), "observer")
    for variable, value in zip(inputs, row):
        check(execution.real_initial_value(slave, variable.valueReference, value), variable.name)
    check(execution.step(step_count=STEPS), "stepping failed")
    check(execution.status().state != CosimExecutionState.ERROR.value, "execution in error")
    values = np.array(observer.last_real_values(slave, references))
    check(np.any(expected != 0), "the excitation does nothing")
    error = np.abs(values - expected).max() / np.abs(expected).max()
    # Noise is drawn once a step, however long it is: values of another number of steps are others.
    if several > 1 and "seed" in archive.references:
        check(np.isfinite(values).all(), f"{values}")
        return f"{several} of its steps at a time, with noise of its own"
    # Longer steps are not several shorter ones for a component that integrates over any step.
    check(error < (1e-9 if several == 1 else 5e-3), f"{values} against {expected}")
    return f"{several} of its steps at a time, largest difference {error:.1g}"


if __name__ == "__main__":
    log_output_level(CosimLogLevel.WARNING)
    main([steps_in_libcosim], sys.argv[1:])
