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
    not so small that start and gap take more than :data:`OVERHEAD` of the whole study.
    """

    def __init__(self, fixed: Optional[int], runs: int) -> None:
        self._fixed = fixed
        self._runs = runs
        self._given = 0
        self._part: Optional[int] = None
        self._starts: List[float] = []
        self._gaps: List[float] = []
        self._running = 0.0
        self._done = 0
        self._last: Dict[str, float] = {}

    @property
    def measured(self) -> bool:
        """Whether a task has come back."""
        return self._done > 0

    def note(self, thread: str, times: Dict[str, Any]) -> None:
        """Takes in the times of a task: when it was begun, had each row, and ended."""
        rows: Sequence[float] = times["rows"]
        whole = times["ended"] - times["begun"]
        if len(rows) > 1:
            run = (rows[-1] - rows[0]) / (len(rows) - 1)
        else:
            # A lone run cannot be told from the start of its process.
            run = whole if self.run_s is None else min(self.run_s, whole)
        self._starts.append(max(whole - run * len(rows), 0.0))
        self._running += run * len(rows)
        self._done += len(rows)
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

    @property
    def lost_s(self) -> float:
        """Seconds of all threads that no run had."""
        return sum(self._starts) + sum(self._gaps)

    def size(self, left: int, threads: int) -> int:
        """Runs of the next task when ``left`` are not given out yet; the task counts as given."""
        wanted = self._wanted(left, threads)
        self._given += 1
        return max(1, min(wanted, left))

    def _wanted(self, left: int, threads: int) -> int:
        if self._fixed is not None:
            return self._fixed
        if not self.measured:
            return min(PROBE, self._runs // threads)
        run = max(self.run_s or 0.0, 1e-6)
        cost = self.start_s + self.gap_s
        under_way = self._given - len(self._starts)
        allowed = OVERHEAD / (1.0 - OVERHEAD) * run * self._runs - self.lost_s - cost * under_way
        tasks = allowed / cost
        if self._part is None and tasks < 2 * threads:
            # Not enough for two more tasks a thread: all that is left is shared out evenly, once.
            self._part = math.ceil(left / threads)
        if self._part is not None:
            return self._part
        balanced = min(left // (TASKS_LEFT * threads), int(LONGEST / run))
        return max(math.ceil(left / tasks), math.ceil(cost / run), balanced)

    def figures(self) -> Dict[str, Any]:
        """What ``result["dask"]`` says of them."""
        tasks, every = len(self._starts), self.lost_s + self._running
        return {
            "tasks": tasks,
            "runs": self._done,
            "runs_per_task": self._done / tasks if tasks else None,
            "run_s": self.run_s,
            "start_s": median(self._starts) if self._starts else None,
            "gap_s": median(self._gaps) if self._gaps else None,
            "overhead": self.lost_s / every if every else None,
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
