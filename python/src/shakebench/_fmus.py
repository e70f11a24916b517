"""Where the FMUs lie."""

from __future__ import annotations

import difflib
import os
from pathlib import Path
from typing import Dict, List

from ._program import InputError, program

VERSIONS = (2, 3)


def _folders() -> List[Path]:
    named = os.environ.get("SHAKEBENCH_FMUS")
    if named:
        return [Path(named)]
    own = program()
    # Beside an installed program, or where a checkout packs them.
    return [own.parent / "fmus", own.parent.parent / "fmus"]


def folder(fmi: int = 3) -> Path:
    """The folder with the FMUs: ``fmi2/NAME.fmu`` and ``fmi3/NAME.fmu``.

    Raises :class:`shakebench.InputError` where there are none.
    """
    looked = _folders()
    for place in looked:
        if any((place / f"fmi{fmi}").glob("*.fmu")):
            return place
    places = " nor in ".join(str(place / f"fmi{fmi}") for place in looked)
    raise InputError(
        f"no FMUs in {places}: install the package again, give their folder in SHAKEBENCH_FMUS, or, "
        "in a checkout, run `cargo run --release -- build`"
    )


def fmus(fmi: int = 3) -> Dict[str, Path]:
    """All FMUs of a version of FMI (2 or 3): file by name of the component.

    Raises :class:`shakebench.InputError` where there are none.
    """
    if fmi not in VERSIONS:
        raise InputError(f"fmi={fmi!r}: expected 2 or 3")
    files = (folder(fmi) / f"fmi{fmi}").glob("*.fmu")
    return {file.stem: file for file in sorted(files)}


def fmu(name: str, fmi: int = 3) -> Path:
    """The file of a component's FMU, for FMI 3.0 or (``fmi=2``) 2.0.

    >>> fmu("ShakeTable").name                  # doctest: +SKIP
    'ShakeTable.fmu'

    Raises :class:`shakebench.InputError` for a name that no component has, with the nearest one.
    """
    known = fmus(fmi)
    if name in known:
        return known[name]
    near = difflib.get_close_matches(name, known, n=1)
    hint = f", did you mean `{near[0]}`?" if near else f"; there are {', '.join(known)}"
    raise InputError(f"`{name}` is no component{hint}")
