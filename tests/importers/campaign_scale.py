"""What a million runs take on a thousand cores, and what breaks first, from pieces measured here.

Usage: campaign_scale.py PROGRAM [--fmus DIR] [--runs N] [--cores N] [--tasks N] [--rows N]

Measured: a run and the start of a task's process; what the scheduler and the client spend on a task that
brings back as many bytes as a task of the study does; bytes and memory of a row, from journal to Parquet.
Nothing here is run on a thousand cores. Times are of the processor where that is possible, so that other
work on the machine does not count. Package `shakebench` on PYTHONPATH.
"""

import argparse
import io
import json
import math
import os
import subprocess
import sys
import tempfile
import time
import zipfile
from pathlib import Path

from campaign_speed import STUDY
from distributed import Client, LocalCluster, as_completed

# The share of a thread's time that start and scheduler may take, as the package holds it.
from shakebench._batches import GAP, LONGEST, OVERHEAD, TASKS_LEFT

# Rows that cost little to make, to see what the table costs.
SMALL = """[study]
design = "random"
runs = {runs}
seed = 1
[fixed]
controller = "three-variable"
duration = "0.1 s"
specimen = "none"
[factors]
scale = {{ uniform = [0.1, 0.25] }}
"control.valve_limit" = {{ uniform = ["8 V", "10 V"] }}
"table.table_mass" = {{ uniform = [0.95, 1.05], relative = true }}
"""


def finish(command):
    """Processor seconds and peak memory (bytes) of a program."""
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL)
    output = process.stdout.read()
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        sys.exit(f"FAILED {command} ended with {process.returncode}")
    return usage.ru_utime + usage.ru_stime, 1024 * usage.ru_maxrss, output


def runs_and_start(program, study):
    """Seconds of a run and of a process's start and end, and the bytes of a row's line."""
    few, many = 2, 18
    short = min(finish([program, "campaign", study, "--rows", f"0-{few}"])[0] for _ in range(3))
    found = [finish([program, "campaign", study, "--rows", f"0-{many}"]) for _ in range(2)]
    long = min(taken for taken, _, _ in found)
    run = (long - short) / (many - few)
    lines = found[0][2].splitlines(keepends=True)
    return run, max(short - few * run, 0.0), len(lines[0]), sum(map(len, lines[1:])) / many


def answer(study, size):
    """What a task of a study is to the scheduler: it depends on the study and brings back some bytes."""
    return {"lines": [b"x" * size], "of": len(study)}


def scheduler(tasks, size):
    """Seconds that scheduler and client, here in one process, spend on a task."""
    with LocalCluster(n_workers=1, threads_per_worker=4, dashboard_address=None) as cluster, Client(cluster) as client:
        study = client.submit(bytes, b"study" * 1000)
        client.submit(answer, study, size, key="warm").result()
        begun, clock = time.process_time(), time.perf_counter()
        completed = as_completed()
        given = iter(range(tasks))
        waiting = 0
        for k in given:
            completed.add(client.submit(answer, study, size, key=f"answer-{k}"))
            waiting += 1
            if waiting >= 64:
                next(completed).result()
                waiting -= 1
        for future in completed:
            future.result()
        return (time.process_time() - begun) / tasks, (time.perf_counter() - clock) / tasks


def table(program, folder, rows):
    """Bytes of a row in each file; seconds to write the results of a row; seconds and bytes of memory to read
    a row of a journal."""
    found = {}
    for count in (rows // 10, rows):
        study = folder / f"small-{count}.toml"
        study.write_text(SMALL.format(runs=count))
        out = folder / f"out-{count}"
        finish([program, "campaign", study, "--out", out, "--json"])
        # All rows are in the journal now: what is left is reading them and writing the results.
        found[count] = finish([program, "campaign", study, "--out", out, "--json"])[0]
    sizes = {name: sum(f.stat().st_size for f in out.glob(name)) / rows
             for name in ("journal/*.jsonl", "runs.csv", "runs.parquet")}
    write = max(found[rows] - found[rows // 10], 0.0) / (rows - rows // 10)
    # Rows of other runs, many more than are made here, which it reads and keeps.
    journal = out / "journal/all.jsonl"
    line = journal.read_bytes().splitlines(keepends=True)[-1]
    reading = {}
    for count in (20_000, 200_000):
        others = (line.replace(line[8:24], b"%016x" % k, 1) for k in range(count))
        copy = out / "journal/others.jsonl"
        copy.write_bytes(journal.read_bytes().splitlines(keepends=True)[0] + b"".join(others))
        reading[count] = finish([program, "campaign", study, "--out", out, "--json"])[:2]
    (few, (fast, low)), (many, (slow, high)) = reading.items()
    return sizes, write, (slow - fast) / (many - few), (high - low) / (many - few)


def archive_size(study):
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.write(study, study.name)
    return len(packed.getvalue())


def words(seconds):
    for unit, size in (("h", 3600), ("min", 60), ("s", 1)):
        if seconds >= size:
            return f"{seconds / size:.1f} {unit}"
    return f"{1000 * seconds:.1f} ms"


def paper(runs, cores, run, start, each, head, line, sizes, row_s, row_bytes):
    """Prints the sums."""
    cost = start + GAP
    least = math.ceil(cost * (1 - OVERHEAD) / (OVERHEAD * run))
    batch = max(min(least, runs // cores), min(runs // (TASKS_LEFT * cores), int(LONGEST / run)))
    task = cost + batch * run
    tasks = math.ceil(runs / batch)
    rate = cores / task
    print(f"\n{runs:,} runs on {cores:,} cores, computed")
    print(f"  the runs alone                {words(runs * run / cores)}")
    print(f"  first tasks, one a core       {words(cores * each)} until the scheduler has given out {cores:,}")
    print(f"  then {tasks:,} tasks of {batch} runs, {words(task)} each; {100 * cost / task:.1f} % of it start and gap")
    print(f"  together                      {words(cores * each + tasks / cores * task)}, the last ones up to "
          f"{words(task)} later")
    print(f"  scheduler and client          {rate:.0f} tasks/s, {100 * rate * each:.0f} % of one core")
    print(f"  bytes to the client           {rate * (head + batch * line) / 1e6:.1f} MB/s")
    print(f"  journal {runs * sizes['journal/*.jsonl'] / 1e6:.0f} MB, CSV {runs * sizes['runs.csv'] / 1e6:.0f} MB, "
          f"Parquet {runs * sizes['runs.parquet'] / 1e6:.0f} MB")
    print(f"  results from the journal      {words(runs * row_s)} on one core, {runs * row_bytes / 1e9:.1f} GB of memory")
    print(f"what breaks: with a task a run, the scheduler at {(cost + run) / each:,.0f} cores; with tasks that cost "
          f"{100 * OVERHEAD:.0f} %, at {cost / OVERHEAD / each:,.0f}; with tasks of {LONGEST:.0f} s, at {LONGEST / each:,.0f}")
    print(f"             the table in 16 GB of memory at {16e9 / row_bytes / 1e6:,.0f} million runs")
    return {"batch": batch, "tasks": tasks, "task_s": task, "scheduler_share": rate * each}


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("program")
    parser.add_argument("--fmus")
    parser.add_argument("--runs", type=int, default=1_000_000)
    parser.add_argument("--cores", type=int, default=1000)
    parser.add_argument("--tasks", type=int, default=2000)
    parser.add_argument("--rows", type=int, default=3000)
    options = parser.parse_args()
    if options.fmus:
        os.environ["SHAKEBENCH_FMUS"] = str(Path(options.fmus).resolve())
    program = str(Path(options.program).resolve())
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        study = folder / "study.toml"
        study.write_text(STUDY.format(runs=64))
        run, start, head, line = runs_and_start(program, study)
        print("measured on one core of this machine, of the processor")
        print(f"  a run (30 s of the physical rig)       {1000 * run:8.2f} ms")
        print(f"  a task's process, start to end          {1000 * start:7.2f} ms")
        each, clock = scheduler(options.tasks, int(head + 200 * line))
        print(f"  scheduler and client, a task            {1000 * each:7.2f} ms, {1 / clock:.0f} tasks/s of the clock")
        sizes, write, read, kept = table(program, folder, options.rows)
        # Kept once as the journals are read, and once in the table.
        row_s, row_bytes = write + read, 2 * kept
        print(f"  a row: journal {sizes['journal/*.jsonl']:.0f}, CSV {sizes['runs.csv']:.0f}, Parquet "
              f"{sizes['runs.parquet']:.0f} bytes; of a task, a head of {head} bytes besides")
        print(f"  a row: {1e6 * read:.1f} us to read, {1e6 * write:.1f} us to write, {kept:.0f} bytes of memory where it is kept")
        print(f"  the study for a worker                 {archive_size(study):8} bytes")
        figures = paper(options.runs, options.cores, run, start, each, head, line, sizes, row_s, row_bytes)
    print("RESULT " + json.dumps({"run_s": run, "start_s": start, "scheduler_s": each, "bytes": sizes, "row_s": row_s,
                                  "row_bytes": row_bytes, **figures}))


if __name__ == "__main__":
    main()
