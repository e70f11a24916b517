"""Wall time and memory of a study on one core and on all, and whether a run costs the same in a large one.

Usage: campaign_cores.py PROGRAM [--fmus DIR] [--runs N] [--sizes N ...] [--length S]

The study: three-variable control on the physical rig, whose scale and oil vary. Prints the speed-up of all
cores over one with --runs runs, and for each of --sizes the time of a run and the peak of memory on all
cores. A quiet machine is needed.
"""

import argparse
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

STUDY = """[study]
design = "latin-hypercube"
runs = {runs}
seed = 1
[fixed]
controller = "three-variable"
plant = "servohydraulic"
duration = "{length} s"
[factors]
seed = [1, 2, 3, 4, 5, 6, 7, 8]
scale = {{ uniform = [0.1, 0.4] }}
"table.bulk_modulus" = {{ normal = [1.0, "5 %"], relative = true }}
"""


def carried(program, runs, length, jobs):
    """Seconds and peak memory (bytes) of a study."""
    with tempfile.TemporaryDirectory() as folder:
        study = Path(folder) / "study.toml"
        study.write_text(STUDY.format(runs=runs, length=length))
        command = [program, "campaign", str(study), "--out", str(Path(folder) / "out")]
        if jobs:
            command += ["--jobs", str(jobs)]
        begun = time.perf_counter()
        process = subprocess.Popen(command, stdout=subprocess.DEVNULL)
        _, status, usage = os.wait4(process.pid, 0)
        if os.waitstatus_to_exitcode(status):
            sys.exit(f"FAILED {command}")
        return time.perf_counter() - begun, 1024 * usage.ru_maxrss


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("program")
    parser.add_argument("--fmus")
    parser.add_argument("--runs", type=int, default=2000)
    parser.add_argument("--sizes", type=int, nargs="*", default=[100, 1000, 10000])
    parser.add_argument("--length", type=float, default=30.0)
    given = parser.parse_args()
    if given.fmus:
        os.environ["SHAKEBENCH_FMUS"] = given.fmus
    cores = os.cpu_count()
    one, _ = carried(given.program, given.runs, given.length, 1)
    every, _ = carried(given.program, given.runs, given.length, None)
    print(f"{given.runs} runs of {given.length} s: {one:.1f} s on one core, {every:.1f} s on {cores}")
    print(f"speed-up {one / every:.2f}")
    for size in given.sizes:
        seconds, peak = carried(given.program, size, given.length, None)
        print(f"{size} runs: {1e3 * seconds / size:.1f} ms a run, peak memory {peak / 1e6:.0f} MB")


if __name__ == "__main__":
    main()
