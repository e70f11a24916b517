"""The program: where it lies, and calling it."""

from __future__ import annotations

import importlib.metadata
import difflib
import functools
import json
import os
import platform
import re
import subprocess
import sys
from pathlib import Path
from typing import Any, Dict, FrozenSet, Iterable, List, Optional, Sequence, Union

PathLike = Union[str, "os.PathLike[str]"]

PACKAGE = Path(__file__).resolve().parent
NAME = "shakebench.exe" if os.name == "nt" else "shakebench"


class Error(Exception):
    """What the program could not do; the text is its own message."""


class InputError(Error):
    """The input is at fault (exit status 2): nothing was written."""


class KeywordError(InputError, TypeError):
    """A keyword that the command does not have."""


class ProgramMissing(Error):
    """The program does not belong to this installation or cannot be started."""


def version() -> str:
    """Version of this package."""
    try:
        return importlib.metadata.version("shakebench")
    except importlib.metadata.PackageNotFoundError:
        return "unknown"


def program() -> Path:
    """The program: named in ``SHAKEBENCH_PROGRAM``, in this package, or of the checkout around it.

    Raises :class:`ProgramMissing` where there is none.
    """
    named = os.environ.get("SHAKEBENCH_PROGRAM")
    if named:
        if not Path(named).is_file():
            raise ProgramMissing(f"SHAKEBENCH_PROGRAM names {named}, and there is no such file")
        return Path(named)
    own = PACKAGE / "program" / NAME
    if own.is_file():
        # Others that it starts lie beside it.
        for program in own.parent.glob("shakebench*"):
            if not os.access(program, os.X_OK):
                _make_executable(program)
        return own
    for folder in PACKAGE.parents:
        built = folder / "target" / "release" / NAME
        if (folder / "fmus" / "kit" / "Cargo.toml").is_file() and built.is_file():
            return built
    raise ProgramMissing(
        f"the program is missing from this installation (expected {own}): install the wheel for "
        f"this platform ({platform.machine()}-{platform.system().lower()}) again, as in "
        "`pip install --force-reinstall shakebench-...whl`, or name a program in SHAKEBENCH_PROGRAM"
    )


def _make_executable(path: Path) -> None:
    try:
        path.chmod(path.stat().st_mode | 0o111)
    except OSError as error:
        raise ProgramMissing(
            f"{path} may not be executed and that cannot be changed ({error}): install again"
        ) from error


def say(arguments: Sequence[str]) -> "subprocess.CompletedProcess[bytes]":
    """Runs the program to its end. An interrupt (Ctrl-C) ends it first.

    Raises :class:`InputError` with the program's message for exit status 2.
    """
    path = program()
    try:
        done = subprocess.run(
            [str(path), *arguments],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            env={"PYTHON": sys.executable, **os.environ},
        )
    except OSError as error:
        raise ProgramMissing(
            f"{path} cannot be started ({error}): it is damaged or for another platform than "
            f"{platform.machine()}-{platform.system().lower()}; install the wheel for this one"
        ) from error
    if done.returncode == 2:
        raise InputError(in_keywords(message(done)))
    return done


def message(done: "subprocess.CompletedProcess[bytes]") -> str:
    """What the program printed to standard error, without the word in front."""
    said = done.stderr.decode("utf-8", "replace").strip()
    return said[7:] if said.startswith("error: ") else said


def in_keywords(words: str) -> str:
    """A message with options as keywords: ``--record-every`` is ``record_every`` here."""
    return re.sub(r"(?<![\w-])--([a-z][a-z-]*[a-z])", lambda m: m[1].replace("-", "_"), words)


def call(arguments: Sequence[str]) -> Dict[str, Any]:
    """Runs the program and gives the JSON object that it prints.

    Raises :class:`InputError` with the program's message for exit status 2, :class:`Error` where
    there is no object (the program was stopped, or is from another version).
    """
    done = say(arguments)
    try:
        printed = json.loads(done.stdout.decode("utf-8"))
    except ValueError:
        ended = f"ended with status {done.returncode}"
        if done.returncode < 0:
            ended = f"was ended by signal {-done.returncode}"
        raise Error(f"{program()} {ended} and printed no result: {message(done)}") from None
    return printed


@functools.lru_cache(maxsize=None)
def known_options(command: str) -> FrozenSet[str]:
    """The options of a command as keywords, as its help lists them."""
    listed = say([command, "--help"]).stdout.decode("utf-8", "replace")
    found = re.findall(r"(?m)^\s+(?:-\w, )?--([a-z][a-z-]*)", listed)
    return frozenset(name.replace("-", "_") for name in found) - {"help", "json"}


def check_keywords(command: str, names: Iterable[str]) -> None:
    """Raises :class:`KeywordError` for a keyword that is not an option of the command."""
    for name in names:
        known = known_options(command)
        if name not in known:
            near = difflib.get_close_matches(name, known, n=1)
            hint = f", did you mean `{near[0]}`?" if near else f"; expected some of {', '.join(sorted(known))}"
            function = command.replace("-", "_")
            raise KeywordError(f"{function}() got an unexpected keyword argument `{name}`{hint}")


def options(named: Dict[str, Any]) -> List[str]:
    """Options from keyword arguments: ``None`` and ``False`` are left out, ``True`` is a flag, a
    list is given once with all its values, and ``_`` stands for ``-``."""
    given: List[str] = []
    for name, value in named.items():
        option = "--" + name.replace("_", "-")
        if value is None or value is False:
            continue
        if value is True:
            given.append(option)
        elif isinstance(value, (list, tuple)):
            given += [option, *map(text, value)]
        else:
            given += [option, text(value)]
    return given


def text(value: Any) -> str:
    """A value as the command line reads it."""
    if isinstance(value, bool):
        return "true" if value else "false"
    return os.fspath(value) if isinstance(value, os.PathLike) else str(value)


def optional_path(path: Optional[PathLike]) -> Optional[str]:
    """A path as text."""
    return None if path is None else os.fspath(path)
