#!/usr/bin/env python3
"""Steps every component's library of every platform with the same inputs and compares with this
machine's, bit by bit: Windows' under Wine, ARM's under qemu-user.

    compare.py FMUS [--libraries FOLDER] [--components A,B] [--seconds T] [--platforms P,Q] [--json FILE]

FMUS holds fmi2/NAME.fmu and fmi3/NAME.fmu with libraries of several platforms; those in FOLDER, which
`dist/release` leaves in target/dist/libraries as PLATFORM/FILE, stand in for them, and hold the component
that panics on demand. Needed: gcc; for Windows x86_64-w64-mingw32-gcc and wine64; for ARM qemu-aarch64,
libc6-arm64-cross and zig (or aarch64-linux-gnu-gcc). Exit status: 0 all within bounds, 1 not, 3 a
platform that was asked for by name could not be run.
"""

from __future__ import annotations

import argparse
import array
import ctypes
import json
import math
import os
import shutil
import subprocess
import sys
import tempfile
import xml.etree.ElementTree as ET
import zipfile
from pathlib import Path

HERE = Path(__file__).resolve().parent
NATIVE = "x86_64-linux"
FOLDERS = {
    "x86_64-linux": ("linux64", "x86_64-linux", ".so"),
    "x86_64-windows": ("win64", "x86_64-windows", ".dll"),
    "aarch64-linux": ("aarch64-linux", "aarch64-linux", ".so"),
}
# Of the values' range over the run. Where a library calls sin, exp or pow the system's own
# functions differ in the last bit, and a feedback loop or a solver's choice spreads that.
BOUND = 1e-6


class Runner:
    """Compiles and starts the driver for a platform; `missing` says what it lacks."""

    def __init__(self, platform: str, folder: Path):
        self.platform, self.missing = platform, None
        self.environment = dict(os.environ)
        self.prefix: list[str] = []
        self.driver = folder / f"driver-{platform}"
        source = str(HERE / "driver.c")
        if platform == "x86_64-linux":
            compiler = ["gcc"]
        elif platform == "x86_64-windows":
            compiler = ["x86_64-w64-mingw32-gcc"]
            self.driver = self.driver.with_suffix(".exe")
            wine = shutil.which("wine64") or shutil.which("wine") or "/usr/lib/wine/wine64"
            self.prefix = [wine]
            self.environment.update(
                WINEPREFIX=str(folder / "wine"), WINEDEBUG="-all", WINEARCH="win64", DISPLAY=""
            )
        else:
            python = HERE / "../../target/dist/tools/bin/python"
            if python.is_file():
                compiler = [str(python), "-m", "ziglang", "cc", "-target", "aarch64-linux-gnu.2.17"]
            else:
                compiler = ["aarch64-linux-gnu-gcc"]
            # Neither brings a loader; qemu looks for it where QEMU_LD_PREFIX says.
            self.prefix = ["qemu-aarch64"]
        for tool in [compiler[0], *self.prefix]:
            if not (shutil.which(tool) or Path(tool).is_file()):
                self.missing = f"{tool} is not installed"
                return
        built = [*compiler, "-O1", "-o", str(self.driver), source]
        if platform.endswith("linux"):
            built.append("-ldl")
        subprocess.run(built, check=True)
        if platform == "x86_64-windows":
            self._stand_in(folder)
        if platform == "aarch64-linux" and "QEMU_LD_PREFIX" not in self.environment:
            self.missing = self._loader()

    def _loader(self) -> str | None:
        place = "/usr/aarch64-linux-gnu"
        if (Path(place) / "lib/ld-linux-aarch64.so.1").exists():
            self.environment["QEMU_LD_PREFIX"] = place
            return None
        return "no C library for ARM: install libc6-arm64-cross, or name a root in QEMU_LD_PREFIX"

    def _stand_in(self, folder: Path) -> None:
        """Wine 8 lacks the library that Rust takes random numbers from; a few lines stand in."""
        source = folder / "bcryptprimitives.c"
        source.write_text(
            "#include <windows.h>\n#include <ntsecapi.h>\n"
            "__declspec(dllexport) BOOL WINAPI ProcessPrng(PBYTE data, SIZE_T size)\n"
            "{ return RtlGenRandom(data, (ULONG)size); }\n"
        )
        compiler = ["x86_64-w64-mingw32-gcc", "-shared", "-O1"]
        target = folder / "bcryptprimitives.dll"
        subprocess.run([*compiler, "-o", target, source, "-ladvapi32"], check=True)

    def run(self, library: Path, version: int, plan: Path, out: Path) -> str:
        command = [*self.prefix, self.driver, self._path(library), version, self._path(plan)]
        command.append(self._path(out))
        done = subprocess.run(
            [str(part) for part in command],
            env=self.environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            timeout=1200,
        )
        if done.returncode:
            said = done.stderr.decode("utf-8", "replace").strip()
            raise RuntimeError(said or f"ended with status {done.returncode}")
        return done.stdout.decode().strip()

    def _path(self, path: Path) -> str:
        text = str(path)
        return "Z:" + text.replace("/", "\\") if "windows" in self.platform else text


def plan(description: ET.Element, seconds: float) -> tuple[str, list[str]]:
    """What the driver is told, and the names of the outputs."""
    step = float(description.find("DefaultExperiment").get("stepSize"))
    lines = [f"token {description.get('instantiationToken')}"]
    lines.append(f"step {step!r} {round(seconds / step)}")
    names = []
    for variable in description.find("ModelVariables"):
        reference, causality = variable.get("valueReference"), variable.get("causality")
        if variable.tag != "Float64":
            continue
        if causality == "input":
            amplitude = 0.1 * float(variable.get("nominal", 1.0))
            lines.append(f"input {reference} {amplitude!r}")
        elif causality in ("output", "local"):
            lines.append(f"output {reference}")
            names.append(variable.get("name"))
    return "\n".join(lines) + "\n", names


def file_name(name: str, platform: str) -> str:
    """A library as cargo names it."""
    return name + ".dll" if "windows" in platform else f"lib{name}.so"


def library(
    fmu: Path, version: int, platform: str, folder: Path, built: Path | None
) -> Path | None:
    if built and (built / platform / file_name(fmu.stem, platform)).is_file():
        return built / platform / file_name(fmu.stem, platform)
    two, three, suffix = FOLDERS[platform]
    name = f"binaries/{two if version == 2 else three}/{fmu.stem}{suffix}"
    with zipfile.ZipFile(fmu) as archive:
        if name not in archive.namelist():
            return None
        return Path(archive.extract(name, folder / f"{fmu.stem}-{version}"))


def read(path: Path) -> array.array:
    values = array.array("d")
    values.frombytes(path.read_bytes())
    return values


def largest(names: list[str], here: array.array, there: array.array) -> tuple[float, str, int]:
    """Largest difference over the output's range, which output, and at which step."""
    if len(here) != len(there):
        raise RuntimeError(f"{len(there)} values, expected {len(here)}")
    worst = (0.0, "", 0)
    count = len(names)
    for column in range(count):
        a, b = here[column::count], there[column::count]
        if a.tobytes() == b.tobytes():
            continue
        extent = max(map(abs, a)) or 1.0
        for at, (x, y) in enumerate(zip(a, b)):
            if x == y or (math.isnan(x) and math.isnan(y)):
                continue
            difference = abs(x - y) / extent
            difference = math.inf if math.isnan(difference) else difference
            if difference > worst[0]:
                worst = (difference, names[column], at)
    return worst


def faults(runners: dict[str, Runner], built: Path, scratch: Path) -> dict[str, str]:
    """Whether a panic stays inside its instance, on each platform."""
    own = built / NATIVE / file_name("Faulty", NATIVE)
    if not own.is_file():
        return {}
    describe = ctypes.CDLL(str(own)).shakebench_describe
    describe.restype = ctypes.c_char_p
    description = ET.fromstring(describe(3))
    choice = next(v for v in description.iter("Enumeration") if v.get("name") == "fault")
    text = f"token {description.get('instantiationToken')}\nstep 0.002 3\nfault\n"
    text += f"choice {choice.get('valueReference')} 1\n"
    path = scratch / "faulty.plan"
    path.write_text(text)
    found = {}
    for platform, runner in runners.items():
        file = built / platform / file_name("Faulty", platform)
        if file.is_file():
            said = [runner.run(file, v, path, scratch / "faulty.out") for v in (2, 3)]
            found[platform] = said[0] if said[0] == said[1] else " / ".join(said)
    return found


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("fmus", type=Path)
    parser.add_argument("--libraries", type=Path)
    parser.add_argument("--components", default="")
    parser.add_argument("--seconds", type=float, default=10.0)
    parser.add_argument("--platforms", default="")
    parser.add_argument("--json", type=Path)
    arguments = parser.parse_args()
    wanted = [name for name in arguments.components.split(",") if name]
    asked = [name for name in arguments.platforms.split(",") if name]
    files = sorted((arguments.fmus / "fmi3").glob("*.fmu"))
    files = [file for file in files if not wanted or file.stem in wanted]
    if not files:
        print(f"no FMUs in {arguments.fmus / 'fmi3'}")
        return 1
    status = 0
    with tempfile.TemporaryDirectory() as name:
        scratch = Path(name)
        runners = {}
        for platform in [NATIVE, *(asked or [p for p in FOLDERS if p != NATIVE])]:
            if platform in runners:
                continue
            runner = Runner(platform, scratch)
            if runner.missing:
                print(f"skipped {platform}: {runner.missing}", flush=True)
                status = 3 if platform in asked else status
            else:
                runners[platform] = runner
        rows = []
        for file in files:
            with zipfile.ZipFile(file) as archive:
                description = ET.fromstring(archive.read("modelDescription.xml"))
            text, names = plan(description, arguments.seconds)
            path = scratch / f"{file.stem}.plan"
            path.write_text(text)
            for version in (2, 3):
                fmu = arguments.fmus / f"fmi{version}" / file.name
                reference = None
                for platform, runner in runners.items():
                    row = {"component": file.stem, "fmi": version, "platform": platform}
                    own = library(fmu, version, platform, scratch, arguments.libraries)
                    if own is None:
                        row["problem"] = "no library in the archive"
                    else:
                        out = scratch / "out"
                        try:
                            row["state"] = runner.run(own, version, path, out)
                            values = read(out)
                            if platform == NATIVE:
                                reference = values
                                if len(set(values)) < 10:
                                    raise RuntimeError("the inputs move no output")
                            else:
                                worst = largest(names, reference, values)
                                row["difference"], row["output"], row["step"] = worst
                        except (RuntimeError, subprocess.TimeoutExpired) as error:
                            row["problem"] = str(error)
                    rows.append(row)
                    bad = "problem" in row or row.get("difference", 0.0) > BOUND
                    status = 1 if bad else status
                    print(words(row), flush=True)
        caught = {}
        if arguments.libraries:
            caught = faults(runners, arguments.libraries, scratch)
        for platform, said in caught.items():
            print(f"panic on {platform}: {said}")
            status = 1 if said != "caught" else status
        if arguments.json:
            whole = {"seconds": arguments.seconds, "rows": rows, "panic": caught}
            arguments.json.write_text(json.dumps(whole, indent=1) + "\n")
        compared = [row for row in rows if "difference" in row]
        same = sum(row["difference"] == 0.0 for row in compared)
        print(f"{len(compared)} compared, {same} the same to the bit")
    return status


def words(row: dict) -> str:
    head = f"{row['component']:<26} FMI {row['fmi']}.0  {row['platform']:<15}"
    if "problem" in row:
        return f"{head} FAILED: {row['problem']}"
    if "difference" not in row:
        return f"{head} reference, state {row['state']}"
    if row["difference"] == 0.0:
        return f"{head} the same to the bit, state {row['state']}"
    return (
        f"{head} {row['difference']:.1e} of the range of `{row['output']}` at step {row['step']}, "
        f"state {row['state']}"
    )


if __name__ == "__main__":
    sys.exit(main())
