"""FMUs that offer model exchange: integrated by the importer, they move as in co-simulation."""

import sys

import numpy as np
from common import check, excitation, main
from fmpy import simulate_fmu

STEPS = 250


# Effects that the continuous states tell all of, by component: integrated by the importer, too.
SMOOTH = {
    "ShakeTable": {
        "added_payload.mass": 3.0,
        "viscous_damping.damping": 20.0,
        "cubic_stiffness.stiffness": 1e6,
        "valve_flow_gain.relative_change": 0.1,
        "internal_leakage.leakage": 0.005,
        "coulomb_friction.coulomb_force": 5.0,
        "coulomb_friction.transition_velocity": 0.05,
    },
    "Specimen": {"specimen_stiffness.relative_change": 0.2, "specimen_damping.relative_change": 1.0},
    "ServoHydraulicTable": {"added_payload": 3.0, "cubic_stiffness": 1e6},
    "YieldingSpecimen": {"stiffness_degradation": 0.05},
}

# Effects that have a memory or states of their own: refused by name.
REFUSED = {
    "ShakeTable": {
        "valve_spool_lag.frequency": 30.0,
        "command_delay.delay": 0.004,
        "valve_hysteresis.half_width": 0.1,
        "supply_pressure_droop.loss_per_volt": 0.3,
        "foundation_compliance.frequency": 10.0,
    },
    "Specimen": {
        "specimen_yielding.yield_displacement": 0.02,
        "specimen_second_mode.frequency": 8.0,
        "specimen_degradation.loss": 0.2,
        "specimen_absent.absent": 1.0,
    },
    "ServoHydraulicTable": {
        "command_delay.delay": 0.004,
        "valve_hysteresis.half_width": 0.1,
        "foundation_compliance.frequency": 10.0,
    },
}


def model_exchange_agrees_with_co_simulation(archive):
    return compare(archive, {})


def with_smooth_effects_model_exchange_agrees_with_co_simulation(archive):
    return compare(archive, SMOOTH.get(archive.description.modelName, {}))


def effects_with_a_memory_are_refused_by_name(archive):
    effects = REFUSED.get(archive.description.modelName, {})
    for name, value in effects.items():
        said = []
        try:
            simulate_fmu(
                archive.path, fmi_type="ModelExchange", stop_time=archive.step, start_values={name: value},
                logger=lambda *arguments: said.append(str(arguments)), debug_logging=True,
            )
        except Exception as error:
            said.append(str(error))
            text = " ".join(said)
            effect = name.split(".")[0]
            check("co-simulation" in text and effect in text, f"`{name}`: {text}")
            continue
        check(False, f"`{name}` was not refused in model exchange")
    return f"{len(effects)} effects"


def compare(archive, start_values):
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
        [(k * archive.step, *row) for k, row in enumerate(rows)],
        dtype=[("time", float)] + [(v.name, float) for v in inputs],
    )
    names = [v.name for v in archive.variables("output")]

    def run(kind, interval):
        return simulate_fmu(
            archive.path, fmi_type=kind, stop_time=STEPS * archive.step, step_size=interval,
            output_interval=interval, relative_tolerance=1e-9, input=signal, output=names,
            record_events=False, start_values=start_values,
        )

    exchange = run("ModelExchange", archive.step)

    def difference(parts):
        """Largest difference when co-simulation takes its steps in so many parts."""
        cosimulation = run("CoSimulation", archive.step / parts)[::parts]
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
    # tolerance; both must be on their way to the same solution, or as near as the others come.
    fine = difference(8)
    check(coarse < 1e-3 and (fine < 1e-5 or fine < coarse / 3), f"differ by {coarse:g}, in eighths of a step {fine:g}")
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
            with_smooth_effects_model_exchange_agrees_with_co_simulation,
            effects_with_a_memory_are_refused_by_name,
            states_and_derivatives_are_refused_out_of_order,
        ],
        sys.argv[1:],
    )
