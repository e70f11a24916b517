"""FMUs that offer model exchange: integrated by the importer, they move as in co-simulation."""

import sys

import numpy as np
from common import STEP, check, excitation, main
from fmpy import simulate_fmu

STEPS = 250


def model_exchange_agrees_with_co_simulation(archive):
    if archive.description.modelExchange is None:
        return "not offered"
    # Inputs that fmpy holds between samples in both kinds: discrete ones are held anyway; a
    # continuous one is interpolated in model exchange, so it is made constant here.
    rows = excitation(archive, STEPS + 1, seed=6)
    inputs = archive.variables("input")
    for i, variable in enumerate(inputs):
        if variable.variability == "continuous":
            rows[:, i] = rows[7, i]
    signal = np.array(
        [(k * STEP, *row) for k, row in enumerate(rows)],
        dtype=[("time", float)] + [(v.name, float) for v in inputs],
    )
    names = [v.name for v in archive.variables("output")]

    def run(kind, interval):
        return simulate_fmu(
            archive.path, fmi_type=kind, stop_time=STEPS * STEP, step_size=interval,
            output_interval=interval, relative_tolerance=1e-9, input=signal, output=names,
            record_events=False,
        )

    exchange = run("ModelExchange", STEP)

    def difference(parts):
        """Largest difference when co-simulation takes its steps in so many parts."""
        cosimulation = run("CoSimulation", STEP / parts)[::parts]
        check(len(cosimulation) == len(exchange), f"{len(cosimulation)} rows")
        worst = 0.0
        for name in names:
            scale = np.abs(exchange[name]).max()
            check(scale > 0, f"`{name}` does not move")
            worst = max(worst, np.abs(cosimulation[name] - exchange[name]).max() / scale)
        return worst

    coarse = difference(1)
    if coarse < 1e-5:
        return f"largest difference {coarse:.1g} of the largest value"
    # A component with an integrator of its own is less exact than the importer's solver at this
    # tolerance; both must be on their way to the same solution.
    fine = difference(8)
    check(coarse < 1e-3 and fine < coarse / 3, f"differ by {coarse:g}, in eighths of a step {fine:g}")
    return f"largest difference {coarse:.1g} of the largest value, in eighths of a step {fine:.1g}"


def states_and_derivatives_are_refused_out_of_order(archive):
    if archive.description.modelExchange is None:
        return "not offered"
    instance = archive.open(model_exchange=True)
    count = archive.description.numberOfContinuousStates
    buffer = (np.ctypeslib.as_ctypes_type(np.float64) * (count + 1))()
    refuse = instance.refused
    setter = instance.fmu.setContinuousStates
    refuse("states before initialization", lambda: setter(buffer, count), "wrong order")
    instance.initialize()
    refuse("time steps in event mode", lambda: setter(buffer, count), "wrong order")
    if archive.is2:
        instance.fmu.newDiscreteStates()
    else:
        instance.fmu.updateDiscreteStates()
    instance.fmu.enterContinuousTimeMode()
    refuse("wrong number of states", lambda: setter(buffer, count + 1), "continuous states")
    buffer[0] = float("nan")
    refuse("state not a number", lambda: setter(buffer, count), "set to NaN")
    refuse("time not a number", lambda: instance.fmu.setTime(float("nan")), "not finite")
    discrete = [v for v in archive.variables("input") if v.variability == "discrete"]
    for variable in discrete:
        refuse("discrete input", lambda: instance.set([variable.valueReference], [1.0]),
               "in continuous-time mode")
    state = instance.get_state()
    other = archive.open()
    other.refused("state of another kind", lambda: other.set_state(state), "ModelExchange")
    instance.free_state(state)
    other.free()
    instance.free()


if __name__ == "__main__":
    main(
        [
            model_exchange_agrees_with_co_simulation,
            states_and_derivatives_are_refused_out_of_order,
        ],
        sys.argv[1:],
    )
