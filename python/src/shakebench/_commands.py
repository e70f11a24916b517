"""The program's commands as functions."""

from __future__ import annotations

import shutil
import tempfile
from pathlib import Path
from typing import Any, Dict, List, Mapping, Optional, Sequence, Union

from ._program import PathLike, call, check_keywords, optional_path, options, say, text
from ._results import Result

Quantity = Union[str, float]


def _finished(
    arguments: Sequence[str], out: Optional[PathLike], traces: Optional[str] = None
) -> Result:
    """Runs a command that writes into a folder: ``out``, or one that goes with the result."""
    folder = Path(tempfile.mkdtemp(prefix="shakebench-") if out is None else out)
    try:
        # The program makes a folder of results whole, so it is given one that is not there yet.
        results = folder / "results" if out is None else folder
        values = call([*arguments, "--out", str(results), "--json"])
    except BaseException:
        if out is None:
            shutil.rmtree(folder, ignore_errors=True)
        raise
    return Result(values, results, traces, folder if out is None else None)


def _paths(files: Union[PathLike, Sequence[PathLike]]) -> List[str]:
    if isinstance(files, (list, tuple)):
        return [text(file) for file in files]
    return [text(files)]


def _settings(values: Optional[Mapping[str, Any]]) -> List[str]:
    """Options ``--set``."""
    return [part for name, value in (values or {}).items() for part in ("--set", f"{name}={text(value)}")]


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
    an acceleration (PEER ``.AT2`` or CSV), ``reference`` a CSV played as given; without either the
    built-in motion is played. ``set`` gives parameters, ``{"control.valve_limit": "5 V"}``. Quantities
    are text with a unit (``duration="10 s"``). ``more`` are further options of ``shakebench run``.

    The result's ``traces`` hold every signal of every component over time, SI.

    Raises :class:`shakebench.InputError` for input at fault. A run that ended early is returned:
    ``result["ended"]`` is then not ``"complete"`` and ``result["ended_because"]`` tells why.
    """
    check_keywords("run", more)
    arguments = ["run", *([] if system is None else [text(system)])]
    arguments += _settings(set)
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
    return _finished(arguments, out, "results.csv")


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

    ``result["rows"]`` has one row per run, ``result["medians"]`` one a controller; ``frame()`` gives the
    rows as a table.

    Raises :class:`shakebench.InputError` for unknown names or records at fault.
    """
    check_keywords("compare", more)
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
    return _finished(["compare", *arguments], out)


def design(loop: Optional[str] = None, **more: Any) -> Dict[str, Any]:
    """Margins, crossover and bandwidth of the loops: ``design()["loops"]``.

    Raises :class:`shakebench.InputError` for an unknown loop.
    """
    check_keywords("design", more)
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
    check_keywords("identify", more)
    named = options({"fit_part": fit_part, "specimen": optional_path(specimen), **more})
    arguments = ["identify", *_paths(data), *named, "--json"]
    if out is not None:
        return Result(call([*arguments, "--out", text(out)]), Path(out).resolve().parent)
    folder = Path(tempfile.mkdtemp(prefix="shakebench-"))
    try:
        values = call([*arguments, "--out", str(folder / "model.toml")])
    except BaseException:
        shutil.rmtree(folder, ignore_errors=True)
        raise
    return Result(values, folder, None, folder)


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
    check_keywords("diagnose", more)
    named: List[str] = []
    for file in [] if data is None else _paths(data):
        named += ["--data", file]
    return _finished(["diagnose", text(case), *named, *options(more)], out)


def tune(study: PathLike, *, out: Optional[PathLike] = None, **more: Any) -> Result:
    """Searches a controller's parameters over a study (a TOML file with a table ``[tune]``).

    ``result["parameters"]`` holds them before and after, ``result["after"]["held_out"]`` what they give on
    motions that the search did not see, ``result["set"]`` the options of a run that set them.

    Raises :class:`shakebench.InputError` for a study at fault.
    """
    check_keywords("tune", more)
    return _finished(["tune", text(study), *options(more)], out)


def commission(*, out: Optional[PathLike] = None, set: Optional[Mapping[str, Any]] = None, **more: Any) -> Result:
    """Records, identifies and validates a simulated rig, and designs its controllers.

    The keywords are the options of ``shakebench commission``. ``result.folder`` holds a system file
    for each controller, ``result["predicted_percent"]`` the errors to expect.

    Raises :class:`shakebench.InputError` for input at fault.
    """
    check_keywords("commission", more)
    return _finished(["commission", *_settings(set), *options(more)], out)


def qualify(
    rule: PathLike,
    *,
    set: Optional[Mapping[str, Any]] = None,
    out: Optional[PathLike] = None,
    **more: Any,
) -> Result:
    """Makes a motion for a required response spectrum and plays it until its spectrum holds.

    ``rule`` is ``"ac156"``, ``"ieee693"`` or a file; ``set`` gives its parameters,
    ``{"s_ds": 1.0, "z_h": 0.0}``. ``result["verdict"]`` and ``result["rounds"]`` say how it went.

    Raises :class:`shakebench.InputError` for input at fault.
    """
    check_keywords("qualify", more)
    return _finished(["qualify", text(rule), *_settings(set), *options(more)], out)


def trs(
    record: PathLike,
    rrs: PathLike,
    *,
    set: Optional[Mapping[str, Any]] = None,
    out: Optional[PathLike] = None,
    **more: Any,
) -> Result:
    """Compares a record's response spectrum with the required one of a rule.

    Raises :class:`shakebench.InputError` for input at fault.
    """
    check_keywords("trs", more)
    return _finished(["trs", text(record), "--rrs", text(rrs), *_settings(set), *options(more)], out)


def iterate(
    system: Optional[PathLike] = None,
    *,
    set: Optional[Mapping[str, Any]] = None,
    out: Optional[PathLike] = None,
    **more: Any,
) -> Result:
    """Corrects the drive of a motion over several runs. The keywords are the options of
    ``shakebench iterate``.

    Raises :class:`shakebench.InputError` for input at fault.
    """
    check_keywords("iterate", more)
    named = [] if system is None else [text(system)]
    return _finished(["iterate", *named, *_settings(set), *options(more)], out)


def validate(file: PathLike) -> Dict[str, Any]:
    """Checks an FMU or an SSP archive: ``validate(file)["findings"]``, by severity.

    Raises :class:`shakebench.InputError` for a file that is neither.
    """
    return call(["validate", text(file), "--json"])


def info(file: PathLike) -> str:
    """What an FMU, an archive, a system or a data file holds, as text.

    Raises :class:`shakebench.InputError` for a file at fault.
    """
    return say(["info", text(file)]).stdout.decode("utf-8")


def export(system: PathLike, ssp: PathLike, **more: Any) -> Path:
    """Writes a system as an SSP archive and gives its path.

    Raises :class:`shakebench.InputError` for input at fault.
    """
    check_keywords("export", more)
    say(["export", text(system), "--ssp", text(ssp), *options(more)])
    return Path(ssp)


def doctor() -> Dict[str, Any]:
    """Checks the installation: ``doctor()["ready"]`` and ``["findings"]``."""
    return call(["doctor", "--json"])
