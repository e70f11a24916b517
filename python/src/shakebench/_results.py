"""What a command computed."""

from __future__ import annotations

import csv
import shutil
import weakref
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Dict, Iterator, Optional

import numpy as np

from ._program import Error

if TYPE_CHECKING:
    import pandas


class Result(Mapping):
    """What the program printed with ``--json``, and the files that it wrote.

    Reads like a dictionary: ``run["tracking"]["time_domain_percent"]``.
    """

    def __init__(
        self,
        values: Dict[str, Any],
        folder: Path,
        traces: Optional[str] = None,
        temporary: Optional[Path] = None,
        rows: Optional[str] = None,
    ) -> None:
        #: The JSON object.
        self.json: Dict[str, Any] = values
        #: Folder of the files. Without ``out`` it is a temporary one, removed with this object.
        self.folder: Path = folder
        self._file = traces
        self._rows = rows
        self._traces: Optional[Dict[str, np.ndarray]] = None
        if temporary is not None:
            weakref.finalize(self, shutil.rmtree, temporary, ignore_errors=True)

    def __getitem__(self, name: str) -> Any:
        return self.json[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self.json)

    def __len__(self) -> int:
        return len(self.json)

    def __repr__(self) -> str:
        return f"<shakebench.Result {', '.join(self.json)}>"

    @property
    def traces(self) -> Dict[str, np.ndarray]:
        """Signals over time by name, ``time`` first; SI. Empty where the command has none."""
        if self._traces is None:
            self._traces = {} if self._file is None else read_columns(self.folder / self._file)
        return self._traces

    def frame(self) -> "pandas.DataFrame":
        """The table of the result: the traces with ``time`` as index, or the rows of a comparison
        or a campaign.

        Needs pandas.
        """
        try:
            import pandas
        except ImportError:
            raise Error("frame() needs pandas: pip install pandas") from None
        if self._rows is not None:
            rows = self.folder / self._rows
            if not rows.is_file():
                raise Error(f"{rows} is not there: other parts of the study are missing")
            return pandas.read_csv(rows)
        if "rows" in self.json:
            return pandas.DataFrame(self.json["rows"])
        if not self.traces:
            raise Error("this result has neither traces nor rows")
        columns = dict(self.traces)
        time = columns.pop("time")
        return pandas.DataFrame(columns, index=pandas.Index(time, name="time"))


def read_columns(path: Path) -> Dict[str, np.ndarray]:
    """The columns of a CSV file by their heading; those that hold no numbers are left out."""
    try:
        with open(path, newline="", encoding="utf-8") as file:
            rows = csv.reader(file)
            names = next(rows)
            texts = list(zip(*rows))
    except (OSError, StopIteration) as error:
        raise Error(f"{path}: the traces cannot be read ({error})") from error
    columns: Dict[str, np.ndarray] = {}
    for name, cells in zip(names, texts):
        try:
            columns[name] = np.array(cells, dtype=float)
        except ValueError:
            continue
    return columns
