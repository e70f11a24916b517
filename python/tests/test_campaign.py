"""Campaigns from Python: on Dask, and as quoFEM and Dakota drive them. As test_package.py; needs `distributed`.

Everything is run in a temporary folder.
"""

import contextlib
import io
import json
import os
import shutil
import signal
import threading
import time
import unittest
import zipfile
from pathlib import Path
from unittest import mock

from distributed import Client, LocalCluster

import shakebench
from shakebench import quofem
from shakebench._batches import OVERHEAD, Batches, Rows
from test_package import without_sources

STUDY = """
[study]
design = "sobol"
runs = {runs}
seed = 1
results = ["time_domain_percent", "peak_acceleration_m_s2"]
[fixed]
controller = "three-variable"
record = "../records/motion.csv"
[factors]
scale = {{ uniform = [0.5, {scale}] }}
"specimen.stiffness" = {{ uniform = ["80 lbf/in", "120 lbf/in"] }}
"table.table_mass" = {{ uniform = [0.9, 1.1], relative = true }}
"""


class Folder(unittest.TestCase):
    """Every test in a folder of its own, with a study and its record beside it."""

    def setUp(self):
        scope = without_sources()
        self.folder = scope.__enter__()
        self.addCleanup(scope.__exit__, None, None, None)
        Path("records").mkdir()
        Path("studies").mkdir()
        rows = (f"{k / 50},{0.05 * (k % 25 - 12) / 12}" for k in range(501))
        Path("records/motion.csv").write_text("time [s],acceleration [g]\n" + "\n".join(rows) + "\n")
        self.study = self.write()

    def write(self, runs=48, scale=1.0):
        study = Path("studies/study.toml")
        study.write_text(STUDY.format(runs=runs, scale=scale))
        return study

    def assert_same_results(self, one, other):
        for name in ("runs.csv", "runs.parquet"):
            self.assertEqual(Path(one, name).read_bytes(), Path(other, name).read_bytes(), name)


class Tuning(Folder):
    def test_parameters_are_searched_over_a_study(self):
        search = '[tune]\nevaluations = 4\n[tune.parameters]\n"control.proportional_gain" = ["3 V/in", "9 V/in"]\n'
        self.study.write_text(STUDY.format(runs=3, scale=1.0) + search)
        tuned = shakebench.tune(self.study)
        self.assertLessEqual(tuned["after"]["training"]["quantile"], tuned["before"]["training"]["quantile"])
        self.assertTrue(tuned["set"][0].startswith("control.proportional_gain="))


class OnDask(Folder):
    @classmethod
    def setUpClass(cls):
        scope = contextlib.ExitStack()
        cls.addClassCleanup(scope.close)
        cluster = LocalCluster(
            n_workers=3, threads_per_worker=1, processes=True, dashboard_address=None
        )
        cls.client = scope.enter_context(Client(scope.enter_context(cluster)))

    def test_results_are_those_of_a_local_run_though_a_worker_is_killed(self):
        alone = shakebench.campaign(self.study, out="alone")
        self.assertEqual((alone["runs"], alone["failed"]), (48, 0))
        victim = list(self.client.run(os.getpid).values())[1]
        journal = Path("dask/journal/dask.jsonl")
        killed_at = []

        def rows():
            return journal.read_bytes().count(b'{"run"') if journal.is_file() else 0

        def kill():
            while rows() < 8:
                time.sleep(0.005)
            os.kill(victim, signal.SIGKILL)
            killed_at.append(rows())

        killer = threading.Thread(target=kill, daemon=True)
        killer.start()
        together = shakebench.campaign(self.study, self.client, out="dask", batch=4)
        killer.join(10)
        # Each worker had two tasks of four rows then; those of this one were run by another.
        self.assertLessEqual(killed_at[0], 48 - 8)
        self.assertEqual(together["dask"]["runs"], 48)
        self.assertEqual(together["from_before"], 48)
        self.assert_same_results("alone", "dask")

        # What a killed client leaves: some rows, and a line that is not whole.
        lines = journal.read_bytes().splitlines(keepends=True)
        shutil.rmtree("dask")
        journal.parent.mkdir(parents=True)
        journal.write_bytes(b"".join(lines[:20]) + lines[20][:30])
        resumed = shakebench.campaign(self.study, self.client, out="dask")
        self.assertEqual(resumed["dask"]["runs"], 48 - 19)
        self.assert_same_results("alone", "dask")
        with self.subTest("a study that was extended"):
            alone = shakebench.campaign(self.write(runs=56), out="longer")
            longer = shakebench.campaign(self.study, self.client, out="dask")
            self.assertEqual(longer["dask"]["runs"], 8)
            self.assert_same_results("longer", "dask")
        with self.subTest("nothing is left, and all is made anew"):
            again = shakebench.campaign(self.study, self.client, out="dask")
            self.assertEqual((again["dask"]["runs"], again["from_before"]), (0, 56))
            anew = shakebench.campaign(self.study, self.client, out="dask", force=True)
            self.assertEqual(anew["dask"]["runs"], 56)
            self.assert_same_results("longer", "dask")

    def test_workers_that_run_something_else_are_named(self):
        def with_variable(name, value):
            before = os.environ.get(name)
            os.environ[name] = value
            return before

        worker = list(self.client.scheduler_info()["workers"])[0]
        other = self.folder / "fmus"
        shutil.copytree(os.environ["SHAKEBENCH_FMUS"], other)
        with zipfile.ZipFile(other / "fmi3" / "ShakeTable.fmu", "a") as archive:
            archive.writestr("extra/note.txt", "changed")
        for name, value, said in (
            ("SHAKEBENCH_FMUS", str(other), "ShakeTable"),
            ("SHAKEBENCH_PROGRAM", "/nowhere/shakebench", "/nowhere/shakebench"),
        ):
            before = self.client.run(with_variable, name, value, workers=[worker])[worker]
            try:
                with self.assertRaises(shakebench.Error) as caught:
                    shakebench.campaign(self.study, self.client, out="out", batch=1)
            finally:
                self.client.run(with_variable, name, before, workers=[worker])
            self.assertIn(worker, str(caught.exception))
            self.assertIn(said, str(caught.exception))
            self.assertFalse(Path("out/runs.csv").exists())
        with mock.patch("shakebench._dask.version", lambda: "9.9.9"):
            with self.assertRaisesRegex(shakebench.Error, "worker tcp.* has shakebench .*9.9.9"):
                shakebench.campaign(self.study, self.client, out="out")

    def test_what_is_wrong_is_said_before_anything_is_run(self):
        self.study.write_text(self.study.read_text().replace("table_mass", "table_mas"))
        with self.assertRaisesRegex(shakebench.InputError, "did you mean `table.table_mass`"):
            shakebench.campaign(self.study, self.client, out="out")
        with self.assertRaisesRegex(shakebench.InputError, "jobs and shard"):
            shakebench.campaign(self.study, self.client, shard="1/2")
        with self.assertRaisesRegex(shakebench.InputError, "expected a distributed.Client"):
            shakebench.campaign(self.write(), 5, out="out")
        with mock.patch.dict("sys.modules", distributed=None):
            with self.assertRaisesRegex(shakebench.Error, "pip install 'shakebench"):
                shakebench.campaign(self.study, "tcp://127.0.0.1:8786", out="out")
        self.assertFalse(Path("out").exists())


class Tasks(unittest.TestCase):
    def times(self, begun, runs, start=0.2, run=0.1):
        rows = [begun + start + run * (k + 1) for k in range(runs)]
        return {"begun": begun, "rows": rows, "ended": rows[-1]}

    def play(self, runs, threads, start, run, gap):
        """A study on threads that take exactly these times; its figures and the time of the last end."""
        batches, left = Batches(None, runs), runs
        free = {str(thread): 0.0 for thread in range(threads)}
        under_way = []
        while left or under_way:
            while left and len(under_way) < threads:
                size = batches.size(left, threads)
                left -= size
                thread = min(free.keys() - {name for name, _ in under_way}, key=free.get)
                under_way.append((thread, self.times(free[thread] + gap, size, start, run)))
            under_way.sort(key=lambda task: task[1]["ended"])
            thread, times = under_way.pop(0)
            free[thread] = times["ended"]
            batches.note(thread, times)
        return batches.figures(), max(free.values()), min(free.values())

    def test_start_and_scheduler_take_less_than_their_share(self):
        for runs, threads, start, run in (
            (512, 2, 0.9, 0.19),
            (100_000, 4, 0.2, 0.1),
            (5000, 3, 0.05, 0.5),
            (100_000, 100, 0.3, 0.07),
        ):
            with self.subTest(runs=runs, threads=threads):
                figures, last, first = self.play(runs, threads, start, run, 0.01)
                self.assertEqual(figures["runs"], runs)
                self.assertAlmostEqual(figures["run_s"], run)
                self.assertAlmostEqual(figures["start_s"], start)
                self.assertAlmostEqual(figures["gap_s"], 0.01)
                self.assertLess(figures["overhead"], OVERHEAD)
                # All threads end together, but for a part of a task.
                self.assertGreaterEqual(figures["tasks"], 2 * threads)
                self.assertLess(last - first, 0.2 * last)

    def test_few_runs_are_shared_by_all(self):
        figures, last, _ = self.play(8, 4, 0.2, 0.1, 0.01)
        self.assertEqual((figures["tasks"], figures["runs"]), (4, 8))
        self.assertAlmostEqual(last, 0.41)
        self.assertEqual(Batches(5, 8).size(3, 4), 3)

    def test_rows_are_given_out_once(self):
        rows = Rows([(0, 3), (5, 6), (7, 7)])
        taken = []
        while rows.left:
            taken += range(*rows.take(2))
        self.assertEqual(taken, [0, 1, 2, 5])


class Driver(Folder):
    PARAMS = "2\nscale 0.75\nspecimen_stiffness 99.5\n"

    def drive(self, *arguments):
        said = io.StringIO()
        with contextlib.redirect_stderr(said):
            status = quofem.main([str(self.study), *arguments])
        return status, said.getvalue()

    def setUp(self):
        super().setUp()
        text = self.study.read_text()
        self.study.write_text(text.replace("{ uniform = [0.9, 1.1], relative = true }", '["300 lbm"]'))
        Path("params.in").write_text(self.PARAMS)

    def test_figures_are_those_of_a_run_with_the_parameters(self):
        status, said = self.drive()
        self.assertEqual(status, 0, said)
        found = [float(word) for word in Path("results.out").read_text().split()]
        # The same by another command.
        run = shakebench.run(
            "three-variable",
            record="records/motion.csv",
            scale=0.75,
            set={"specimen.stiffness": "99.5 lbf/in", "table.table_mass": "300 lbm"},
        )["tracking"]
        self.assertEqual(found, [run["time_domain_percent"], run["peak_acceleration_m_s2"]])
        self.drive("--quantities", "peak_displacement_m", "--results", "other.out")
        self.assertEqual(float(Path("other.out").read_text()), run["peak_displacement_m"])

    def test_relative_values_are_times_the_nominal(self):
        text = self.study.read_text()
        table = '"table.table_mass" = { uniform = [0.9, 1.1], relative = true }'
        self.study.write_text(text.replace('"table.table_mass" = ["300 lbm"]', table))
        figures = []
        for mass in (1.0, 1.05):
            Path("params.in").write_text(f"3\nscale 1\nspecimen.stiffness 99\ntable_table_mass {mass}\n")
            status, said = self.drive("--quantities", "time_domain_percent")
            self.assertEqual(status, 0, said)
            figures.append(float(Path("results.out").read_text()))
        nominal = shakebench.run(
            "three-variable",
            record="records/motion.csv",
            scale=1.0,
            set={"specimen.stiffness": "99 lbf/in"},
        )["tracking"]["time_domain_percent"]
        self.assertAlmostEqual(figures[0], nominal, places=9)
        self.assertNotAlmostEqual(figures[1], nominal, places=3)

    def test_numbers_take_the_unit_and_the_variables_of_their_factor(self):
        factors = {
            "specimen.stiffness": {"uniform": ["80 lbf/in", "120 lbf/in"]},
            "scale": {"range": [0.2, 1.0], "steps": 5},
            "seed": [1, 2],
            "springs": {"of": ["a.k", "b.k"], "normal": ["2 lbf/in", "5 %"]},
            "masses": {"lognormal": [1.0, 0.1], "relative": True, "of": ["a.m", "b.m"]},
            "plant": ["identified"],
        }
        values = {"specimen_stiffness": "99", "scale": "0.5", "seed": "2", "springs": "3", "masses": "1.5"}
        run = quofem.single_run({"factors": factors}, values, Path())["factors"]
        self.assertEqual(run["specimen.stiffness"], ["99.0 lbf/in"])
        self.assertEqual((run["scale"], run["seed"], run["plant"]), ([0.5], [2], ["identified"]))
        self.assertEqual(run["springs"], {"list": ["3.0 lbf/in"], "of": ["a.k", "b.k"]})
        self.assertEqual(run["masses"]["of"], ["a.m", "b.m"])
        self.assertEqual(run["masses"]["uniform"][0], 1.5)

    def test_files_of_dakota_are_read(self):
        for text in (
            "  2 variables\n 0.75 scale\n 99.5 specimen_stiffness\n 1 functions\n 1 ASV_1:response\n",
            "{ DAKOTA_VARS = 2 }\n{ scale = 0.75 }\n{ specimen_stiffness = 99.5 }\n"
            "{ DAKOTA_FNS = 1 }\n{ ASV_1:response = 1 }\n",
            self.PARAMS,
        ):
            Path("params.in").write_text(text)
            read = quofem.parameters(Path("params.in"))
            self.assertEqual(read, {"scale": "0.75", "specimen_stiffness": "99.5"})

    def test_what_is_at_fault_is_named_and_nothing_is_left(self):
        for params, expected in (
            ("2\nscale 0.75\nspecimen_stifness 99\n", "did you mean `specimen_stiffness`"),
            ("3\nscale 0.75\nspecimen_stiffness 99\n", "announces 3 parameters, and 2 follow"),
            ("2\nscale 0.75\nscale 0.8\n", "params.in:3: `scale` is given twice"),
            ("2\nscale 0.75\nspecimen_stiffness\n", "params.in:3: `specimen_stiffness`; expected a name"),
            ("1\nscale 0.75\n", "specimen.stiffness is not among the parameters"),
            ("two\n", "expected the number of parameters"),
            ("", "is empty"),
            ("2\nscale nan\nspecimen_stiffness 99\n", "expected a finite number"),
            ("2\nscale -1\nspecimen_stiffness 99\n", "studies/study.toml: `scale`: `-1.0` is not positive"),
        ):
            Path("params.in").write_text(params)
            Path("results.out").write_text("1 2\n")
            status, said = self.drive()
            self.assertEqual(status, 2, said)
            self.assertIn(expected, said)
            self.assertNotIn("/shakebench-", said)
            self.assertFalse(Path("results.out").exists())
        Path("params.in").unlink()
        status, said = self.drive()
        self.assertEqual((status, "params.in: cannot be read" in said), (2, True))
        Path("params.in").write_text(self.PARAMS)
        status, said = self.drive("--quantities", "time_domain")
        self.assertEqual((status, "did you mean `time_domain_percent`" in said), (2, True))

    def test_a_run_that_fails_leaves_no_results(self):
        # Ten times the motion: the table is thrown against its stops, and the interlock ends it.
        Path("params.in").write_text("2\nscale 1\nspecimen_stiffness 99.5\n")
        shaken = ["time [s],acceleration [g]"]
        shaken += [f"{k / 50},{0.6 * (-1) ** (k // 12)}" for k in range(501)]
        Path("records/motion.csv").write_text("\n".join(shaken) + "\n")
        status, said = self.drive()
        self.assertNotEqual(status, 0)
        self.assertIn("error: ", said)
        self.assertFalse(Path("results.out").exists())


if __name__ == "__main__":
    unittest.main()
