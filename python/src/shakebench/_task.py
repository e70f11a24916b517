"""What runs on a Dask worker: rows of a study, by the program that is installed there."""

from __future__ import annotations

from typing import Any, Callable, Dict


def make() -> Callable[..., Dict[str, Any]]:
    """The function of a task.

    It is made inside another one so that Dask sends it by value: what a worker does is what the client
    wants, whatever package is installed there. Hence its own imports, and nothing of this module.
    """

    def rows(
        study: bytes, name: str, place: str, begin: int, end: int, more: list, wanted: str
    ) -> Dict[str, Any]:
        """Runs the rows ``begin..end`` of the study packed in ``study`` (a zip archive), which is unpacked
        once a worker, under ``name``, with the study's file at ``place``.

        Gives ``head`` and ``lines`` of the journal with ``times`` (s, this process's clock) of what was
        done, or ``problem`` with its ``text``. What another try might cure is raised instead.
        """
        import io
        import os
        import subprocess
        import tempfile
        import threading
        import time
        import zipfile
        from pathlib import Path

        from distributed import get_worker

        begun = time.monotonic()
        worker = get_worker()
        done: Dict[str, Any] = {
            "worker": worker.address,
            "thread": f"{worker.address} {os.getpid()} {threading.get_ident()}",
            "begin": begin,
            "end": end,
        }

        def failed(problem: str, text: str) -> Dict[str, Any]:
            return {**done, "problem": problem, "text": text}

        try:
            import shakebench

            program = shakebench.program()
        except ImportError as error:
            return failed("missing", f"shakebench is not installed there ({error})")
        except shakebench.Error as error:
            return failed("missing", str(error))
        if shakebench.version() != wanted:
            return failed("version", shakebench.version())

        folder = Path(worker.local_directory) / f"shakebench-{name}"
        if not folder.is_dir():
            folder.parent.mkdir(parents=True, exist_ok=True)
            unpacked = Path(tempfile.mkdtemp(prefix="shakebench-", dir=folder.parent))
            with zipfile.ZipFile(io.BytesIO(study)) as archive:
                archive.extractall(unpacked)
            try:
                unpacked.rename(folder)
            except OSError:
                # Another thread of this worker was first.
                if not folder.is_dir():
                    raise

        lines, arrived = [], []
        command = [str(program), "campaign", str(folder / place), "--rows", f"{begin}-{end}", *more]
        with tempfile.TemporaryFile() as said:
            with subprocess.Popen(
                command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=said
            ) as process:
                for line in process.stdout or ():
                    lines.append(line)
                    arrived.append(time.monotonic())
            said.seek(0)
            text = said.read().decode("utf-8", "replace").strip()
        text = text[7:] if text.startswith("error: ") else text
        status = process.returncode
        if status == 2:
            return failed("input", text.replace(str(folder) + os.sep, ""))
        whole = len(lines) == end - begin + 1 and all(line.endswith(b"\n") for line in lines)
        if status < 0 or not whole:
            # Short of memory, a full disk, somebody's kill: perhaps not so on another worker.
            raise RuntimeError(
                f"{worker.address}: {program} ended with status {status} after "
                f"{max(len(lines) - 1, 0)} of {end - begin} rows: {text}"
            )
        times = {"begun": begun, "rows": arrived[1:], "ended": time.monotonic()}
        return {**done, "head": lines[0], "lines": lines[1:], "times": times}

    return rows
