"""Makes an environment with OpenSees under target/ and prints its Python.

Made once; again when the requirements change. Exit status 1, with the reason, if it cannot be made.
"""

import fcntl
import pathlib
import subprocess
import sys
import venv

HERE = pathlib.Path(__file__).resolve().parent
PLACE = HERE.parent.parent / "target" / "opensees"


def make():
    wanted = (HERE / "requirements.txt").read_text()
    # Written last: there only if everything before it succeeded.
    done = PLACE / "requirements.txt"
    python = PLACE / "bin" / "python"
    if not (done.is_file() and done.read_text() == wanted):
        venv.create(PLACE, with_pip=True, clear=True)
        pip = [python, "-m", "pip", "install", "--quiet", "--disable-pip-version-check", "-r"]
        subprocess.run([*pip, HERE / "requirements.txt"], check=True, stdout=sys.stderr)
        done.write_text(wanted)
    subprocess.run([python, "-c", "import openseespy.opensees"], check=True, stdout=sys.stderr)
    return python


if __name__ == "__main__":
    PLACE.parent.mkdir(exist_ok=True)
    with open(PLACE.with_suffix(".lock"), "w", encoding="utf-8") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        try:
            print(make())
        except Exception as error:  # Whatever it is, there is no OpenSees then.
            sys.exit("no environment with OpenSees: %s" % error)
