"""The program's commands as functions."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any, Dict, List, Mapping, Optional, Sequence, Tuple, Union

from ._program import PathLike, call, optional_path, options, text
from ._results import Result

Quantity = Union[str, float]


def _folder(out: Optional[PathLike]) -> Tuple[Path, Optional[tempfile.TemporaryDirectory]]:
    """The folder for results and, where it is not given, what removes it."""
    if out is not None:
        return Path(out), None
    kept = tempfile.TemporaryDirectory(prefix="shakebench-")
    return Path(kept.name) / "results", kept


def _paths(files: Union[PathLike, Sequence[PathLike]]) -> List[str]:
    if isinstance(files, (list, tuple)):
        return [text(file) for file in files]
    return [text(files)]


def run(
    system: Optional[PathLike] = None,
    *,
    record: Optional[PathLike] = None,
    reference: Optional[PathLike] = None,
    plant: Optional[str] = None,
    specimen: Optional[str] = None,
    set: Optional[Mapping[str, Any]] = None,
    fmi: Optional[int] = None,
    algorithm: Optional[str] = None,
    step: Optional[str] = None,
    duration: Optional[str] = None,
    scale: Optional[float] = None,
    pga: Optional[Quantity] = None,
    peak: Optional[Quantity] = None,
    seed: Optional[int] = None,
    control_model: Optional[PathLike] = None,
    out: Optional[PathLike] = None,
    **more: Any,
) -> Result:
    """Runs a system on a motion.

    ``system`` is a built-in name (``"three-variable"``, ``"mpc"``, ...) or a system file; ``record``
    an acceleration (PEER ``.AT2`` or CSV), ``reference`` a CSV used to the letter; without either the
    built-in motion is played. ``set`` gives parameters, ``{"control.valve_limit": "5 V"}``. Quantities
    are text with a unit (``duration="10 s"``). ``more`` are further options of ``shakebench run``.

    The result's ``traces`` hold every signal of every component over time, SI.

    Raises :class:`shakebench.InputError` for input at fault. A run that ended early is returned:
    ``result["ended"]`` is then not ``"complete"`` and ``result["ended_because"]`` tells why.
    """
    folder, kept = _folder(out)
    arguments = ["run", *([] if system is None else [text(system)])]
    for name, value in (set or {}).items():
        arguments += ["--set", f"{name}={text(value)}"]
    arguments += options(
        {
            "record": optional_path(record),
            "reference": optional_path(reference),
            "plant": plant,
            "specimen": specimen,
            "fmi": fmi,
            "algorithm": algorithm,
            "step": step,
            "duration": duration,
            "scale": scale,
            "pga": pga,
            "peak": peak,
            "seed": seed,
            "control_model": optional_path(control_model),
            **more,
        }
    )
    values = call([*arguments, "--out", str(folder), "--json"])
    return Result(values, folder, "results.csv", kept)


def compare(
    controllers: Optional[Sequence[str]] = None,
    *,
    records: Optional[Union[PathLike, Sequence[PathLike]]] = None,
    reference: Optional[PathLike] = None,
    plant: Optional[str] = None,
    specimen: Optional[str] = None,
    out: Optional[PathLike] = None,
    **more: Any,
) -> Result:
    """Runs controllers (default: all) on records (files or folders; default: built-in motions).

    ``result["rows"]`` has a row a run, ``result["medians"]`` one a controller; ``frame()`` gives the
    rows as a table.

    Raises :class:`shakebench.InputError` for unknown names or records at fault.
    """
    folder, kept = _folder(out)
    arguments = options(
        {
            "controllers": None if controllers is None else ",".join(controllers),
            "records": None if records is None else _paths(records),
            "reference": optional_path(reference),
            "plant": plant,
            "specimen": specimen,
            **more,
        }
    )
    values = call(["compare", *arguments, "--out", str(folder), "--json"])
    return Result(values, folder, None, kept)


def design(loop: Optional[str] = None, **more: Any) -> Dict[str, Any]:
    """Margins, crossover and bandwidth of the loops: ``design()["loops"]``.

    Raises :class:`shakebench.InputError` for an unknown loop.
    """
    with tempfile.TemporaryDirectory(prefix="shakebench-") as folder:
        named = options({"loop": loop, "out": str(Path(folder) / "design"), **more})
        return call(["design", *named, "--json"])


def identify(
    data: Union[PathLike, Sequence[PathLike]],
    out: Optional[PathLike] = None,
    *,
    fit_part: Optional[float] = None,
    specimen: Optional[PathLike] = None,
    **more: Any,
) -> Result:
    """Finds a rig's parameters from recordings (CSV with unit headers) and writes them to ``out``.

    ``result["model"]`` is the model file, ``result["fit_percent"]`` how well it predicts the part of
    the data that was left out.

    Raises :class:`shakebench.InputError` for data at fault, with file, row and what was expected.
    """
    kept = None
    if out is None:
        kept = tempfile.TemporaryDirectory(prefix="shakebench-")
        out = Path(kept.name) / "model.toml"
    named = options({"fit_part": fit_part, "specimen": optional_path(specimen), **more})
    values = call(["identify", *_paths(data), "--out", text(out), *named, "--json"])
    return Result(values, Path(out).resolve().parent, None, kept)


def diagnose(
    case: PathLike,
    *,
    data: Optional[Union[PathLike, Sequence[PathLike]]] = None,
    out: Optional[PathLike] = None,
    **more: Any,
) -> Result:
    """Names what a model gets wrong, from the records of a case (a folder or a rig description).

    ``result["verdict"]``, ``result["effects"]``, ``result["gain"]``; the extended model and its FMUs lie
    in ``result.folder``.

    Raises :class:`shakebench.InputError` for a case at fault.
    """
    folder, kept = _folder(out)
    named: List[str] = []
    for file in [] if data is None else _paths(data):
        named += ["--data", file]
    values = call(["diagnose", text(case), *named, *options(more), "--out", str(folder), "--json"])
    return Result(values, folder, None, kept)


def doctor() -> Dict[str, Any]:
    """What is here, what is missing, and the cure: ``doctor()["ready"]`` and ``["findings"]``."""
    return call(["doctor", "--json"])
