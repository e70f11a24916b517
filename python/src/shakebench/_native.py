"""The library beside the program, through its C interface (``python/native``)."""

from __future__ import annotations

import ctypes
import json
import os
import sys
import weakref
from ctypes import CFUNCTYPE, POINTER, c_char_p, c_double, c_int, c_int64, c_size_t, c_uint32, c_uint64
from ctypes import c_uint8, c_void_p
from functools import lru_cache
from typing import Any, Callable, Dict, List, Optional, Sequence

from ._functions import Function, adapted, restore, save
from ._program import Error, InputError, ProgramMissing, program

NAME = {
    "nt": "shakebench_native.dll",
    "posix": "libshakebench_native.dylib" if sys.platform == "darwin" else "libshakebench_native.so",
}[os.name]
DONE, MORE = 0, 1
INPUT, CALLBACK = -1, -3

STEP = CFUNCTYPE(c_int, c_uint32, c_double, c_double, POINTER(c_double), POINTER(c_double))
SAVE = CFUNCTYPE(c_int64, c_uint32)
WRITE = CFUNCTYPE(c_int, c_uint32, POINTER(c_uint8))
RESTORE = CFUNCTYPE(c_int, c_uint32, POINTER(c_uint8), c_uint64)
PROGRESS = CFUNCTYPE(c_int, c_double)


class Callbacks(ctypes.Structure):
    """What the library calls of a simulation's functions."""

    _fields_ = [("step", STEP), ("save", SAVE), ("write", WRITE), ("restore", RESTORE)]


# Result and arguments of each function.
FUNCTIONS: Dict[str, Any] = {
    "sb_open": (c_void_p, [Callbacks]),
    "sb_free": (None, [c_void_p]),
    "sb_message": (c_char_p, [c_void_p]),
    "sb_prepare": (c_int, [c_void_p, c_char_p]),
    "sb_begin": (c_int, [c_void_p]),
    "sb_step": (c_int, [c_void_p, c_uint64]),
    "sb_play": (c_int, [c_void_p, PROGRESS]),
    "sb_finish": (c_int, [c_void_p]),
    "sb_write": (c_int, [c_void_p, c_char_p]),
    "sb_time": (c_double, [c_void_p]),
    "sb_describe": (c_char_p, [c_void_p, c_char_p]),
    "sb_signals": (c_void_p, [c_void_p, POINTER(c_size_t)]),
    "sb_record": (c_void_p, [c_void_p, POINTER(c_size_t)]),
    "sb_save": (c_void_p, [c_void_p, POINTER(c_size_t)]),
    "sb_restore": (c_int, [c_void_p, c_char_p, c_size_t]),
}


@lru_cache(maxsize=None)
def library(releases: bool = True) -> Any:
    """The library beside the program; ``releases`` lets other threads run during its calls, which a
    step is too short for.

    Raises :class:`ProgramMissing` where it is not there.
    """
    path = program().with_name(NAME)
    if not path.is_file():
        raise ProgramMissing(
            f"the native library is missing from this installation (expected {path}): install the "
            "wheel for this platform again, or build it in a checkout: "
            "`cargo build --release -p shakebench-native`"
        )
    try:
        loaded = (ctypes.CDLL if releases else ctypes.PyDLL)(str(path))
    except OSError as error:
        raise ProgramMissing(f"{path} cannot be loaded ({error}); install the package again") from error
    for name, (result, arguments) in FUNCTIONS.items():
        function = getattr(loaded, name)
        function.restype, function.argtypes = result, arguments
    return loaded


class Memory:
    """Memory of a session as NumPy is told of it; the session lives as long as an array of it."""

    def __init__(self, session: "Session", address: int, shape: Sequence[int]) -> None:
        self._session = session
        self.__array_interface__ = {
            "version": 3,
            "typestr": ">f8" if sys.byteorder == "big" else "<f8",
            "shape": tuple(shape),
            "data": (address, True),
        }


class Session:
    """A handle of the library with the functions that it calls."""

    def __init__(self, spec: Dict[str, Any], functions: Sequence[Function]) -> None:
        self._library, self._step = library(), library(False).sb_step
        self._functions = functions
        self._calls: List[Callable[..., None]] = []
        self._state = b""
        #: The exception of a function or of ``progress`` that waits to be raised.
        self.raised: Optional[BaseException] = None
        # They hold this object weakly: the library's handle ends with it.
        me = weakref.ref(self)

        def guarded(call: Callable[..., int], failed: int) -> Callable[..., int]:
            def guard(*arguments: Any) -> int:
                session = me()
                try:
                    return failed if session is None else call(session, *arguments)
                except BaseException as error:  # must not reach the library
                    if session is not None and session.raised is None:
                        session.raised = error
                    return failed

            return guard

        self._callbacks = Callbacks(
            STEP(guarded(Session._on_step, 1)),
            SAVE(guarded(Session._on_save, -1)),
            WRITE(guarded(Session._on_write, 1)),
            RESTORE(guarded(Session._on_restore, 1)),
        )
        self.pointer = self._library.sb_open(self._callbacks)
        weakref.finalize(self, self._library.sb_free, self.pointer)
        self.check(self._library.sb_prepare(self.pointer, json.dumps(spec).encode()))
        for function, interface in zip(functions, self.describe("functions")):
            self._calls.append(adapted(function, interface))
        self.check(self._library.sb_begin(self.pointer))

    def _on_step(self, number: int, time: float, step: float, inputs: Any, outputs: Any) -> int:
        self._calls[number](time, step, inputs, outputs)
        return 0

    def _on_save(self, number: int) -> int:
        self._state = save(self._functions[number].callable)
        return len(self._state)

    def _on_write(self, number: int, place: Any) -> int:
        if self._state:
            ctypes.memmove(place, self._state, len(self._state))
        return 0

    def _on_restore(self, number: int, place: Any, count: int) -> int:
        restore(self._functions[number].callable, ctypes.string_at(place, count) if count else b"")
        return 0

    def check(self, status: int) -> int:
        """Raises what a status stands for; gives it otherwise."""
        if self.raised is not None:
            raised, self.raised = self.raised, None
            raise raised
        if status < 0:
            said = self._library.sb_message(self.pointer)
            words = (said or b"").decode("utf-8", "replace")
            raise (InputError if status == INPUT else Error)(words)
        return status

    def step(self, steps: int = 1) -> bool:
        """Steps so many times; gives whether another step may follow."""
        call = self._step if steps <= 64 else self._library.sb_step
        status = call(self.pointer, steps)
        if status < 0 or self.raised is not None:
            self.check(status)
        return status == MORE

    def play(self, progress: Optional[Callable[[float], Any]]) -> None:
        """Steps to the end, and looks for Ctrl-C at each call of ``progress``."""

        def look(time: float) -> int:
            try:
                if progress is not None:
                    progress(time)
            except BaseException as error:
                self.raised = error
            return 0 if self.raised is None else 1

        called = PROGRESS(look)
        self.check(self._library.sb_play(self.pointer, called))

    def finish(self) -> None:
        """Ends the simulation and measures it."""
        self.check(self._library.sb_finish(self.pointer))

    def write(self, folder: str) -> None:
        """Writes the files of the run."""
        self.check(self._library.sb_write(self.pointer, os.fsencode(folder)))

    def time(self) -> float:
        """Time, s."""
        return float(self._library.sb_time(self.pointer))

    def describe(self, what: str) -> Any:
        """What the library describes."""
        said = self._library.sb_describe(self.pointer, what.encode())
        if said is None:
            self.check(INPUT)
        return json.loads(said)

    def signals(self) -> Any:
        """Address and number of the present values."""
        count = c_size_t()
        return self._library.sb_signals(self.pointer, ctypes.byref(count)), count.value

    def record(self) -> Any:
        """Address and number of the recorded values."""
        count = c_size_t()
        return self._library.sb_record(self.pointer, ctypes.byref(count)), count.value

    def save(self) -> bytes:
        """The present state."""
        count = c_size_t()
        place = self._library.sb_save(self.pointer, ctypes.byref(count))
        if place is None:
            self.check(-2)
        return ctypes.string_at(place, count.value)

    def restore(self, state: bytes) -> None:
        """Goes to a saved state."""
        self.check(self._library.sb_restore(self.pointer, state, len(state)))
