"""A study on the workers of a Dask cluster."""

from __future__ import annotations

import contextlib
import hashlib
import io
import json
import os
import time
import zipfile
from pathlib import Path
from typing import TYPE_CHECKING, Any, Dict, Iterator, List, Optional, Sequence, Tuple, Union

from ._batches import Batches, Rows
from ._journal import Journal
from ._program import Error, InputError, PathLike, call, text, version
from ._task import make

if TYPE_CHECKING:
    from distributed import Client

# How often a task may fail by something that another worker might not have.
RETRIES = 2
# Tasks given out for each thread: one that runs and one that waits, so that no thread waits for the client.
AHEAD = 2
# How often the workers are counted anew, s.
COUNTED_EVERY = 2.0


def collect(
    client: Union["Client", str],
    study: PathLike,
    out: Path,
    batch: Optional[int],
    more: List[str],
) -> Dict[str, Any]:
    """Runs on the workers what the journals in ``out`` lack, writes it into ``out/journal/dask.jsonl`` as
    it comes, and gives what it cost.

    Raises :class:`InputError` for a study at fault, :class:`Error` for workers that cannot run it.
    """
    if batch is not None and batch < 1:
        raise InputError(f"batch={batch}: expected 1 or more")
    plan = call(["campaign", text(study), "--plan", "--out", str(out), "--json", *more])
    archive, place = _packed(Path(study), plan["files"])
    with _connected(client) as connected, Journal(out, "dask") as journal:
        if plan["missing"]:
            _check(connected)
        if "--force" in more:
            # What `--force` does in the program; there it would take away what the workers bring.
            for old in (out / "journal").glob("*.jsonl"):
                old.unlink()
        of_tasks = [option for option in more if option != "--force"]
        return _Study(connected, archive, place, plan, batch, of_tasks).run(journal)


@contextlib.contextmanager
def _connected(client: Union["Client", str]) -> Iterator["Client"]:
    """The client itself, or one of the scheduler at that address."""
    try:
        from distributed import Client
    except ImportError:
        raise Error("a client needs Dask: pip install 'shakebench[campaign]'") from None
    if isinstance(client, Client):
        if client.asynchronous:
            raise InputError("the client is asynchronous; expected distributed.Client(...) itself")
        yield client
        return
    if not isinstance(client, str):
        raise InputError(
            f"client={client!r}: expected a distributed.Client or the address of a scheduler"
        )
    try:
        own = Client(client, set_as_default=False)
    except (OSError, ValueError) as error:
        raise InputError(f"{client}: no Dask scheduler answers ({error})") from error
    with own:
        yield own


def _packed(study: Path, files: Sequence[str]) -> Tuple[bytes, str]:
    """The study and its files as an archive, lying to each other as here; and the study's place in it."""
    paths = sorted({os.path.abspath(file) for file in [study, *map(Path, files)]})
    try:
        root = os.path.commonpath([os.path.dirname(path) for path in paths])
    except ValueError as error:
        raise InputError(f"{study}: its files lie on several drives ({error})") from error
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        for path in paths:
            # The time stands for nothing, and would make the same study another archive.
            entry = zipfile.ZipInfo(Path(path).relative_to(root).as_posix())
            entry.compress_type = zipfile.ZIP_DEFLATED
            try:
                archive.writestr(entry, Path(path).read_bytes())
            except OSError as error:
                raise InputError(f"{path}: cannot be read ({error})") from error
    return packed.getvalue(), Path(os.path.abspath(study)).relative_to(root).as_posix()


def _check(client: "Client") -> None:
    """Refuses workers without this package in this version, by name.

    Those that come later are checked by their tasks.
    """
    client.wait_for_workers(1)

    def installed() -> Optional[str]:
        # By value, as `_task.make`: the package may not be there.
        try:
            import shakebench
        except ImportError:
            return None
        return shakebench.version()

    found = client.run(installed, on_error="ignore")
    for worker, has in found.items():
        _same_version(worker, has)


def _same_version(worker: str, has: Optional[str]) -> None:
    own = version()
    if has is None:
        raise Error(f"worker {worker} has no shakebench; install the same there as here ({own})")
    if has != own:
        raise Error(f"worker {worker} has shakebench {has}, here it is {own}; install the same")


class _Study:
    """A study on its way through the cluster."""

    def __init__(
        self,
        client: "Client",
        archive: bytes,
        place: str,
        plan: Dict[str, Any],
        batch: Optional[int],
        more: List[str],
    ) -> None:
        self._client = client
        self._place = place
        self._more = more
        self._name = hashlib.sha256(archive).hexdigest()[:16]
        self._head: Dict[str, Any] = plan["head"]
        self._rows = Rows([(begin, end) for begin, end in plan["missing"]])
        self._batches = Batches(batch, self._rows.left)
        self._task = make()
        self._unique = os.urandom(4).hex()
        self._counted = -COUNTED_EVERY
        self._threads = 1
        # A task, not scattered data: Dask makes it again when the worker that holds it dies.
        self._archive = client.submit(bytes, archive, key=f"shakebench-study-{self._name}-{self._unique}")

    def run(self, journal: Journal) -> Dict[str, Any]:
        """Gives out tasks and writes what comes back until nothing is left."""
        from distributed import as_completed

        begun = time.monotonic()
        given: Dict[Any, Tuple[int, int]] = {}
        workers = set()
        completed = as_completed(loop=self._client.loop)
        try:
            self._give(given, completed)
            while given:
                future = next(completed)
                rows = given.pop(future)
                done = self._result(future, rows)
                future.release()
                workers.add(done["worker"])
                self._batches.note(done["thread"], done["times"])
                journal.append(done["head"], done["lines"])
                self._give(given, completed)
        finally:
            if given:
                self._client.cancel(list(given), force=True)
            self._archive.release()
        figures = self._batches.figures()
        return {
            **figures,
            "workers": len(workers),
            "threads": self._threads,
            "wall_s": time.monotonic() - begun,
        }

    def _give(self, given: Dict[Any, Tuple[int, int]], completed: Any) -> None:
        """Keeps every thread busy; before anything is measured each gets one small task."""
        threads = self._count()
        ahead = threads * (AHEAD if self._batches.measured else 1)
        while self._rows.left and len(given) < ahead:
            begin, end = self._rows.take(self._batches.size(self._rows.left, threads))
            future = self._client.submit(
                self._task,
                self._archive,
                self._name,
                self._place,
                begin,
                end,
                self._more,
                version(),
                key=f"shakebench-rows-{begin}-{end}-{self._unique}",
                retries=RETRIES,
            )
            given[future] = (begin, end)
            completed.add(future)

    def _count(self) -> int:
        now = time.monotonic()
        if now - self._counted > COUNTED_EVERY:
            self._threads = max(1, sum(self._client.nthreads().values()))
            self._counted = now
        return self._threads

    def _result(self, future: Any, rows: Tuple[int, int]) -> Dict[str, Any]:
        """What a task brought.

        Raises :class:`Error` or :class:`InputError` for what no other try would cure.
        """
        from distributed import CancelledError, KilledWorker

        begin, end = rows
        try:
            done = future.result()
        except KilledWorker as error:
            raise Error(
                f"rows {begin} to {end - 1}: every worker that took them died, the last {error.last_worker}; "
                f"short of memory? Try `shakebench campaign STUDY --rows {begin}-{end}` there"
            ) from error
        except CancelledError as error:
            raise Error(
                f"rows {begin} to {end - 1} were cancelled: has the scheduler ended? What came is kept, and "
                "the same call goes on"
            ) from error
        except Exception as error:
            raise Error(f"rows {begin} to {end - 1}, tried {RETRIES + 1} times: {error}") from error
        problem = done.get("problem")
        if problem == "version":
            _same_version(done["worker"], done["text"])
        if problem == "input":
            raise InputError(f"worker {done['worker']}: {done['text']}")
        if problem is not None:
            raise Error(f"worker {done['worker']}: {done['text']}")
        head = json.loads(done["head"])
        if head != self._head:
            raise Error(
                f"worker {done['worker']} does not run what is installed here: "
                f"{_difference(head, self._head)}; install the same on both"
            )
        return done


def _difference(there: Dict[str, Any], here: Dict[str, Any]) -> str:
    """What two heads of journals disagree on."""
    parts = []
    for name in {**there, **here}:
        one, other = there.get(name), here.get(name)
        if one == other:
            continue
        if name == "components" and isinstance(one, dict) and isinstance(other, dict):
            fmus = [fmu for fmu in {**one, **other} if one.get(fmu) != other.get(fmu)]
            short = [
                f"{fmu} {str(one.get(fmu))[:12]} there, {str(other.get(fmu))[:12]} here"
                for fmu in fmus[:3]
            ]
            more = f" and {len(fmus) - 3} more" if len(fmus) > 3 else ""
            parts.append("FMU " + ", ".join(short) + more)
        elif isinstance(one, str) and isinstance(other, str):
            parts.append(f"{name} is {one} there, {other} here")
        else:
            parts.append(f"{name} differ")
    return "; ".join(parts)
