"""Every FMU of both versions steps in ecos and gives what the code without FMI gives."""

import sys

import numpy as np
from common import check, main, run_without_fmi
from ecospy import EcosSimulation, EcosSimulationStructure

STEPS = 100


def steps_in_ecos(archive):
    inputs, outputs = archive.variables("input"), archive.variables("output")
    row = [0.02 * (i + 1) * float(v.nominal or 1.0) for i, v in enumerate(inputs)]
    expected = run_without_fmi(
        archive, np.tile(row, (STEPS, 1)), [v.valueReference for v in outputs])[-1]
    with EcosSimulationStructure() as structure:
        structure.add_model("it", archive.path)
        with EcosSimulation(structure=structure, step_size=archive.step) as simulation:
            simulation.init()
            for variable, value in zip(inputs, row):
                simulation.set_real(f"it::{variable.name}", value)
            for _ in range(STEPS):
                simulation.step()
            values = np.array([simulation.get_real(f"it::{v.name}") for v in outputs])
    check(np.any(expected != 0), "the excitation does nothing")
    error = np.abs(values - expected).max() / np.abs(expected).max()
    check(error < 1e-9, f"{values} against {expected}")
    return f"largest difference {error:.1g}"


if __name__ == "__main__":
    main([steps_in_ecos], sys.argv[1:])
