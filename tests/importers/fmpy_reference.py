"""Runs an FMU in fmpy and writes what it computes, every number with all its digits.

    fmpy_reference.py FMU OUT.csv STEP STOP CoSimulation|ModelExchange [NAME=VALUE ...]
"""
import csv
import sys

from fmpy import read_model_description, simulate_fmu

path, out, step, stop, kind = sys.argv[1:6]
start_values = dict(pair.split("=", 1) for pair in sys.argv[6:])
description = read_model_description(path, validate=False)
names = [v.name for v in description.modelVariables if v.causality == "output" and v.type != "Clock"]
# fmpy records no texts.
names = [v.name for v in description.modelVariables if v.name in names and v.type not in ("String", "Binary")]
result = simulate_fmu(
    path,
    start_time=0,
    stop_time=float(stop),
    output_interval=float(step),
    fmi_type=kind,
    output=names,
    start_values=start_values,
    relative_tolerance=1e-10 if kind == "ModelExchange" else None,
    record_events=False,
)
with open(out, "w", newline="") as file:
    table = csv.writer(file)
    columns = ["time"]
    for name in names:
        width = result[name].reshape(len(result), -1).shape[1]
        is_array = result[name].ndim > 1
        columns += [f"{name}[{i + 1}]" for i in range(width)] if is_array else [name]
    table.writerow(columns)
    for row in result:
        cells = [repr(float(row["time"]))]
        for name in names:
            values = row[name].reshape(-1) if result[name].ndim > 1 else [row[name]]
            cells += [repr(float(value)) for value in values]
        table.writerow(cells)
