"""``python -m shakebench`` and the entry point ``shakebench``: the program itself."""

from __future__ import annotations

import os
import subprocess
import sys

from ._program import Error, program


def main() -> int:
    """Runs the program with this process's arguments and gives its exit status."""
    try:
        path = program()
    except Error as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    # `doctor` and OpenSees look into this environment, activated or not.
    os.environ.setdefault("PYTHON", sys.executable)
    command = [str(path), *sys.argv[1:]]
    if os.name == "posix":
        os.execv(path, command)  # signals and the terminal are the program's then
    try:
        return subprocess.run(command).returncode
    except KeyboardInterrupt:
        return 130


if __name__ == "__main__":
    sys.exit(main())
