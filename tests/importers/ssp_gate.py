"""SSP archives in ecos, libcosim or fmpy, beside the results of a run.

Usage: ssp_gate.py PROGRAM STEP FILE.ssp RESULTS.csv [FILE.ssp RESULTS.csv]...
"""

import os
import sys
import tempfile
import zipfile
import xml.etree.ElementTree as ElementTree

import numpy as np
from fmpy import read_model_description

LIMIT = 1e-9


def components(folder):
    """Descriptions of the components by name."""
    root = ElementTree.parse(os.path.join(folder, "SystemStructure.ssd")).getroot()
    return {
        element.get("name"): read_model_description(
            os.path.join(folder, element.get("source")), validate=False)
        for element in root.iter("{http://ssp-standard.org/SSP1/SystemStructureDescription}Component")
    }


def wanted(results, parts):
    """Columns of real outputs: name, component, variable."""
    columns = []
    for column in results.dtype.names[1:]:
        component, _, variable = column.partition(".")
        found = [v for v in parts.get(component).modelVariables if v.name == variable] \
            if component in parts and component != "reference" else []
        if found and found[0].type in ("Real", "Float64") and found[0].causality == "output":
            columns.append((column, component, found[0]))
    return columns


def in_ecos(path, folder, step, rows, columns):
    from ecospy import EcosSimulation

    values = np.zeros((rows, len(columns)))
    with EcosSimulation(ssp_path=path, step_size=step) as simulation:
        simulation.init(parameter_set="parameters")
        for row in range(rows):
            values[row] = [simulation.get_real(f"{c}::{v.name}") for _, c, v in columns]
            simulation.step()
    return values


def in_libcosim(path, folder, step, rows, columns):
    from libcosimpy.CosimExecution import CosimExecution
    from libcosimpy.CosimLogging import CosimLogLevel, log_output_level
    from libcosimpy.CosimObserver import CosimObserver

    log_output_level(CosimLogLevel.ERROR)
    execution = CosimExecution.from_ssp_file(folder, round(step * 1e9))
    observer = CosimObserver.create_last_value()
    execution.add_observer(observer)
    slaves = {c: execution.slave_index_from_instance_name(c) for c in {c for _, c, _ in columns}}
    by_slave = {c: [k for k, (_, own, _) in enumerate(columns) if own == c] for c in slaves}
    values = np.full((rows, len(columns)), np.nan)
    # Before the first step it shows nothing.
    for row in range(1, rows):
        assert execution.step(), "stepping failed"
        for component, places in by_slave.items():
            references = [columns[k][2].valueReference for k in places]
            values[row, places] = observer.last_real_values(slaves[component], references)
    return values


def main():
    program, step, *rest = sys.argv[1:]
    run = {"ecos": in_ecos, "libcosim": in_libcosim}[program]
    failures = 0
    for path, csv in zip(rest[::2], rest[1::2]):
        results = np.genfromtxt(csv, delimiter=",", names=True, deletechars="", replace_space=" ")
        with tempfile.TemporaryDirectory() as folder:
            with zipfile.ZipFile(path) as archive:
                archive.extractall(folder)
            columns = wanted(results, components(folder))
            rows = len(results)
            values = run(path, folder, float(step), rows, columns)
        worst = 0.0, ""
        moving = 0
        for place, (column, _, _) in enumerate(columns):
            ours, theirs = results[column], values[:, place]
            seen = ~np.isnan(theirs)
            size = np.abs(ours).max()
            moving += size > 0
            error = np.abs(ours - theirs)[seen].max() / max(size, 1e-12)
            worst = max(worst, (error, column))
        name = os.path.basename(path)
        good = worst[0] < LIMIT and moving >= 3 and len(columns) >= 3
        failures += not good
        print(f"{'ok' if good else 'FAILED'} {name} in {program}: {len(columns)} outputs, "
              f"{rows} rows, {moving} move, worst {worst[0]:.2g} ({worst[1]})")
    raise SystemExit(1 if failures else 0)


if __name__ == "__main__":
    main()
