"""How fast this master is beside ecos and libcosim: same FMUs, same outputs recorded, in one run.

Usage: speed.py PROGRAM [--steps N] [--rounds N] [--check] [--own-part]

1. A ring of four FMUs that do next to nothing (speed/trivial.c, compiled here), Jacobi order, fixed step,
   all four outputs recorded at every step. `memory` is the stepping with values kept in memory, `file`
   with a CSV written: the time of N steps less that of a tenth of them. ecos keeps nothing in memory.
2. What this master adds to a call of FMI: systems run with all outputs recorded, against the same calls
   with the same values made by a C program in a loop (speed/replay.c, from a trace of the run).

Masters take turns; of each the fastest round counts, for what else the machine does only adds. With
--check the ratios are compared with what they should be. Where the processors are busy with other work,
an FMU in another process waits for its turn at each call: measure on a quiet machine.
"""

import argparse
import csv
import json
import os
import re
import subprocess
import sys
import tempfile
import time
import xml.etree.ElementTree as ElementTree
import zipfile
from pathlib import Path

STEP = 1e-3
PARTS = ["a", "b", "c", "d"]
HERE = Path(__file__).parent
# At least so many times as fast.
WANTED = {"ecos": 10, "libcosim": 100, "isolated": 1}
# Systems of which the cost of a call is measured, and the most that may be added to one, ns.
SYSTEMS = ["three-variable", "mpc"]
MOST_ADDED = 10


def compile_c(*arguments):
    subprocess.run([os.environ.get("CC", "cc"), "-O2", *arguments], check=True)


def pack(folder):
    """Compiles the trivial FMU."""
    library = folder / "trivial.so"
    compile_c("-shared", "-fPIC", "-w", "-o", library, HERE / "speed/trivial.c")
    path = folder / "trivial.fmu"
    description = """<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="trivial" guid="{1}" generationTool="by hand">
<CoSimulation modelIdentifier="trivial" canHandleVariableCommunicationStepSize="true"/>
<ModelVariables>
<ScalarVariable name="y" valueReference="0" causality="output" variability="continuous" initial="exact"><Real start="1"/></ScalarVariable>
<ScalarVariable name="u" valueReference="1" causality="input" variability="continuous"><Real start="0"/></ScalarVariable>
</ModelVariables>
<ModelStructure><Outputs><Unknown index="1" dependencies=""/></Outputs></ModelStructure>
</fmiModelDescription>"""
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("modelDescription.xml", description)
        archive.write(library, "binaries/linux64/trivial.so")
    return path


def starts():
    """Where the output of each part begins, so that the ring has something to settle."""
    return {part: float(place) for place, part in enumerate(PARTS)}


def ring():
    """What drives what: part, and the one before it."""
    return zip(PARTS, PARTS[-1:] + PARTS[:-1])


class Ours:
    def __init__(self, program, folder, isolation):
        self.program, self.folder, self.isolation = program, folder, isolation
        links = "".join(f'"{before}.y -> {part}.u",' for part, before in ring())
        parts = "".join(f'[components.{part}]\nfmu = "trivial.fmu"\nparameters = {{ y = {start} }}\n'
                        for part, start in starts().items())
        (folder / "ring.toml").write_text(f"connections = [{links}]\n{parts}")

    def run(self, fmu, steps):
        begin = time.perf_counter()
        out = self.folder / f"ours-{self.isolation}"
        done = subprocess.run(
            [self.program, "run", self.folder / "ring.toml", "--algorithm", "jacobi", "--isolate",
             self.isolation, "--step", f"{STEP} s", "--duration", f"{steps * STEP} s", "--out", out, "--json",
             "--force"],
            stdout=subprocess.PIPE, text=True, check=True)
        whole = time.perf_counter() - begin
        with open(out / "results.csv", newline="") as file:
            rows = csv.reader(file)
            names = next(rows)
            *_, last = rows
        row = dict(zip(names, last))
        values = [float(row[f"{part}.y"]) for part in PARTS]
        return {"memory": json.loads(done.stdout)["wall_s"], "file": whole}, values


class Ecos:
    def __init__(self, folder):
        self.folder = folder

    def simulation(self, fmu):
        from ecospy import EcosSimulation, EcosSimulationStructure

        structure = EcosSimulationStructure()
        for part in PARTS:
            structure.add_model(part, fmu)
        for part, before in ring():
            structure.make_real_connection(f"{before}::y", f"{part}::u")
        structure.add_parameter_set("starts", {f"{part}::y": start for part, start in starts().items()})
        return structure, EcosSimulation(structure=structure, step_size=STEP)

    def run(self, fmu, steps):
        times = {}
        for way in ("memory", "file"):
            structure, simulation = self.simulation(fmu)
            with structure, simulation:
                if way == "file":
                    simulation.add_csv_writer(str(self.folder / "ecos.csv"), identifiers=[f"{p}::y" for p in PARTS])
                begin = time.perf_counter()
                simulation.init(parameter_set="starts")
                simulation.step(steps)
                values = [simulation.get_real(f"{part}::y") for part in PARTS]
                simulation.terminate()
                times[way] = time.perf_counter() - begin
        return times, values


class Libcosim:
    def __init__(self, folder):
        self.folder = folder

    def run(self, fmu, steps):
        from libcosimpy.CosimEnums import CosimVariableType
        from libcosimpy.CosimExecution import CosimExecution
        from libcosimpy.CosimLogging import CosimLogLevel, log_output_level
        from libcosimpy.CosimObserver import CosimObserver
        from libcosimpy.CosimSlave import CosimLocalSlave

        log_output_level(CosimLogLevel.ERROR)
        execution = CosimExecution.from_step_size(round(STEP * 1e9))
        slaves = {part: execution.add_local_slave(CosimLocalSlave(fmu_path=str(fmu), instance_name=part))
                  for part in PARTS}
        for part, before in ring():
            assert execution.connect_real_variables(slaves[before], 0, slaves[part], 1) == 0
        for part, start in starts().items():
            assert execution.real_initial_value(slaves[part], 0, start)
        observer = CosimObserver.create_time_series(buffer_size=steps)
        assert execution.add_observer(observer)
        for slave in slaves.values():
            assert observer.start_time_series(slave, 0, CosimVariableType.REAL)
        begin = time.perf_counter()
        assert execution.step(step_count=steps)
        taken = time.perf_counter() - begin
        values = [observer.time_series_real_samples(slave, 0, steps, 1)[2][-1] for slave in slaves.values()]
        return {"memory": taken}, values


class Replay:
    """A system of ours, and the same calls without a master."""

    # How the trace names calls, and how `replay.c` does.
    KINDS = {"GetReal": "r", "SetReal": "w", "SetInteger": "i", "SetBoolean": "b", "DoStep": "s",
             "SetupExperiment": "e", "EnterInitializationMode": "n", "ExitInitializationMode": "x"}

    def __init__(self, program, folder, system, duration):
        self.folder = folder / system
        self.folder.mkdir()
        self.command = [program, "run", system, "--fmi", "2", "--duration", f"{duration} s", "--force", "--json",
                        "--out", self.folder / "out"]
        trace = self.folder / "trace"
        subprocess.run([*self.command, "--trace", trace], capture_output=True, check=True)
        self.calls = self.folder / "calls"
        self.last = {}
        with open(self.calls, "w") as file:
            self.write(file, trace)
        self.replay = self.folder / "replay"
        compile_c("-o", self.replay, HERE / "speed/replay.c", "-ldl")

    def write(self, file, trace):
        components = json.loads((self.folder / "out/manifest.json").read_text())["components"]
        self.names = list(components)
        for place, (name, component) in enumerate(components.items()):
            unpacked = self.folder / name
            with zipfile.ZipFile(component["fmu"]) as archive:
                archive.extractall(unpacked)
            root = ElementTree.parse(unpacked / "modelDescription.xml").getroot()
            identifier = root.find("CoSimulation").get("modelIdentifier")
            file.write(f"library {unpacked}/binaries/linux64/{identifier}.so\n")
            resources = (unpacked / "resources").as_uri()
            file.write(f"instance {name} {root.get('guid')} {resources} {place}\n")
        line_of = re.compile(r"(\S+) fmi2(\w+)\((.*?)\) -> 0(.*)")
        number = re.compile(r"[-\w.+]+")
        for line in trace.read_text().splitlines():
            name, call, arguments, given = line_of.fullmatch(line).groups()
            kind = self.KINDS.get(call)
            if kind is None:
                continue
            lists = [number.findall(part) for part in re.findall(r"\[(.*?)\]", arguments)]
            if kind == "e":
                start, stop = re.match(r"start (\S+), stop (\S+),", arguments).groups()
                words = [start, stop]
            elif kind == "s":
                words = arguments.split(", ")
            else:
                values = {"true": "1", "false": "0"}
                words = [word for part in lists for word in [str(len(part)), *(values.get(v, v) for v in part)]]
            if kind == "r":
                self.last[name] = float(number.findall(given)[-1])
            file.write(" ".join([str(self.names.index(name)), kind, *words]) + "\n")

    def run(self):
        """Seconds of a run and of its calls alone, and how many calls."""
        done = subprocess.run(self.command, capture_output=True, text=True, check=True)
        alone = subprocess.run([self.replay, self.calls, "5"], capture_output=True, text=True, check=True)
        *times, count = alone.stdout.split()[: -len(self.names)]
        for name, value in zip(self.names, alone.stdout.split()[-len(self.names):]):
            assert self.last.get(name, float(value)) == float(value), f"the replay of {name} went another way"
        return json.loads(done.stdout)["wall_s"], min(map(float, times)), int(count)


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("program")
    parser.add_argument("--steps", type=int, default=20_000)
    parser.add_argument("--rounds", type=int, default=7)
    parser.add_argument("--check", action="store_true")
    parser.add_argument("--own-part", action="store_true", help="only what this master adds to a call of the ring")
    options = parser.parse_args()
    program = Path(options.program).resolve()
    failures = []
    with tempfile.TemporaryDirectory() as folder:
        failures += measure_own_part(program, Path(folder), options)
        if not options.own_part:
            failures += measure_ring(program, Path(folder), options)
        for system in [] if options.own_part else SYSTEMS:
            failures += measure_calls(program, Path(folder), system, options)
    for failure in failures:
        print(f"FAILED {failure}")
    sys.exit(1 if options.check and failures else 0)


def measure_own_part(program, folder, options):
    """What a call of the ring takes in a loop of C, and what this master adds to it."""
    master, fmu, steps = Ours(program, folder, "none"), pack(folder), 20 * options.steps
    alone = folder / "ring"
    compile_c("-o", alone, HERE / "speed/ring.c", "-ldl")
    lengths = (steps // 10, steps)
    taken = {(who, length): [] for who in ("alone", "ours") for length in lengths}
    for _ in range(options.rounds):
        for length in lengths:
            done = subprocess.run([alone, folder / "trivial.so", str(length), "3"], capture_output=True, text=True,
                                  check=True)
            *times, a, b, c, d = map(float, done.stdout.split())
            taken["alone", length] += times
            memory, values = master.run(fmu, length)
            taken["ours", length].append(memory["memory"])
            assert values == [a, b, c, d], f"the loop gives {[a, b, c, d]}, the master {values}"
    calls = 3 * len(PARTS) * (lengths[1] - lengths[0])
    ours, loop = (1e9 * (min(taken[who, lengths[1]]) - min(taken[who, lengths[0]])) / calls
                  for who in ("ours", "alone"))
    added = ours - loop
    print(f"ring of four, fastest of {options.rounds} rounds: {loop:.2f} ns a call in a loop of C, {added:.2f} ns "
          f"more in this master")
    print("RESULT " + json.dumps({"system": "ring", "added_ns": added, "alone_ns": loop}))
    return [f"{added:.1f} ns are added to a call of the ring"] if added > MOST_ADDED else []


def measure_ring(program, folder, options):
    fmu = pack(folder)
    masters = {
        "ours": (Ours(program, folder, "none"), 10 * options.steps),
        "ours, isolated": (Ours(program, folder, "all"), max(options.steps // 10, 100)),
        "ecos": (Ecos(folder), options.steps),
        "libcosim": (Libcosim(folder), max(options.steps // 10, 100)),
    }
    runs = {}
    for _ in range(options.rounds):
        for name, (master, steps) in masters.items():
            for length in (steps // 10, steps):
                for way, taken in master.run(fmu, length)[0].items():
                    runs.setdefault((name, way), {}).setdefault(length, []).append(taken)
    each = {}
    for key, lengths in runs.items():
        (few, short), (many, long) = sorted(lengths.items())
        each[key] = (min(long) - min(short)) / (many - few)
    failures = report(each, options.rounds)
    values = {name: master.run(fmu, 1000)[1] for name, (master, _) in masters.items()}
    for name, row in values.items():
        if any(abs(one - other) > 1e-12 for one, other in zip(row, values["ours"])):
            failures.append(f"{name} gives {row}, ours {values['ours']}")
    return failures


def measure_calls(program, folder, system, options):
    replay = Replay(program, folder, system, 20)
    rounds = [replay.run() for _ in range(options.rounds)]
    calls = rounds[0][2]
    run, alone = (1e9 * min(taken) / calls for taken in list(zip(*rounds))[:2])
    added = run - alone
    print(f"{system}, {calls} calls: {alone:.1f} ns a call by themselves, {added:.1f} ns more in a run")
    print("RESULT " + json.dumps({"system": system, "added_ns": added, "alone_ns": alone}))
    return [f"{added:.1f} ns are added to a call of {system}"] if added > MOST_ADDED else []


def report(each, rounds):
    """Prints times of a step and ratios; gives those that fall short."""
    print(f"ring of four, fastest of {rounds} rounds; microseconds a step")
    for (name, way), taken in each.items():
        print(f"  {name:16} {way:7} {1e6 * taken:9.3f}")
    ours = each["ours", "memory"]
    ratios = {
        "ecos": each["ecos", "memory"] / ours,
        "libcosim": each["libcosim", "memory"] / ours,
        "isolated": each["libcosim", "memory"] / each["ours, isolated", "memory"],
    }
    print(f"in memory, ecos over ours: {ratios['ecos']:.1f} (ecos records nothing there)")
    print(f"to a CSV, ecos over ours: {each['ecos', 'file'] / each['ours', 'file']:.1f}")
    print(f"in memory, libcosim over ours: {ratios['libcosim']:.1f}")
    print(f"libcosim in process over ours in another process: {ratios['isolated']:.2f}")
    print("RESULT " + json.dumps({"ratios": ratios, "step_us": {f"{n}, {w}": 1e6 * t for (n, w), t in each.items()}}))
    return [f"{name} is {ratios[name]:.2f}, wanted {least}" for name, least in WANTED.items() if ratios[name] < least]


if __name__ == "__main__":
    main()
