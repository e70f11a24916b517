"""The journal of a campaign: a head that says what made the rows behind it, then one line per run."""

from __future__ import annotations

import os
from pathlib import Path
from types import TracebackType
from typing import BinaryIO, Optional, Sequence, Type

from ._program import Error

if os.name == "posix":
    import fcntl

# How the line of a run begins; other lines are heads.
ROW = b'{"run"'


class Journal:
    """``FOLDER/journal/NAME.jsonl``; what a kill leaves of a line is cut off when it is opened again."""

    def __init__(self, folder: Path, name: str) -> None:
        self.path = folder / "journal" / f"{name}.jsonl"
        self._file: Optional[BinaryIO] = None

    def append(self, head: bytes, lines: Sequence[bytes]) -> None:
        """Adds rows that were made under ``head``.

        Raises :class:`shakebench.Error` where another process adds to the same journal, and where the
        disk takes no more.
        """
        try:
            if self._file is None:
                self._file = self._open(head)
            self._file.write(b"".join(lines))
            self._file.flush()
        except OSError as error:
            raise Error(
                f"{self.path}: cannot be written ({error}); the results so far are kept"
            ) from error

    def _open(self, head: bytes) -> BinaryIO:
        self.path.parent.mkdir(parents=True, exist_ok=True)
        file = open(self.path, "ab+")
        if os.name == "posix":
            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                file.close()
                raise Error(
                    f"{self.path}: another process is running this study; wait for it, or "
                    "another folder for out"
                ) from None
        last, whole = b"", 0
        file.seek(0)
        for line in file:
            if line.endswith(b"\n"):
                whole += len(line)
                last = last if line.startswith(ROW) else line
        file.truncate(whole)
        # Another head in the middle: the rows behind it are of a study that was changed.
        if last != head:
            file.write(head)
        return file

    def __enter__(self) -> "Journal":
        return self

    def __exit__(
        self,
        kind: Optional[Type[BaseException]],
        error: Optional[BaseException],
        trace: Optional[TracebackType],
    ) -> None:
        if self._file is not None:
            self._file.close()
