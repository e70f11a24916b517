"""Campaigns: a study run here, or on the workers of a Dask cluster."""

from __future__ import annotations

import shutil
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any, Optional, Union

from ._program import InputError, PathLike, call, check_keywords, options, text
from ._results import Result

if TYPE_CHECKING:
    from distributed import Client


def campaign(
    study: PathLike,
    client: Optional[Union["Client", str]] = None,
    *,
    out: Optional[PathLike] = None,
    jobs: Optional[int] = None,
    shard: Optional[str] = None,
    batch: Optional[int] = None,
    **more: Any,
) -> Result:
    """Runs a study (a TOML file), on this machine or on a Dask cluster.

    ``client`` is a ``distributed.Client`` or the address of a scheduler; the workers need this package
    in this version. What a study names by relative paths is sent to them. Without a client the study
    runs here, on ``jobs`` threads, or its part ``shard="2/8"`` alone. The same call again with the same
    ``out`` goes on where the last one stopped; the results are the same bytes wherever a run was made.

    ``batch`` is how many runs make a task; without it that follows from what runs and tasks are
    measured to cost. ``result["dask"]`` says what they cost: ``tasks``, ``runs_per_task``, ``run_s`` (a
    run), ``start_s`` (the start of a task's process), ``gap_s`` (the scheduler, between two tasks of a
    thread), ``overhead`` (the share of start and gap in the threads' time).

    ``frame()`` gives one row per run; ``result.folder`` holds ``runs.csv``, ``runs.parquet`` and the report.

    Raises :class:`shakebench.InputError` for a study at fault, and :class:`shakebench.Error` naming the
    worker that has another version, other FMUs or none.
    """
    check_keywords("campaign", more)
    if client is not None and (jobs is not None or shard is not None):
        raise InputError("jobs and shard are for runs on this machine; a client has its own workers")
    if client is None and batch is not None:
        raise InputError("batch is the size of a Dask task; give a client with it")
    folder = Path(tempfile.mkdtemp(prefix="shakebench-") if out is None else out)
    # The program makes a folder of results whole, so it is given one that is not there yet.
    results = folder / "results" if out is None else folder
    try:
        measured = None
        if client is not None:
            from ._dask import collect

            measured = collect(client, study, results, batch, options(more))
            more.pop("force", None)
        named = options({"jobs": jobs, "shard": shard, **more})
        values = call(["campaign", text(study), *named, "--out", str(results), "--json"])
        if measured is not None:
            values = {**values, "dask": measured}
    except BaseException:
        if out is None:
            shutil.rmtree(folder, ignore_errors=True)
        raise
    return Result(values, results, None, folder if out is None else None, "runs.csv")
