"""A study's run as a driver of quoFEM, Dakota and other tools that vary parameters.

    python -m shakebench.quofem STUDY.toml [--params params.in] [--results results.out]
        [--quantities NAME ...] [--accept-interlock]

Reads parameters, makes one run of the study with them, and writes the figures that ``[study] results``
(or ``--quantities``) names on one line of ``results.out``. Exit status: 0; 1 when the run failed; 2 when
the input is at fault. Without a status of 0 there is no ``results.out``.
"""

from __future__ import annotations

import argparse
import csv
import difflib
import json
import math
import os
import re
import sys
import tempfile
from pathlib import Path
from typing import Any, Dict, List, Optional, Sequence, Tuple

from ._program import Error, InputError, call, text

# Keys of a study whose values may be files; paths in a study count from its folder.
PATHS = {"controller", "system", "plant", "record", "reference", "control_model"}
# `name = value` in the braces of APREPRO; Dakota's own entries begin with DAKOTA_, the rest as `x:y`.
APREPRO = re.compile(r"\{\s*([^\s=]+)\s*=\s*(.*?)\s*\}")
# The number and the unit behind it.
QUANTITY = re.compile(r"\s*[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?\s*(.*?)\s*")


class RunFailed(Error):
    """The run has no figures to give."""


def parameters(file: Path) -> Dict[str, str]:
    """The parameters in a file, values as text: quoFEM's ``name value`` lines behind their number,
    Dakota's ``value name`` lines behind ``N variables``, or Dakota's APREPRO format.

    Raises :class:`InputError` with the line at fault.
    """
    try:
        lines = file.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{file}: cannot be read ({error})") from error
    rows = [(number, line.strip()) for number, line in enumerate(lines, 1) if line.strip()]
    if not rows:
        raise InputError(f"{file}: is empty; expected the number of parameters and a line for each")
    if rows[0][1].startswith("{"):
        return _aprepro(file, rows)
    number, first = rows[0]
    words = first.split()
    dakota = words[1:] in (["variables"], ["variable"])
    if not words[0].isdigit() or not (dakota or len(words) == 1):
        raise InputError(
            f"{file}:{number}: `{first}`; expected the number of parameters, or Dakota's `N variables`"
        )
    count = int(words[0])
    found: Dict[str, str] = {}
    for number, line in rows[1 : count + 1]:
        parts = line.split(None, 1)
        if len(parts) != 2:
            raise InputError(f"{file}:{number}: `{line}`; expected a name and a value")
        name, value = (parts[1], parts[0]) if dakota else (parts[0], parts[1])
        _add(found, name, value, f"{file}:{number}")
    if len(found) != count:
        raise InputError(f"{file}: the first line announces {count} parameters, and {len(found)} follow")
    if not dakota and len(rows) > count + 1:
        number, line = rows[count + 1]
        raise InputError(f"{file}:{number}: `{line}` stands behind the {count} parameters announced")
    return found


def _aprepro(file: Path, rows: Sequence[Tuple[int, str]]) -> Dict[str, str]:
    found: Dict[str, str] = {}
    announced: Optional[int] = None
    for number, line in rows:
        match = APREPRO.fullmatch(line)
        if match is None:
            raise InputError(f"{file}:{number}: `{line}`; expected {{ name = value }}")
        name, value = match.groups()
        if name == "DAKOTA_VARS":
            announced = int(value) if value.isdigit() else None
        elif name.startswith("DAKOTA_") or len(found) == announced:
            # Behind the variables stand functions, derivatives and the evaluation's number.
            continue
        else:
            _add(found, name, value, f"{file}:{number}")
    if announced is None or len(found) != announced:
        raise InputError(f"{file}: expected {{ DAKOTA_VARS = N }} and N variables, found {len(found)}")
    return found


def _add(found: Dict[str, str], name: str, value: str, place: str) -> None:
    if name in found:
        raise InputError(f"{place}: `{name}` is given twice")
    found[name] = value.strip().strip('"')


def _number(written: str) -> Optional[float]:
    try:
        return float(written)
    except ValueError:
        return None


def single_run(study: Dict[str, Any], values: Dict[str, str], folder: Path) -> Dict[str, Any]:
    """The study of one run that has the parameters ``values`` where ``study`` (read from ``folder``) has
    factors or fixed values. A number takes the unit that the study uses.

    Raises :class:`InputError` for a name that the study does not have, and for a factor left open.
    """
    fixed, factors = dict(study.get("fixed", {})), dict(study.get("factors", {}))
    known = [*factors, *fixed]
    run: Dict[str, Any] = {}
    for name, value in values.items():
        key = _key(name, known)
        if key in run:
            raise InputError(f"`{name}`: {key} is given twice")
        written = factors.pop(key) if key in factors else fixed.pop(key)
        run[key] = _value(key, written, value)
        if isinstance(written, dict) and "of" in written:
            # Several variables that are one factor.
            values_of = run[key] if isinstance(run[key], dict) else {"list": run[key]}
            run[key] = {**values_of, "of": written["of"]}
    for key, written in factors.items():
        single = written.get("list") if isinstance(written, dict) else written
        if not isinstance(single, list) or len(single) != 1:
            raise InputError(
                f"[factors] {key} is not among the parameters; give it there, or its value in [fixed]"
            )
        run[key] = written
    if not run:
        raise InputError("neither parameters nor factors: nothing is set")
    settings = {"design": "random", "runs": 1}
    return {
        "study": settings,
        "fixed": {key: _absolute(key, value, folder) for key, value in fixed.items()},
        "factors": {key: _absolute(key, value, folder) for key, value in run.items()},
        "limits": study.get("limits", {}),
    }


def _key(name: str, known: Sequence[str]) -> str:
    """The key that is meant: names of other tools cannot have a dot."""
    if name in known:
        return name
    for key in known:
        if key.replace(".", "_") == name:
            return key
    near = difflib.get_close_matches(name, [key.replace(".", "_") for key in known], n=1)
    hint = f", did you mean `{near[0]}`?" if near else ""
    raise InputError(
        f"`{name}` is neither in [factors] nor in [fixed] of the study{hint}; expected one of "
        f"{', '.join(known) or 'those, and there are none'} (`_` may stand for `.`)"
    )


def _value(key: str, written: Any, value: str) -> Any:
    """A parameter's value as the study would write it."""
    number = _number(value)
    if number is None:
        return [value]
    if not math.isfinite(number):
        raise InputError(f"`{key}` = {value}; expected a finite number")
    if isinstance(written, dict) and written.get("relative"):
        # Relative values are drawn; this range holds one number.
        return {"uniform": [number, math.nextafter(number, math.inf)], "relative": True}
    sample = written
    while isinstance(sample, (dict, list)):
        if isinstance(sample, dict):
            others = ("steps", "relative", "of")
            sample = [part for name, part in sample.items() if name not in others]
        sample = sample[0] if sample else None
    unit = ""
    if isinstance(sample, str):
        match = QUANTITY.fullmatch(sample)
        if match is None:
            raise InputError(f"`{key}` = {value}; expected a text such as the study's `{sample}`")
        unit = match.group(1)
    if unit:
        return [f"{number!r} {unit}"]
    whole = isinstance(sample, int) and number.is_integer()
    return [int(number) if whole else number]


def _absolute(key: str, value: Any, folder: Path) -> Any:
    """Paths of a study that is written elsewhere."""
    if isinstance(value, list):
        return [_absolute(key, part, folder) for part in value]
    if key in PATHS and isinstance(value, str) and (folder / value).exists():
        return str((folder / value).absolute())
    return value


def _toml(value: Any) -> str:
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{json.dumps(k)} = {_toml(v)}" for k, v in value.items()) + " }"
    if isinstance(value, list):
        return "[" + ", ".join(map(_toml, value)) + "]"
    if isinstance(value, float):
        return repr(value)
    return json.dumps(value, ensure_ascii=False)


def _read(path: Path) -> Dict[str, Any]:
    try:
        import tomllib
    except ImportError:
        try:
            import tomli as tomllib
        except ImportError:
            raise Error(
                "this Python does not read TOML: pip install 'shakebench[campaign]'"
            ) from None
    try:
        with open(path, "rb") as file:
            return tomllib.load(file)
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: cannot be read ({error})") from error


def evaluate(
    study: Path,
    params: Path,
    quantities: Optional[Sequence[str]] = None,
    accept_interlock: bool = False,
) -> List[float]:
    """The figures of the run of ``study`` with the parameters in ``params``.

    Raises :class:`InputError` for input at fault, :class:`RunFailed` where there are no figures.
    """
    read = _read(study)
    wanted = list(quantities or read.get("study", {}).get("results", []))
    if not wanted:
        raise InputError(
            f"{study}: name what is wanted, as in [study] results = [\"time_domain_percent\", "
            "\"peak_acceleration_m_s2\"] or --quantities"
        )
    single = single_run(read, parameters(params), study.absolute().parent)
    with tempfile.TemporaryDirectory(prefix="shakebench-") as name:
        file = Path(name) / study.name
        tables = {table: values for table, values in single.items() if values}
        file.write_text(
            "".join(
                f"[{table}]\n" + "".join(f"{json.dumps(k)} = {_toml(v)}\n" for k, v in values.items())
                for table, values in tables.items()
            ),
            encoding="utf-8",
        )
        try:
            plan = call(["campaign", text(file), "--plan", "--json"])
        except InputError as error:
            # The user knows the study under another name.
            raise InputError(str(error).replace(text(file), text(study))) from None
        columns = [column["name"] for column in plan["columns"]]
        for quantity in wanted:
            if quantity not in columns:
                near = difflib.get_close_matches(quantity, columns, n=1)
                hint = f", did you mean `{near[0]}`?" if near else ""
                raise InputError(f"`{quantity}` is no result{hint}; there are {', '.join(columns)}")
        out = Path(name) / "out"
        call(["campaign", text(file), "--out", text(out), "--json"])
        with open(out / "runs.csv", newline="", encoding="utf-8") as rows:
            row = next(csv.DictReader(rows))
    ended = row["ended"]
    if ended != "complete" and not (accept_interlock and ended == "interlock"):
        raise RunFailed(f"the run ended as `{ended}`{': ' if row['reason'] else ''}{row['reason']}")
    figures = []
    for quantity in wanted:
        figure = _number(row[quantity])
        if figure is None:
            raise RunFailed(f"the run has no `{quantity}`")
        figures.append(figure)
    return figures


def main(arguments: Optional[Sequence[str]] = None) -> int:
    """Does as the head of this file says; gives the exit status."""
    parser = argparse.ArgumentParser(
        prog="python -m shakebench.quofem",
        description="One run of a study with the parameters of quoFEM or Dakota.",
    )
    parser.add_argument("study", type=Path, metavar="STUDY.toml")
    parser.add_argument("--params", type=Path, default=Path("params.in"), metavar="FILE")
    parser.add_argument("--results", type=Path, default=Path("results.out"), metavar="FILE")
    parser.add_argument(
        "--quantities", nargs="+", metavar="NAME", help="columns of runs.csv; default: [study] results"
    )
    parser.add_argument(
        "--accept-interlock",
        action="store_true",
        help="take the figures of a run that the interlock ended, over what was played",
    )
    options = parser.parse_args(arguments)
    part = options.results.with_name(options.results.name + ".part")
    try:
        if not options.results.absolute().parent.is_dir():
            raise InputError(f"{options.results}: there is no such folder")
        # What an earlier run left would be taken for this one's.
        options.results.unlink(missing_ok=True)
        figures = evaluate(
            options.study, options.params, options.quantities, options.accept_interlock
        )
        part.write_text(" ".join(map(repr, figures)) + "\n", encoding="utf-8")
        os.replace(part, options.results)
    except InputError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    except (Error, OSError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
