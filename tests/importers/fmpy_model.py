"""Plays inputs through FMUs that are given parameters, and prints the outputs as JSON.

Arguments: JOB.json FMU...; the job has `parameters` (name to value), `inputs` (name to one value a
step) and `outputs` (names).
"""

import json
import sys

import numpy as np
from common import Archive

if __name__ == "__main__":
    job = json.load(open(sys.argv[1]))
    for path in sys.argv[2:]:
        archive = Archive(path)
        inputs = [variable.name for variable in archive.variables("input")]
        steps = len(next(iter(job["inputs"].values())))
        rows = np.array([job["inputs"].get(name, [0.0] * steps) for name in inputs]).T
        instance = archive.open()
        instance.initialize(values=job["parameters"])
        outputs = instance.run(rows, [archive.references[name] for name in job["outputs"]])
        instance.free()
        print("RESULT " + json.dumps(outputs.T.tolist()))
