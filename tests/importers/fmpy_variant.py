"""Variants of FMUs: the original's library with other start values, and nothing else different.

Arguments: original and variant, and so on, in pairs.
"""

import sys

import numpy as np
from common import Archive, check, excitation, main, run_without_fmi
from fmpy.validation import validate_fmu


def variant_starts_with_its_own_values(archive):
    original = Archive(pairs[archive.path])
    check(validate_fmu(archive.path) == [], validate_fmu(archive.path))
    changed = {}
    for variable in archive.variables("parameter"):
        before = next(v for v in original.description.modelVariables if v.name == variable.name)
        if variable.start != before.start:
            changed[variable.name] = float(variable.start)
            check("standard error" in variable.description, variable.description)
    check(changed, "no start value differs")
    check(archive.description.guid != original.description.guid, "the token is the original's")
    check(archive.description.modelName != original.description.modelName, "the name is the same")
    outputs = [v.valueReference for v in archive.variables("output")]
    rows = excitation(archive, 100)
    instance = archive.open()
    for name, value in changed.items():
        check(instance.get([archive.references[name]]) == [value], f"{name} starts differently")
    for _ in range(2):
        instance.initialize()
        expected = run_without_fmi(original, rows, outputs, changed)
        check(np.array_equal(instance.run(rows, outputs), expected), "moves differently")
        check(not np.array_equal(run_without_fmi(original, rows, outputs), expected), "no effect")
        instance.fmu.reset()
    instance.free()
    try:
        archive.open(token=original.description.guid)
    except Exception:
        return ", ".join(f"{name} = {value:.6g}" for name, value in changed.items())
    check(False, "the original's token was accepted")


if __name__ == "__main__":
    arguments = sys.argv[1:]
    pairs = dict(zip(arguments[1::2], arguments[0::2]))
    main([variant_starts_with_its_own_values], list(pairs))
