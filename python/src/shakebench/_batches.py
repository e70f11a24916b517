"""How many runs make a task, from what runs and tasks are measured to cost."""

from __future__ import annotations

import math
from statistics import median
from typing import Any, Dict, List, Optional, Sequence, Tuple

# What the start of a process and the scheduler may take of a thread's time.
OVERHEAD = 0.05
# Runs of the first task of each thread, which measure: two give the time between them.
PROBE = 2
# Tasks that each thread still gets while enough runs are left, so that all end together.
TASKS_LEFT = 4
# A task longer than this is not made for the balance's sake: it is what a dying worker loses, s.
LONGEST = 60.0
# What is taken for the scheduler's part before it is measured, s.
GAP = 0.01


class Batches:
    """Measures tasks as they come back and sizes the next ones.

    Tasks get smaller as the end comes near (guided self-scheduling, Polychronopoulos and Kuck 1987), but
    not so small that start and gap take more than :data:`OVERHEAD`.
    """

    def __init__(self, fixed: Optional[int], runs: int) -> None:
        self._fixed = fixed
        self._runs = runs
        self._tasks = 0
        self._of_run: List[float] = []
        self._starts: List[float] = []
        self._gaps: List[float] = []
        self._running = 0.0
        self._done = 0
        self._last: Dict[str, float] = {}

    @property
    def measured(self) -> bool:
        """Whether a task has come back."""
        return self._tasks > 0

    def note(self, thread: str, times: Dict[str, Any]) -> None:
        """Takes in the times of a task: when it was begun, had each row, and ended."""
        rows: Sequence[float] = times["rows"]
        between = (rows[-1] - rows[0]) / (len(rows) - 1) if len(rows) > 1 else None
        known = between if between is not None else self.run_s
        # A lone first run cannot be told from the start of its process.
        whole = times["ended"] - times["begun"]
        run = whole if known is None else known
        self._of_run.append(run)
        self._starts.append(max(whole - run * len(rows), 0.0))
        self._running += run * len(rows)
        self._done += len(rows)
        self._tasks += 1
        if thread in self._last:
            self._gaps.append(max(times["begun"] - self._last[thread], 0.0))
        self._last[thread] = times["ended"]

    @property
    def run_s(self) -> Optional[float]:
        """Seconds of a run, the mean of what was run; none before the first."""
        return self._running / self._done if self._done else None

    @property
    def start_s(self) -> float:
        """Seconds of a task that are no run's: its process starts, loads the FMUs and ends."""
        return median(self._starts) if self._starts else 0.0

    @property
    def gap_s(self) -> float:
        """Seconds between two tasks of a thread: the scheduler and the way to it."""
        return median(self._gaps) if self._gaps else GAP

    def size(self, left: int, threads: int) -> int:
        """Runs of the next task when ``left`` are not given out yet."""
        if self._fixed is not None:
            return min(self._fixed, left)
        if not self.measured:
            return max(1, min(PROBE, left // threads))
        run = max(self.run_s or 0.0, 1e-6)
        cost = self.start_s + self.gap_s
        cheap = math.ceil(cost * (1.0 - OVERHEAD) / (OVERHEAD * run))
        # Where there are not runs enough for cheap tasks, every thread gets its part all the same.
        least = max(1, min(cheap, self._runs // threads))
        balanced = min(left // (TASKS_LEFT * threads), int(LONGEST / run))
        return min(max(least, balanced), left)

    def figures(self) -> Dict[str, Any]:
        """What ``result["dask"]`` says of them."""
        lost = sum(self._starts) + sum(self._gaps)
        every = lost + self._running
        return {
            "tasks": self._tasks,
            "runs": self._done,
            "runs_per_task": self._done / self._tasks if self._tasks else None,
            "run_s": self.run_s,
            "start_s": median(self._starts) if self._starts else None,
            "gap_s": median(self._gaps) if self._gaps else None,
            "overhead": lost / every if every else None,
        }


class Rows:
    """Rows that are still to be given out, as half-open ranges in order."""

    def __init__(self, ranges: Sequence[Tuple[int, int]]) -> None:
        self._ranges = [(begin, end) for begin, end in ranges if begin < end]
        self._ranges.reverse()
        self.left = sum(end - begin for begin, end in self._ranges)

    def take(self, count: int) -> Tuple[int, int]:
        """The next rows, ``count`` at most: a task runs neighbours."""
        begin, end = self._ranges.pop()
        stop = min(begin + count, end)
        if stop < end:
            self._ranges.append((stop, end))
        self.left -= stop - begin
        return begin, stop
