"""The package as people use it. Runs wherever it is installed, or with PYTHONPATH=python/src and the
program in SHAKEBENCH_PROGRAM: python -m unittest discover python/tests

Everything is run in a temporary folder.
"""

import contextlib
import os
import subprocess
import sys
import tempfile
import time
import unittest
from pathlib import Path
from unittest import mock

import numpy as np

import shakebench


@contextlib.contextmanager
def without_sources():
    """A folder without sources, as a user's own."""
    before = os.getcwd()
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        try:
            yield Path(folder)
        finally:
            os.chdir(before)


class Package(unittest.TestCase):
    def setUp(self):
        scope = without_sources()
        self.folder = scope.__enter__()
        self.addCleanup(scope.__exit__, None, None, None)

    def test_a_run_gives_its_figures_and_traces(self):
        begin = time.perf_counter()
        run = shakebench.run("mpc", set={"control.valve_limit": "9 V"})
        print(f"first result after {time.perf_counter() - begin:.2f} s")
        self.assertEqual(run["ended"], "complete")
        self.assertLess(run["tracking"]["time_domain_percent"], 50.0)
        traces = run.traces
        self.assertEqual(list(traces)[0], "time")
        self.assertTrue(all(len(column) == len(traces["time"]) for column in traces.values()))
        peak = np.abs(traces["table.displacement"]).max()
        self.assertAlmostEqual(peak, run["tracking"]["peak_displacement_m"], places=9)
        self.assertTrue((run.folder / "report.html").is_file())
        folder = run.folder
        del run
        self.assertFalse(folder.exists(), "the temporary folder is left")
        self.assertEqual(list(self.folder.iterdir()), [])

    def test_results_are_written_where_they_are_wanted(self):
        run = shakebench.run(duration="1 s", specimen="none", out="here", fmi=2)
        self.assertEqual(run["fmi"], "2.0")
        self.assertTrue(Path("here/results.csv").is_file())
        del run
        self.assertTrue(Path("here/results.csv").is_file())

    def test_frames_are_of_pandas(self):
        try:
            import pandas  # noqa: F401
        except ImportError:
            run = shakebench.run(duration="1 s")
            with self.assertRaisesRegex(shakebench.Error, "pip install pandas"):
                run.frame()
            return
        frame = shakebench.run(duration="1 s").frame()
        self.assertEqual(frame.index.name, "time")
        self.assertIn("table.acceleration", frame.columns)

    def test_controllers_are_compared(self):
        found = shakebench.compare(["three-variable", "displacement-pid"], specimen="none")
        self.assertEqual(set(found["medians"]), {"three-variable", "displacement-pid"})
        self.assertEqual(len(found["rows"]), 16)

    def test_loops_are_designed(self):
        loops = shakebench.design()["loops"]
        self.assertTrue(all("crossover_rad_s" in loop for loop in loops))
        self.assertEqual(list(self.folder.iterdir()), [])

    def test_what_goes_wrong_is_raised_with_the_programs_words(self):
        with self.assertRaisesRegex(shakebench.InputError, "three-variable"):
            shakebench.run("three-varable")
        with self.assertRaisesRegex(shakebench.InputError, "nothing.AT2"):
            shakebench.run(record="nothing.AT2")
        with self.assertRaisesRegex(shakebench.InputError, "nothing.csv"):
            shakebench.identify("nothing.csv")
        with self.assertRaisesRegex(shakebench.InputError, "nowhere"):
            shakebench.diagnose("nowhere")
        with self.assertRaisesRegex(shakebench.InputError, "`nonsense`"):
            shakebench.run(nonsense=True)
        with self.assertRaisesRegex(TypeError, "did you mean `record_every`"):
            shakebench.run(record_evry=2)
        with self.assertRaisesRegex(shakebench.InputError, "^duration: "):
            shakebench.run(duration="1 kg")
        self.assertEqual(list(self.folder.iterdir()), [])

    def test_a_rig_is_identified_from_a_recording_of_the_simulated_one(self):
        for name, played in (("bare", {}), ("payload", {"table.table_mass": "42 kg"})):
            run = shakebench.run(specimen="none", set=played, duration="12 s")
            traces = run.traces
            columns = {
                "time [s]": traces["time"],
                "valve_command [V]": traces["control.valve_command"],
                "displacement [m]": traces["table.displacement"],
                "acceleration [m/s2]": traces["table.acceleration"],
                "actuator_force [N]": traces["table.actuator_force"],
            }
            table = np.column_stack(list(columns.values()))
            header = ",".join(columns)
            np.savetxt(f"{name}.csv", table, delimiter=",", header=header, comments="")
        model = shakebench.identify(["bare.csv", "payload.csv"], out="model.toml")
        self.assertTrue(Path(model["model"]).is_file())
        self.assertGreater(min(model["fit_percent"].values()), 90.0)

    def test_fmus_are_found_by_name(self):
        for version in (2, 3):
            path = shakebench.fmu("ShakeTable", fmi=version)
            self.assertTrue(path.is_file())
            self.assertIn(f"fmi{version}", path.parts)
        self.assertEqual(len(shakebench.fmus(2)), len(shakebench.fmus(3)))
        with self.assertRaisesRegex(shakebench.InputError, "did you mean `ShakeTable`"):
            shakebench.fmu("ShakeTabel")
        with self.assertRaisesRegex(shakebench.InputError, "expected 2 or 3"):
            shakebench.fmu("ShakeTable", fmi=1)
        with mock.patch.dict(os.environ, SHAKEBENCH_FMUS=str(self.folder)):
            with self.assertRaisesRegex(shakebench.InputError, "no FMUs in"):
                shakebench.fmu("ShakeTable")
            with self.assertRaisesRegex(shakebench.InputError, "no FMUs in this folder"):
                shakebench.run()

    def test_a_missing_program_is_said(self):
        with mock.patch.dict(os.environ, SHAKEBENCH_PROGRAM="/nowhere/shakebench"):
            with self.assertRaisesRegex(shakebench.ProgramMissing, "/nowhere/shakebench"):
                shakebench.run()
        Path("program").write_bytes(b"MZ of another system")
        Path("program").chmod(0o755)
        with mock.patch.dict(os.environ, SHAKEBENCH_PROGRAM=str(self.folder / "program")):
            with self.assertRaisesRegex(shakebench.ProgramMissing, "another platform"):
                shakebench.run()

    def test_the_program_is_started_as_a_module(self):
        command = [sys.executable, "-m", "shakebench"]
        said = subprocess.run([*command, "--version"], capture_output=True, text=True)
        self.assertEqual(said.returncode, 0, said.stderr)
        self.assertTrue(said.stdout.startswith("shakebench "))
        said = subprocess.run([*command, "run", "nothing"], capture_output=True, text=True)
        self.assertEqual(said.returncode, 2)
        self.assertTrue(said.stderr.startswith("error: "))

    def test_the_doctor_is_content(self):
        self.assertTrue(shakebench.doctor()["ready"])


if __name__ == "__main__":
    unittest.main()
