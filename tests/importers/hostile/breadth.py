"""Runs FMUs that misbehave in every way of `breadth.c` and in every function, each in a process of its own.

    breadth.py SHAKEBENCH [WORD...]    only cases with one of the words

The program must end by itself and in time, with status 0, 1 or 2, with what was computed before, a message
that names the FMU, and without a process that is left behind. Ends with status 1 where it does not.
"""
import json
import os
import subprocess
import sys
import tempfile
import time
import zipfile
from pathlib import Path

STEP = """segfault wild-call abort exit exit-3 quick-exit kill terminate interrupt pipe alarm fork forks
returns-twice daemon daemon-dies thread-spins thread-prints exit-thread longjmp traps trapped rounds closes
closes-output truncates unmaps handlers masks group session limits directory environment prints-much
prints-bytes memory frees-twice no-number sleep status-99 status-minus fatal error spin print stop stop-all
deep""".split()
ELSEWHERE = "segfault exit kill spin print stop fork daemon longjmp".split()
PLACES = "Instantiate EnterInitializationMode ExitInitializationMode Get Set Terminate FreeInstance".split()
CASES = [(2, what, "DoStep") for what in STEP]
CASES += [(2, what, place) for place in PLACES for what in ELSEWHERE]
CASES += [(3, what, "DoStep") for what in STEP[:20] + ["updates"]]
CASES += [(3, what, place) for place in PLACES for what in ("segfault", "spin")]
# These leave the FMU as it was.
HARMLESS = set("""fork forks returns-twice daemon thread-spins traps rounds truncates masks directory
environment prints-much prints-bytes handlers sleep updates""".split())
DESCRIPTION = {
    2: """<fmiModelDescription fmiVersion="2.0" modelName="breadth" guid="1"><CoSimulation
modelIdentifier="breadth" canHandleVariableCommunicationStepSize="true"/><ModelVariables>
<ScalarVariable name="y" valueReference="0" causality="output"><Real/></ScalarVariable>
<ScalarVariable name="u" valueReference="1" causality="input"><Real start="0.25"/></ScalarVariable>
</ModelVariables><ModelStructure><Outputs><Unknown index="1" dependencies=""/></Outputs></ModelStructure>
</fmiModelDescription>""",
    3: """<fmiModelDescription fmiVersion="3.0" modelName="breadth" instantiationToken="1"><CoSimulation
modelIdentifier="breadth" canHandleVariableCommunicationStepSize="true"/><ModelVariables>
<Float64 name="y" valueReference="0" causality="output"/>
<Float64 name="u" valueReference="1" causality="input" start="0.25"/>
</ModelVariables><ModelStructure><Output valueReference="0" dependencies=""/></ModelStructure>
</fmiModelDescription>""",
}
SYSTEM = """connections = ["reference.displacement -> it.u"]
[components.it]
fmu = "breadth{version}.fmu"
[experiment]
duration = "0.05 s"
"""


def left(mark):
    """Processes with the mark in their environment."""
    found = []
    for folder in Path("/proc").iterdir():
        if folder.name.isdigit() and int(folder.name) != os.getpid():
            try:
                if mark in (folder / "environ").read_bytes():
                    state = (folder / "stat").read_text().rsplit(")", 1)[1].split()[0]
                    found += [folder.name] if state != "Z" else []
            except OSError:
                pass
    return found


def faults(program, folder, version, what, place):
    system = folder / f"rig{version}.toml"
    out = folder / "out"
    mark = f"{what}:{place}"
    with open(folder / "said", "wb") as said, open(folder / "json", "wb") as answer:
        run = subprocess.Popen(
            [program, "run", system, "--out", out, "--force", "--json", "--call-limit", "1 s"],
            stdin=subprocess.DEVNULL, stdout=answer, stderr=said, cwd=folder, start_new_session=True,
            env=dict(os.environ, HOSTILE=mark),
        )
        try:
            status = run.wait(timeout=60)
        except subprocess.TimeoutExpired:
            run.kill()
            return ["hangs"]
    said = (folder / "said").read_text(errors="replace")
    wrong = []
    if status not in (0, 1, 2):
        wrong.append(f"status {status}")
    if status == 2 and place == "DoStep":
        wrong.append("refused before its first step")
    if "panicked" in said:
        wrong.append("panics")
    if status and "breadth" not in said:
        wrong.append("names no FMU")
    if what in HARMLESS and status != 0:
        wrong.append(f"harmless, and ends with status {status}")
    if status in (0, 1):
        try:
            json.loads((folder / "json").read_text())
        except ValueError:
            wrong.append("prints no JSON")
        rows = len((out / "results.csv").read_text().splitlines()) - 1 if out.exists() else 0
        # Rows until 0.02 s, every 2 ms; what ends the run in a step loses that step only.
        wanted = 25 if status == 0 else 10 if place == "DoStep" else 0
        if rows < wanted:
            wrong.append(f"{rows} rows")
    for attempt in range(20):
        remaining = left(f"HOSTILE={mark}\0".encode())
        if not remaining:
            break
        time.sleep(0.1)
    else:
        wrong.append(f"leaves {len(remaining)} processes behind")
        for number in remaining:
            subprocess.run(["kill", "-9", number], check=False)
    return [f"{text} (status {status}: {said.strip()[-300:]})" for text in wrong]


def main():
    program, words = str(Path(sys.argv[1]).resolve()), sys.argv[2:]
    cases = [case for case in CASES if not words or any(word in case for word in words)]
    bad = 0
    with tempfile.TemporaryDirectory() as folder:
        folder = Path(folder)
        library = folder / "breadth.so"
        source = Path(__file__).with_name("breadth.c")
        subprocess.run(["cc", "-shared", "-fPIC", "-O1", "-pthread", "-w", "-o", library, source, "-lm"], check=True)
        for version, place in ((2, "binaries/linux64"), (3, "binaries/x86_64-linux")):
            with zipfile.ZipFile(folder / f"breadth{version}.fmu", "w") as archive:
                archive.writestr("modelDescription.xml", DESCRIPTION[version])
                archive.write(library, f"{place}/breadth.so")
            (folder / f"rig{version}.toml").write_text(SYSTEM.format(version=version))
        for version, what, place in cases:
            for fault in faults(program, folder, version, what, place):
                bad += 1
                print(f"FMI {version}.0, {what} in {place}: {fault}", flush=True)
    print(f"{len(cases)} libraries, {bad} faults")
    return bool(bad)


if __name__ == "__main__":
    sys.exit(main())
