"""Simulations inside of the process. Runs wherever the package is installed, or as test_package.py says.

Everything is run in a temporary folder.
"""

import json
import os
import pickle
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

import numpy as np

import shakebench

# As this process finds its packages, from whatever folder.
PLACES = [os.path.abspath(place) for place in sys.path if place]
NOTEBOOK = Path(__file__).resolve().parent.parent / "examples" / "first-steps.ipynb"


class Folder(unittest.TestCase):
    def setUp(self):
        before = os.getcwd()
        self.temporary = tempfile.TemporaryDirectory()
        os.chdir(self.temporary.name)
        self.addCleanup(self.temporary.cleanup)
        self.addCleanup(os.chdir, before)


class Follower:
    """A proportional law with an integral: its state is an attribute."""

    def __init__(self, gain=30.0, integral=2.0):
        self.gain, self.integral, self.sum = gain, integral, 0.0

    def __call__(self, step, displacement, reference_displacement):
        error = reference_displacement - displacement
        self.sum += error * step
        return self.gain * error + self.integral * self.sum


def follower(**more):
    inputs = {"displacement": "table.displacement"}
    return shakebench.Function(Follower(**more), inputs=inputs)


class Stepping(Folder):
    def test_steps_give_what_the_program_gives(self):
        program = shakebench.run("mpc", duration="2 s")
        sim = shakebench.Simulation("mpc", duration="2 s")
        steps, peak = 0, 0.0
        while sim.step():
            steps += 1
            peak = max(peak, abs(sim["table.displacement"]))
        self.assertEqual((sim.ended, sim.ended_because), ("complete", None))
        run = sim.finish()
        self.assertEqual(len(run.array), steps + 1)
        for name, column in program.traces.items():
            np.testing.assert_array_equal(run[name], column, err_msg=name)
        self.assertEqual(peak, np.abs(run["table.displacement"]).max())
        tracking = program["tracking"]
        self.assertEqual(run.tracking, tracking)
        self.assertEqual(run.write("written"), Path("written"))
        whole = Path("written/results.csv").read_bytes()
        self.assertEqual(whole, (program.folder / "results.csv").read_bytes())
        self.assertTrue(Path("written/report.html").is_file())

    def test_arrays_are_views(self):
        sim = shakebench.Simulation(duration="0.2 s")
        signals = sim.signals
        self.assertFalse(signals.flags.writeable)
        place = sim.names.index("table.displacement")
        before = signals[place]
        sim.step(50)
        self.assertNotEqual(signals[place], before)
        self.assertEqual(signals[place], sim["table.displacement"])
        run = sim.run()
        column = run["table.displacement"]
        self.assertTrue(np.shares_memory(column, run.array))
        self.assertFalse(column.flags.writeable)
        last = column[-1]
        del run, sim
        # The memory lives as long as an array of it.
        self.assertEqual(column[-1], last)

    def test_saved_states_are_gone_back_to_to_the_bit(self):
        for functions in ({}, {"control": follower()}):
            sim = shakebench.Simulation("three-variable", duration="1 s", functions=functions)
            sim.step(100)
            state = pickle.loads(pickle.dumps(sim.save()))
            self.assertAlmostEqual(state.time, 0.2)
            first = [sim["table.acceleration"] for _ in range(200) if sim.step()]
            sim.restore(state)
            self.assertAlmostEqual(sim.time, 0.2)
            again = [sim["table.acceleration"] for _ in range(200) if sim.step()]
            self.assertEqual(first, again)
            # In another simulation as well.
            other = shakebench.Simulation("three-variable", duration="1 s", functions=functions)
            other.restore(state)
            self.assertEqual([other["table.acceleration"] for _ in range(200) if other.step()], first)
        with self.assertRaisesRegex(shakebench.InputError, "another"):
            shakebench.Simulation("mpc", duration="1 s").restore(state)

    def test_a_run_reports_progress_and_can_be_stopped(self):
        seen = []
        shakebench.Simulation("mpc", duration="60 s").run(lambda at, whole: seen.append((at, whole)))
        if seen:
            self.assertTrue(all(0 < at < whole == 60.0 for at, whole in seen))

        def stop(at, whole):
            raise KeyboardInterrupt

        sim = shakebench.Simulation("mpc", duration="3000 s")
        with self.assertRaises(KeyboardInterrupt):
            sim.run(stop)
        run = sim.finish()
        self.assertEqual(run.ended, "interrupted")
        self.assertIsNone(run.tracking)
        self.assertGreater(len(run.array), 100)

    def test_tables_and_pictures_are_of_the_run(self):
        run = shakebench.Simulation("mpc", duration="2 s").run()
        picture = run._repr_html_()
        self.assertIn("<svg", picture)
        self.assertIn("aria-label=", picture)
        self.assertIn("table", picture)
        self.assertIn("complete", repr(run))
        for package, method in (("pandas", run.frame), ("xarray", run.dataset)):
            try:
                __import__(package)
            except ImportError:
                with self.assertRaisesRegex(shakebench.Error, f"pip install {package}"):
                    method()
                continue
            self.assertEqual(len(method()["table.displacement"]), len(run.array))


class Functions(Folder):
    def test_a_law_of_python_is_that_of_the_component(self):
        # Table 3-2 without limits: the law that the component computes as well.
        parameters = shakebench.Simulation("displacement-pid", duration="1 s")
        names = parameters.names
        self.assertIn("control.valve_command", names)
        gain = 2.0 / 0.0254

        def law(reference_displacement, measured_displacement):
            return gain * (reference_displacement - measured_displacement)

        settings = {"control.proportional_gain": f"{gain} V/m", "control.integral_gain": 0}
        settings["control.derivative_gain"] = 0
        own = shakebench.Simulation("displacement-pid", duration="2 s", set=settings).run()
        mine = shakebench.Simulation(
            "displacement-pid", duration="2 s", functions={"control": law}
        ).run()
        np.testing.assert_allclose(
            mine["table.displacement"], own["table.displacement"], rtol=0, atol=1e-12
        )

    def test_further_inputs_and_all_inputs_are_given(self):
        seen = {}

        def law(**inputs):
            seen.update(inputs)
            return {"valve_command": 0.0}

        sim = shakebench.Simulation(duration="0.1 s", functions={"control": law})
        sim.step()
        self.assertIn("reference_displacement", seen)
        forced = shakebench.Function(
            lambda time, force: 1e-3 * time + 0.0 * force, inputs={"force": "table.actuator_force"}
        )
        sim = shakebench.Simulation(duration="0.1 s", functions={"control": forced})
        sim.step(10)
        self.assertAlmostEqual(sim["control.valve_command"], 1e-3 * sim.time)

    def test_a_specimen_of_python_is_that_of_the_component(self):
        # 100 lbf with a period of 1 s and 5 % damping, by the exact step of an oscillator.
        mass, natural, damping = 45.359237, 2 * np.pi, 0.05

        class Oscillator:
            def __init__(self):
                self.x = self.v = 0.0

            def __call__(self, step, table_acceleration):
                # Semi-implicit, in 20 parts.
                for _ in range(20):
                    a = -table_acceleration - 2 * damping * natural * self.v - natural**2 * self.x
                    self.v += a * step / 20
                    self.x += self.v * step / 20
                return {"force": mass * (natural**2 * self.x + 2 * damping * natural * self.v)}

        own = shakebench.Simulation("three-variable", duration="5 s").run()
        mine = shakebench.Simulation(
            "three-variable", duration="5 s", functions={"specimen": Oscillator()}
        ).run()
        peak = np.abs(own["specimen.force"]).max()
        off = np.abs(mine["specimen.force"] - own["specimen.force"]).max()
        self.assertLess(off, 0.05 * peak)
        self.assertGreater(peak, 1.0)

    def test_exceptions_of_functions_are_raised(self):
        def law(time):
            return 1 / (0.01 - time) if time < 0.009 else {}[time]

        for begin in (lambda sim: sim.step(1000), lambda sim: sim.run()):
            sim = shakebench.Simulation(duration="1 s", functions={"control": law})
            with self.assertRaises(KeyError):
                begin(sim)
            self.assertEqual(sim.ended, "failed")
            self.assertFalse(sim.step())

    def test_what_is_wrong_is_named(self):
        for functions, words in (
            ({"contrl": lambda: 0.0}, "did you mean `control`"),
            ({"control": lambda referense_displacement: 0.0}, "reference_displacement"),
            ({"control": 5}, "expected a function"),
            ({"control": lambda: "five"}, "expected a number"),
            ({"control": lambda: {"valve": 1.0}}, "valve_command"),
            ({"control": lambda *a: 0.0}, "not allowed"),
            ({"control": shakebench.Function(lambda f: 0.0, inputs={"f": "table.nothing"})}, "nothing"),
        ):
            with self.assertRaisesRegex(shakebench.InputError, words):
                shakebench.Simulation(duration="1 s", functions=functions)
        for keywords, words in (
            ({"system": "mcp"}, "mpc"),
            ({"duration": "1 kg"}, "does not fit"),
            ({"duration": -1}, "not positive"),
            ({"record": "nothing.AT2"}, "nothing.AT2"),
            ({"set": {"control.nothing": 1}}, "nothing"),
            ({"scale": 0.5, "pga": "0.1 g"}, "exclude"),
            ({"algorithm": "bogus"}, "gauss-seidel"),
        ):
            with self.assertRaisesRegex(shakebench.InputError, words):
                shakebench.Simulation(**keywords)
        with self.assertRaises(TypeError):
            shakebench.Simulation(duraton="1 s")
        with self.assertRaisesRegex(TypeError, "did you mean `duration`|unexpected keyword"):
            shakebench.run(duraton="1 s")
        with self.assertRaisesRegex(KeyError, "did you mean `table.displacement`"):
            shakebench.Simulation(duration="1 s")["table.displacment"]
        sim = shakebench.Simulation(duration="0.1 s")
        sim.run()
        with self.assertRaisesRegex(shakebench.InputError, "make a new one"):
            sim.step()
        self.assertEqual(os.listdir(), [])

    def test_a_stopped_run_has_no_tracking(self):
        wild = shakebench.Function(lambda time: 10.0 if time > 0.5 else 0.0)
        run = shakebench.Simulation(
            "three-variable", plant="servohydraulic", functions={"control": wild}, duration="5 s"
        ).run()
        self.assertEqual(run.ended, "interlock")
        self.assertIsNone(run.tracking)


class Examples(Folder):
    @unittest.skipUnless(NOTEBOOK.is_file(), "the notebook is in the checkout only")
    def test_the_notebook_runs(self):
        cells = json.loads(NOTEBOOK.read_text())["cells"]
        code = "\n".join("".join(cell["source"]) for cell in cells if cell["cell_type"] == "code")
        environment = {**os.environ, "PYTHONPATH": os.pathsep.join(PLACES)}
        done = subprocess.run(
            [sys.executable, "-c", code], capture_output=True, text=True, env=environment
        )
        self.assertEqual(done.returncode, 0, done.stderr)

    def test_an_agent_moves_the_table(self):
        try:
            import gymnasium  # noqa: F401
        except ImportError:
            self.skipTest("gymnasium is not installed")
        from shakebench.gym import ShakeTable

        env = ShakeTable("three-variable", duration="1 s")
        first, _ = env.reset(seed=3)
        self.assertTrue(env.observation_space.contains(first))
        rewards, truncated, terminated = [], False, False
        while not (truncated or terminated):
            seen, reward, terminated, truncated, info = env.step([4.0 * (seen_error(first))])
            first = seen
            rewards.append(reward)
        self.assertEqual(len(rewards), 500)
        self.assertTrue(truncated)
        self.assertEqual(info["ended"], "complete")
        again, _ = env.reset(seed=3)
        other, _ = env.reset(seed=4)
        self.assertTrue(np.array_equal(again, env.reset(seed=3)[0]))


def seen_error(observation):
    return observation[0] - observation[3]


if __name__ == "__main__":
    unittest.main()
