"""Simulations inside of this process, stepped one by one."""

from __future__ import annotations

import ctypes
import difflib
import os
from collections.abc import Mapping as AbstractMapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Callable, Dict, Iterator, List, Mapping, Optional, Sequence, Union

import numpy as np

from ._figure import picture
from ._fmus import folder
from ._functions import Function, Outputs
from ._native import Memory, Session
from ._program import Error, PathLike, program, text

if TYPE_CHECKING:
    import pandas
    import xarray

Quantity = Union[str, float]


class State:
    """A saved state of a simulation. It can be pickled, and restored in another process."""

    def __init__(self, data: bytes, time: float) -> None:
        self._data = data
        #: Time, s.
        self.time = time

    def __repr__(self) -> str:
        return f"<shakebench.State at {self.time:g} s>"


class Simulation:
    """A system on a motion, stepped from Python without another process.

    ``system`` and the keywords are those of :func:`shakebench.run`. ``functions`` puts functions of
    Python in place of components, by the component's name: ``{"control": law}``
    (:class:`shakebench.Function`). After the constructor the values at time 0 are known.

    >>> sim = Simulation("three-variable", duration="2 s")     # doctest: +SKIP
    >>> while sim.step():                                      # doctest: +SKIP
    ...     displacement = sim["table.displacement"]

    Raises :class:`shakebench.InputError` for input at fault. An exception of a function is raised
    by the call that stepped the simulation.
    """

    def __init__(
        self,
        system: Optional[PathLike] = None,
        *,
        functions: Optional[Mapping[str, Union[Function, Callable[..., Outputs]]]] = None,
        record: Optional[PathLike] = None,
        reference: Optional[PathLike] = None,
        plant: Optional[str] = None,
        specimen: Optional[str] = None,
        structure: Optional[str] = None,
        set: Optional[Mapping[str, Any]] = None,
        algorithm: Optional[str] = None,
        step: Optional[Quantity] = None,
        duration: Optional[Quantity] = None,
        scale: Optional[float] = None,
        pga: Optional[Quantity] = None,
        peak: Optional[Quantity] = None,
        seed: Optional[int] = None,
        tuning: Optional[str] = None,
        control_model: Optional[PathLike] = None,
        inputs: Union[None, PathLike, Sequence[PathLike]] = None,
    ) -> None:
        files = [] if inputs is None else inputs
        if isinstance(files, (str, os.PathLike)):
            files = [files]
        spec: Dict[str, Any] = {
            "system": "three-variable" if system is None else text(system),
            "set": [f"{name}={text(value)}" for name, value in (set or {}).items()],
            "inputs": [text(file) for file in files],
        }
        options = {
            "record": record,
            "reference": reference,
            "plant": plant,
            "specimen": specimen,
            "structure": structure,
            "algorithm": algorithm,
            "step": step,
            "duration": duration,
            "scale": scale,
            "pga": pga,
            "peak": peak,
            "seed": seed,
            "tuning": tuning,
            "control_model": control_model,
        }
        for name, value in options.items():
            if value is not None:
                spec[name] = value if isinstance(value, (int, float)) else text(value)
        wholes = []
        for component, function in (functions or {}).items():
            whole = function if isinstance(function, Function) else Function(function)
            wholes.append(whole.named(component))
        spec["functions"] = [whole.given() for whole in wholes]
        spec["fmus"], spec["guest"] = str(folder()), str(program())
        session = Session(spec, wholes)
        described = session.describe("signals")
        #: Names of the signals, ``component.variable``.
        self.names: List[str] = described["names"]
        #: Coupling step, s.
        self.step_size: float = described["step"]
        #: Length of what is played, s.
        self.duration: float = described["duration"]
        self._session = session
        self._places = {name: place for place, name in enumerate(self.names)}
        address, count = session.signals()
        self._array = (ctypes.c_double * count).from_address(address)
        self._step = session.step

    def step(self, steps: int = 1) -> bool:
        """Steps so many times; gives whether another step may follow."""
        return self._step(steps)

    def __getitem__(self, name: str) -> float:
        try:
            return self._array[self._places[name]]
        except KeyError:
            near = difflib.get_close_matches(name, self.names, n=1)
            hint = f", did you mean `{near[0]}`?" if near else ""
            raise KeyError(f"no signal `{name}`{hint} (`names` lists them)") from None

    @property
    def signals(self) -> np.ndarray:
        """The present values in the order of ``names``, SI: a view of the simulation's memory, which
        every step rewrites. Copy it to keep it."""
        address, count = self._session.signals()
        return np.asarray(Memory(self._session, address, (count,)))

    @property
    def time(self) -> float:
        """Time, s."""
        return self._session.time()

    @property
    def ended(self) -> Optional[str]:
        """``complete``, ``interlock``, ``terminated`` or ``failed``; none while it can be stepped."""
        ending = self._session.describe("ending")
        return None if ending is None else ending["ended"]

    @property
    def ended_because(self) -> Optional[str]:
        """Why it ended early."""
        ending = self._session.describe("ending")
        return None if ending is None else ending["because"]

    def save(self) -> State:
        """The present state. States of functions are their attributes (:class:`shakebench.Function`).

        Raises :class:`shakebench.Error` for a component that cannot save its state, by name.
        """
        time = self.time
        return State(self._session.save(), time)

    def restore(self, state: State) -> None:
        """Goes to a saved state, of this simulation or of one that was made alike.

        Raises :class:`shakebench.InputError` for a state of another system.
        """
        self._session.restore(state._data)

    def run(self, progress: Optional[Callable[[float, float], Any]] = None) -> "Run":
        """Steps to the end of the motion and gives what was recorded; the simulation is over then.

        ``progress(time, duration)`` is called about twenty times a second; an exception that it raises
        and Ctrl-C stop the simulation where it is.
        """
        called = None if progress is None else partial(_report, progress, self.duration)
        self._session.play(called)
        return self.finish()

    def finish(self) -> "Run":
        """Ends the simulation where it is and gives what was recorded."""
        self._session.finish()
        return Run(self._session)

    def __repr__(self) -> str:
        return f"<shakebench.Simulation of {len(self.names)} signals at {self.time:g} s>"


class Run(AbstractMapping):
    """What was recorded of a simulation: columns by name, and its figures.

    ``run["table.displacement"]`` is a column and ``run["time"]`` the time, SI. They are views of the
    simulation's memory and cannot be written to.
    """

    def __init__(self, session: Session) -> None:
        self._session = session
        #: Names of the columns.
        self.columns: List[str] = session.describe("columns")
        address, count = session.record()
        shape = (count // len(self.columns), len(self.columns))
        #: All columns, one row per sample.
        self.array: np.ndarray = np.asarray(Memory(session, address, shape))
        self._places = {name: place for place, name in enumerate(self.columns)}
        #: The object that ``shakebench run --json`` prints.
        self.summary: Dict[str, Any] = session.describe("summary")

    @property
    def ended(self) -> str:
        """How it ended: ``complete``, ``interlock``, ``terminated``, ``interrupted`` or ``failed``."""
        return self.summary["ended"]

    @property
    def tracking(self) -> Optional[Dict[str, Any]]:
        """How well the table followed; none where the run was stopped or has no table."""
        return self.summary["tracking"]

    def __getitem__(self, name: str) -> np.ndarray:
        if name not in self._places:
            raise KeyError(f"no column `{name}`; `columns` lists them")
        return self.array[:, self._places[name]]

    def __iter__(self) -> Iterator[str]:
        return iter(self.columns)

    def __len__(self) -> int:
        return len(self.columns)

    def write(self, folder: PathLike) -> Path:
        """Writes the files of a run (``results.csv``, ``summary.json``, ``report.html``, ...)."""
        self._session.write(os.fspath(folder))
        return Path(folder)

    def frame(self) -> "pandas.DataFrame":
        """The columns as a pandas table with ``time`` as index."""
        try:
            import pandas
        except ImportError:
            raise Error("frame() needs pandas: pip install pandas") from None
        index = pandas.Index(self["time"], name="time")
        return pandas.DataFrame(self.array[:, 1:], index=index, columns=self.columns[1:], copy=False)

    def dataset(self) -> "xarray.Dataset":
        """The columns as an xarray data set with the coordinate ``time``."""
        try:
            import xarray
        except ImportError:
            raise Error("dataset() needs xarray: pip install xarray") from None
        columns = {name: ("time", self[name]) for name in self.columns if name != "time"}
        return xarray.Dataset(columns, coords={"time": self["time"]}, attrs={"ended": self.ended})

    def __repr__(self) -> str:
        return f"<shakebench.Run of {self.summary['system']}: {self.ended}, {len(self.array)} rows>"

    def _repr_html_(self) -> str:
        return picture(self)


def _report(progress: Callable[[float, float], Any], duration: float, time: float) -> None:
    progress(time, duration)
