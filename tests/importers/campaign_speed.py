"""The same study by `shakebench campaign` and by fmpy under Dask, on as many processes, in one run.

Usage: campaign_speed.py PROGRAM [--fmus DIR] [--processes N] [--runs N] [--peer-runs N] [--check]

The study: three-variable control of the physical rig, 30 s a run; the motion's scale, the specimen's
stiffness and the oil's bulk modulus vary. fmpy makes the first runs of it, one a task: the same FMUs,
unpacked once a process, called from Python in the same order every 2 ms, and the same figure. Compared are
the figure, and the time of a run: of the clock (all processes at work), and of the processors, which other
work on the machine does not disturb. Package `shakebench` on PYTHONPATH.
"""

import argparse
import csv
import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from common import STEP, Archive, check
from distributed import Client, LocalCluster

DURATION = 30.0
# The motion of the nominal run; a power of two, so that scaling it is exact.
NOMINAL_SCALE = 0.25
STUDY = """[study]
design = "sobol"
runs = {runs}
seed = 1
[fixed]
plant = "servohydraulic"
controller = "three-variable"
duration = "30 s"
[factors]
scale = {{ uniform = [0.1, 0.25] }}
"specimen.stiffness" = {{ uniform = ["75 lbf/in", "95 lbf/in"] }}
"table.bulk_modulus" = {{ uniform = [0.95, 1.05], relative = true }}
"""
# At least so many times as fast, of the clock.
WANTED = 10
# Of the figure, relative: the reference is scaled in another order, which may turn a bit of a sensor.
BOUND = 1e-3

# Outputs and inputs of a tick, in the order in which they are got and set.
REFERENCE = ["reference_displacement", "reference_velocity", "reference_acceleration"]
MEASURED = ["measured_displacement", "measured_velocity", "measured_acceleration"]
SENSED = ["displacement", "velocity", "acceleration", "actuator_force", "specimen_acceleration"]
WATCHED = [
    "controller_command", "reference_displacement", *MEASURED, "measured_force", "specimen_acceleration",
    "supply_pressure",
]

ARCHIVES = {}


class Part:
    """An instance with the references of its variables at hand."""

    def __init__(self, file, parameters):
        if file not in ARCHIVES:
            ARCHIVES[file] = Archive(file)
        archive = ARCHIVES[file]
        self.instance = archive.open()
        self.fmu = self.instance.fmu
        self.references = archive.references
        types = {variable.name: variable for variable in archive.description.modelVariables}
        for name, (value, _) in parameters.items():
            if types[name].variability == "constant" or types[name].causality != "parameter":
                continue
            kind = types[name].type
            number = float(value) if kind in ("Float64", "Real") else int(value)
            setter = {"Enumeration": "Int64"}.get(kind, kind)
            getattr(self.fmu, f"set{setter}")([self.references[name]], [number])
        self.fmu.enterInitializationMode(startTime=0.0, stopTime=DURATION)
        self.fmu.exitInitializationMode()

    def of(self, *names):
        return [self.references[name] for name in names]

    def close(self):
        self.fmu.terminate()
        self.fmu.freeInstance()


def simulate(components, varied, reference):
    """A run in fmpy; the table's acceleration at every tick."""
    parts = {}
    for name, component in components.items():
        own = {key.split(".", 1)[1]: [value, None] for key, value in varied.items()
               if key.startswith(f"{name}.")}
        parts[name] = Part(component["fmu"], {**component["parameters"], **own})
    table, specimen, sensors = parts["table"], parts["specimen"], parts["sensors"]
    control, interlock = parts["control"], parts["interlock"]
    motion = table.of("displacement", "velocity", "actuator_force", "supply_pressure")
    acceleration, force = table.of("acceleration"), table.of("specimen_force")
    driven = table.of("valve_command", "specimen_force")
    specimen_out = specimen.of("force", "acceleration")
    specimen_in = specimen.of("table_acceleration")
    sensed = sensors.of(*SENSED)
    measured = sensors.of(*MEASURED, "measured_force", "measured_specimen_acceleration")
    valid = sensors.of("measurement_valid")
    wanted, command = control.of(*REFERENCE, *MEASURED), control.of("valve_command")
    watched, watched_valid = interlock.of(*WATCHED), interlock.of("measurement_valid")
    released, tripped = interlock.of("valve_command"), interlock.of("tripped")
    accelerations = np.empty(len(reference))
    for tick, (x, v, a) in enumerate(reference):
        now = tick * STEP
        load, specimen_acceleration = specimen.fmu.getFloat64(specimen_out)
        table.fmu.setFloat64(force, [load])
        displacement, velocity, actuator, supply = table.fmu.getFloat64(motion)
        accelerations[tick] = got = table.fmu.getFloat64(acceleration)[0]
        sensors.fmu.setFloat64(sensed, [displacement, velocity, got, actuator, specimen_acceleration])
        sensors.fmu.doStep(currentCommunicationPoint=now, communicationStepSize=STEP)
        seen = sensors.fmu.getFloat64(measured)
        is_valid = sensors.fmu.getBoolean(valid)
        control.fmu.setFloat64(wanted, [x, v, a, *seen[:3]])
        control.fmu.doStep(currentCommunicationPoint=now, communicationStepSize=STEP)
        valve = control.fmu.getFloat64(command)[0]
        interlock.fmu.setFloat64(watched, [valve, x, *seen, supply])
        interlock.fmu.setBoolean(watched_valid, is_valid)
        interlock.fmu.doStep(currentCommunicationPoint=now, communicationStepSize=STEP)
        check(not interlock.fmu.getBoolean(tripped)[0], f"the interlock tripped at {now} s")
        # What the continuous ones give each other is extrapolated to the middle of the step (docs/coupling.md).
        if tick == 0:
            load_before, got_before = load, got
        specimen.fmu.setFloat64(specimen_in, [1.5 * got - 0.5 * got_before])
        specimen.fmu.doStep(currentCommunicationPoint=now, communicationStepSize=STEP)
        table.fmu.setFloat64(driven, [interlock.fmu.getFloat64(released)[0], 1.5 * load - 0.5 * load_before])
        table.fmu.doStep(currentCommunicationPoint=now, communicationStepSize=STEP)
        load_before, got_before = load, got
    for part in parts.values():
        part.close()
    return accelerations


def task(components, varied, nominal):
    """Time-domain error (%) of a run and what it cost the processor (s)."""
    begun = time.process_time()
    reference = nominal * (varied["scale"] / NOMINAL_SCALE)
    accelerations = simulate(components, varied, reference)
    error = reference[:, 2] - accelerations
    percent = 100 * np.sqrt(np.mean(error**2)) / np.max(np.abs(reference[:, 2]))
    return percent, time.process_time() - begun


def nominal(program, folder):
    """Components with their parameters, and the reference, of the rig that nothing was varied on."""
    out = folder / "nominal"
    subprocess.run([program, "run", "three-variable", "--plant", "servohydraulic", "--duration", f"{DURATION} s",
                    "--scale", str(NOMINAL_SCALE), "--out", out], check=True, stdout=subprocess.DEVNULL,
                   stderr=subprocess.DEVNULL)
    manifest = json.loads((out / "manifest.json").read_text())
    with open(out / "results.csv", newline="") as file:
        rows = csv.reader(file)
        names = next(rows)
        places = [names.index(f"reference.{name}") for name in ("displacement", "velocity", "acceleration")]
        reference = np.array([[float(row[place]) for place in places] for row in rows])
    components = manifest["components"]
    # The master's seed goes to whatever draws.
    components["sensors"]["parameters"].setdefault("seed", [1, None])
    return components, reference


def used():
    """Processor time of ended child processes, s."""
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime


def local(program, study, out, processes):
    """Seconds a run of the clock and of the processors, and the rows."""
    clock, processor = time.perf_counter(), used()
    subprocess.run([program, "campaign", study, "--out", out, "--jobs", str(processes), "--json"], check=True,
                   stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    clock, processor = time.perf_counter() - clock, used() - processor
    with open(out / "runs.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    check(all(row["ended"] == "complete" for row in rows), "a run did not end complete")
    return clock / len(rows), processor / len(rows), rows


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("program")
    parser.add_argument("--fmus")
    parser.add_argument("--processes", type=int, default=os.cpu_count())
    parser.add_argument("--runs", type=int, default=256)
    parser.add_argument("--peer-runs", type=int, default=8)
    parser.add_argument("--check", action="store_true")
    options = parser.parse_args()
    program = str(Path(options.program).resolve())
    os.environ["SHAKEBENCH_PROGRAM"] = program
    if options.fmus:
        os.environ["SHAKEBENCH_FMUS"] = str(Path(options.fmus).resolve())
    import shakebench

    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        study = folder / "study.toml"
        study.write_text(STUDY.format(runs=options.runs))
        components, reference = nominal(program, folder)
        clock, processor, rows = local(program, study, folder / "local", options.processes)

        cluster = LocalCluster(n_workers=options.processes, threads_per_worker=1, dashboard_address=None)
        with cluster, Client(cluster) as client:
            begun = time.perf_counter()
            together = shakebench.campaign(study, client, out=folder / "dask")
            dask_clock = (time.perf_counter() - begun) / len(rows)
            same = (folder / "local/runs.csv").read_bytes() == (folder / "dask/runs.csv").read_bytes()
            check(same, "the results on Dask are not those of the local run")

            peers = rows[: options.peer_runs]
            varied = [{key.split(" [")[0]: float(value) for key, value in row.items()
                       if key.split(" [")[0] in ("scale", "specimen.stiffness", "table.bulk_modulus")}
                      for row in peers]
            client.upload_file(str(Path(__file__).with_name("common.py")))
            client.upload_file(__file__)
            kept = client.scatter(reference, broadcast=True)
            begun = time.perf_counter()
            found = client.gather(client.map(task, [components] * len(varied), varied, [kept] * len(varied)))
            peer_clock = (time.perf_counter() - begun) / len(peers)
    peer_processor = sum(taken for _, taken in found) / len(found)
    apart = max(abs(percent / float(row["time_domain_percent"]) - 1) for (percent, _), row in zip(found, peers))
    ratios = {"clock": peer_clock / clock, "dask": peer_clock / dask_clock, "processor": peer_processor / processor}
    print(f"{options.processes} processes; seconds a run of {DURATION:.0f} s, of the clock (of the processors)")
    print(f"  shakebench campaign          {clock:8.4f} ({processor:.4f}), {len(rows)} runs")
    print(f"  shakebench.campaign on Dask  {dask_clock:8.4f}, overhead {100 * together['dask']['overhead']:.1f} %")
    print(f"  fmpy on Dask                 {peer_clock:8.4f} ({peer_processor:.4f}), {len(peers)} runs")
    print(f"figure apart by {apart:.1e} of itself at most")
    print(f"fmpy takes {ratios['clock']:.0f} times as long ({ratios['dask']:.0f} with both on Dask, "
          f"{ratios['processor']:.0f} times the processors' time)")
    print("RESULT " + json.dumps({"ratios": ratios, "apart": apart, "dask": together["dask"]}))
    check(apart < BOUND, f"the figures are {apart:.1e} apart")
    if options.check and ratios["clock"] < WANTED:
        sys.exit(f"FAILED {ratios['clock']:.1f} times as fast, wanted {WANTED}")


if __name__ == "__main__":
    main()
