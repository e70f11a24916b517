#!/usr/bin/env python3
"""Compares the JSON files of two folders, or two files: what two versions of a program print.

Numbers may differ by a relative tolerance (default 0: to the digit). Wall times are left out;
paths are compared by their last part.

    tests/compare_json.py BEFORE AFTER [--tolerance 1e-9] [--allow-added] [--only 'case-*.json']

Exit status: 0 nothing differs, 1 something does, 2 there is nothing to compare.
"""

import argparse
import fnmatch
import json
import math
import pathlib
import sys

WALL_TIMES = {"wall_s", "real_time_factor"}


def last_part(text):
    return text.replace("\\", "/").rsplit("/", 1)[-1] if "/" in text else text


def differences(before, after, place, options):
    """Yields a line for everything that differs below `place`."""
    if isinstance(before, dict) and isinstance(after, dict):
        for name in sorted(before.keys() | after.keys()):
            here = f"{place}.{name}" if place else name
            if name in WALL_TIMES or name in options.ignore:
                continue
            if name not in after:
                yield f"{here}: is gone, was {shown(before[name])}"
            elif name not in before:
                if not options.allow_added:
                    yield f"{here}: is new, {shown(after[name])}"
            else:
                yield from differences(before[name], after[name], here, options)
    elif isinstance(before, list) and isinstance(after, list):
        if len(before) != len(after):
            yield f"{place}: {len(before)} entries were, {len(after)} are there"
        for index, (one, other) in enumerate(zip(before, after)):
            yield from differences(one, other, f"{place}[{index}]", options)
    elif is_number(before) and is_number(after):
        if not math.isclose(before, after, rel_tol=options.tolerance, abs_tol=0.0):
            apart = abs(after - before) / max(abs(before), abs(after))
            yield f"{place}: {before!r} was, {after!r} is, {apart:.1e} apart"
    elif isinstance(before, str) and isinstance(after, str):
        if last_part(before) != last_part(after):
            yield f"{place}: {before!r} was, {after!r} is"
    elif before != after or type(before) is not type(after):
        yield f"{place}: {shown(before)} was, {shown(after)} is"


def is_number(value):
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def shown(value):
    text = json.dumps(value)
    return text if len(text) <= 60 else text[:57] + "..."


def pairs(before, after, pattern):
    """Names and the two files of each, none where one is missing."""
    if before.is_file() and after.is_file():
        yield before.name, before, after
        return

    def below(folder):
        files = folder.rglob("*.json")
        return {str(file.relative_to(folder)) for file in files}

    for name in sorted(below(before) | below(after)):
        if fnmatch.fnmatch(name, pattern):
            files = [folder / name for folder in (before, after)]
            yield name, *(file if file.is_file() else None for file in files)


def read(file):
    text = file.read_text()
    return json.loads(text) if text.strip() else None


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("before", type=pathlib.Path)
    parser.add_argument("after", type=pathlib.Path)
    parser.add_argument("--tolerance", type=float, default=0.0, help="relative, of numbers")
    parser.add_argument("--allow-added", action="store_true", help="new fields are no difference")
    parser.add_argument("--only", default="*", help="pattern of the files' names")
    parser.add_argument("--ignore", action="append", default=[], help="a field to leave out")
    options = parser.parse_args()
    seen, differ = 0, 0
    for name, before, after in pairs(options.before, options.after, options.only):
        if before is None or after is None:
            print(f"{name}: only in {options.after if before is None else options.before}")
            continue
        seen += 1
        lines = list(differences(read(before), read(after), "", options))
        differ += bool(lines)
        for line in lines:
            print(f"{name}: {line}")
    print(f"{seen} files compared, {differ} differ")
    if seen == 0:
        sys.exit(2)
    sys.exit(1 if differ else 0)


if __name__ == "__main__":
    main()
