"""Every FMU in fmpy: description, simulation, saved states, instances, refusals."""

import ctypes
import sys

import numpy as np
from common import Failure, check, excitation, main, run_without_fmi
from fmpy import simulate_fmu
from fmpy.validation import validate_fmu

STEPS = 500


def outputs_of(archive):
    return [v.valueReference for v in archive.variables("output")]


def other_parameters(archive):
    """Every start value by 1 % more."""
    return {v.name: 1.01 * float(v.start) for v in archive.variables("parameter")
            if v.max is None or 1.01 * float(v.start) <= float(v.max)}


def description_is_valid(archive):
    problems = validate_fmu(archive.path)
    check(problems == [], problems)


def simulation_equals_the_code_without_fmi(archive):
    rows = excitation(archive, STEPS)
    names = [v.name for v in archive.variables("output")]
    inputs = [v.name for v in archive.variables("input")]
    # fmpy interpolates continuous inputs between samples; at the samples themselves it does not.
    signal = np.array(
        [(k * archive.step, *row) for k, row in enumerate(rows)],
        dtype=[("time", float)] + [(name, float) for name in inputs],
    )
    worst = 0.0
    for parameters in ({}, other_parameters(archive)):
        reference = run_without_fmi(archive, rows, outputs_of(archive), parameters)
        check(np.any(reference != 0.0), "the excitation does nothing")
        result = simulate_fmu(
            archive.path, fmi_type="CoSimulation", stop_time=STEPS * archive.step, step_size=archive.step,
            output_interval=archive.step, input=signal, output=names, start_values=parameters,
            record_events=False,
        )
        simulated = np.array([result[name] for name in names]).T[1:]
        check(simulated.shape == reference.shape, f"{simulated.shape} against {reference.shape}")
        scale = np.abs(reference).max(axis=0)
        error = (np.abs(simulated - reference).max(axis=0) / np.where(scale > 0, scale, 1.0)).max()
        check(error <= 1e-12, f"differs by {error:g}")
        worst = max(worst, error)
    return f"worst relative difference {worst:g}"


def saved_state_replays_to_the_bit(archive):
    rows, outputs = excitation(archive, 300, seed=2), outputs_of(archive)
    first = archive.open()
    first.initialize()
    first.run(rows[:100], outputs)
    state = first.get_state()
    data = first.serialize(state)
    expected = first.run(rows[100:], outputs, 100 * archive.step)

    first.set_state(state)
    check(np.array_equal(first.run(rows[100:], outputs, 100 * archive.step), expected), "set back differs")
    first.free_state(state)

    second = archive.open(name="second")
    restored = second.deserialize(data)
    second.set_state(restored)
    check(np.array_equal(second.run(rows[100:], outputs, 100 * archive.step), expected), "restored differs")
    second.set_state(restored)
    again = second.get_state()
    check(second.serialize(again) == data, "serialized again, it differs")
    for wrong, reason in (
        (data[:10], "too few" if len(data[:10]) < 8 else "cut off"),
        (data[:-1], "whole length"),
        (b"X" + data[1:], "begin"),
        (data[:-20] + bytes([data[-20] ^ 1]) + data[-19:], "checksum"),
        (data[:8] + b"\7" + data[9:], "layout"),
    ):
        second.refused("damaged state", lambda: second.deserialize(wrong), reason)
    second.free_state(restored)
    second.free_state(again)
    first.free()
    second.free()
    return f"{len(data)} bytes"


def instances_do_not_disturb_each_other(archive):
    rows, outputs = excitation(archive, 100, seed=3), outputs_of(archive)
    alone = archive.open()
    alone.initialize()
    expected = alone.run(rows, outputs)
    alone.fmu.reset()
    alone.initialize()
    check(np.array_equal(alone.run(rows, outputs), expected), "after reset it differs")

    several = [archive.open(name=f"instance{i}") for i in range(4)]
    for instance in several:
        instance.initialize()
    inputs = [v.valueReference for v in archive.variables("input")]
    results = [[] for _ in several]
    for k, row in enumerate(rows):
        for i, instance in enumerate(several):
            instance.set(inputs, list(row * (i + 1)))
            instance.step(k * archive.step)
            results[i].append(instance.get(outputs))
    check(np.array_equal(np.array(results[0]), expected), "beside others it differs")
    check(not np.array_equal(results[1], results[0]), "two instances share their inputs")
    kept = several[2].get_state()
    for i in (1, 3, 0):
        several[i].free()
    several[2].free_state(kept)
    several[2].free()
    alone.free()


def wrong_calls_are_refused_with_a_reason(archive):
    inputs = [v.valueReference for v in archive.variables("input")]
    outputs = outputs_of(archive)
    unlike = archive.open(instantiate=False)
    wrong = archive.open(token="{wrong}", instantiate=False)
    for what, action, expected in (
        ("step before initialization", lambda i: i.step(0.0), "wrong order"),
        ("leaving initialization first", lambda i: i.fmu.exitInitializationMode(), "wrong order"),
        ("output set", lambda i: i.set(outputs[:1], [1.0]), "cannot be set"),
        ("unknown reference read", lambda i: i.get([9999]), "value reference 9999"),
        ("unknown reference set", lambda i: i.set([9999], [1.0]), "value reference 9999"),
    ):
        instance = archive.open()
        instance.refused(what, lambda: action(instance), expected)
        instance.free()

    instance = archive.open()
    instance.initialize(start=1.0)
    refuse = instance.refused
    refuse("initialized twice", lambda: instance.initialize(), "wrong order")
    for value in (float("nan"), float("inf"), float("-inf")):
        for reference in inputs:
            refuse("input not finite", lambda: instance.set([reference], [value]), "finite")
    fixed = [v.valueReference for v in archive.variables("parameter") if v.variability == "fixed"]
    if fixed:
        refuse("fixed parameter", lambda: instance.set(fixed[:1], [1.0]), "cannot be set")
    refuse("wrong communication point", lambda: instance.step(1.0 + archive.step / 2), "communication point")
    refuse("communication point not a number", lambda: instance.step(float("nan")), "communication")
    refuse("backwards", lambda: instance.step(1.0, -archive.step), "step size")
    refuse("no step", lambda: instance.step(1.0, 0.0), "step size")
    refuse("endless step", lambda: instance.step(1.0, float("inf")), "step size")
    refuse("wrong type", lambda: get_wrong_type(instance, outputs[:1]), "is a Float64")
    # What was refused changed nothing: the instance still steps, and like a fresh one.
    rows = excitation(archive, 50, seed=4)
    fresh = archive.open()
    fresh.initialize(start=1.0)
    check(
        np.array_equal(instance.run(rows, outputs, 1.0), fresh.run(rows, outputs, 1.0)),
        "refused calls left a trace",
    )
    instance.fmu.terminate()
    refuse("step after termination", lambda: instance.step(1.0), "wrong order")
    refuse("terminated twice", lambda: instance.fmu.terminate(), "wrong order")
    instance.free()
    fresh.fmu.terminate()
    fresh.free()

    limited = archive.open()
    limited.initialize(stop=archive.step)
    limited.step(0.0)
    limited.refused("past the stop time", lambda: limited.step(archive.step), "stop time")
    limited.free()
    for closed in (unlike, wrong):
        closed.fmu.freeLibrary()


def get_wrong_type(instance, references):
    (instance.fmu.getBoolean)(references)


def wrong_token_is_refused_with_a_reason(archive):
    import common

    notes = []

    class Noted(common.Instance):
        def note(self, status, category, message):
            notes.append(message.decode())

    try:
        Noted(archive, token="{00000000-0000-0000-0000-000000000000}")
    except Failure:
        raise
    except Exception:
        pass
    else:
        raise Failure("a wrong token was accepted")
    check(any("token" in n for n in notes), f"no reason in the log: {notes}")


def event_mode_that_is_not_offered_does_no_harm(archive):
    if archive.is2:
        return "FMI 3.0 only"
    outputs = outputs_of(archive)
    rows = excitation(archive, 20, seed=7)
    plain, eager = archive.open(), archive.open(eventModeUsed=True)
    check(any("event mode" in m for _, _, m in eager.log), f"no warning in {eager.log}")
    for instance in (plain, eager):
        instance.initialize()
    eager.fmu.updateDiscreteStates()
    eager.fmu.enterStepMode()
    first = eager.run(rows, outputs)
    check(np.array_equal(first, plain.run(rows, outputs)), "event mode changes the result")
    eager.fmu.enterEventMode()
    eager.fmu.updateDiscreteStates()
    eager.fmu.enterStepMode()
    plain.refused("event mode", plain.fmu.enterEventMode, "wrong order")
    for instance in (plain, eager):
        instance.free()


def dependencies_are_those_of_the_description(archive):
    if archive.is2:
        return "FMI 3.0 only"
    instance = archive.open()
    for output in archive.description.outputs:
        # fmpy's own wrapper asks for the number with a type instead of a value, so by hand.
        reference, count = output.variable.valueReference, ctypes.c_size_t()
        fmu, component = instance.fmu, instance.fmu.component
        fmu.fmi3GetNumberOfVariableDependencies(component, reference, ctypes.byref(count))
        sizes = [(ctypes.c_size_t * count.value)() for _ in range(2)]
        references, kinds = (ctypes.c_uint32 * count.value)(), (ctypes.c_int * count.value)()
        fmu.fmi3GetVariableDependencies(
            component, reference, sizes[0], references, sizes[1], kinds, count)
        found = list(references)
        expected = [v.valueReference for v in output.dependencies]
        check(found == expected, f"{output.variable.name}: {found} against {expected}")
    instance.free()


def debug_logging_can_be_switched(archive):
    instance = archive.open(debug=True)
    instance.initialize()
    check(any(c == "logEvents" for _, c, _ in instance.log), f"no events in {instance.log}")
    instance.fmu.setDebugLogging(False, ["logEvents"])
    before = len(instance.log)
    instance.fmu.terminate()
    check(len(instance.log) == before, "logs although switched off")
    instance.refused("category", lambda: instance.fmu.setDebugLogging(True, ["x"]), "category")
    instance.free()


def derivatives_agree_with_differences(archive):
    if not archive.offers("providesDirectionalDerivative"):
        instance = archive.open()
        instance.initialize()
        instance.refused("derivative", lambda: instance.fmu.getDirectionalDerivative([1], [1], [1.0]),
                         "offers no partial derivatives")
        instance.free()
        return "not offered, and refused"
    inputs = [v.valueReference for v in archive.variables("input")]
    outputs = outputs_of(archive)
    instance = archive.open()
    instance.initialize()
    instance.run(excitation(archive, 50, seed=5), outputs)
    for i, known in enumerate(inputs):
        size = 1e-3
        base = np.zeros(len(inputs))
        values = []
        for sign in (-1, 1):
            base[i] = sign * size
            instance.set(inputs, list(base))
            values.append(np.array(instance.get(outputs)))
        differences = (values[1] - values[0]) / (2 * size)
        derivative = instance.fmu.getDirectionalDerivative(outputs, [known], [1.0])
        check(np.allclose(derivative, differences, rtol=1e-6, atol=1e-9),
              f"{derivative} against {differences}")
        if not archive.is2:
            for row, unknown in enumerate(outputs):
                adjoint = instance.fmu.getAdjointDerivative([unknown], [known], [1.0])
                check(adjoint[0] == derivative[row], f"adjoint {adjoint} against {derivative}")
    parameter = archive.variables("parameter")[0].valueReference
    for unknowns, knowns in ((outputs, [parameter]), (inputs, inputs)):
        seed = [1.0] * len(knowns)
        instance.refused(
            "not an unknown or known",
            lambda: instance.fmu.getDirectionalDerivative(unknowns, knowns, seed), "is no")
    instance.free()


if __name__ == "__main__":
    main(
        [
            description_is_valid,
            simulation_equals_the_code_without_fmi,
            saved_state_replays_to_the_bit,
            instances_do_not_disturb_each_other,
            wrong_calls_are_refused_with_a_reason,
            wrong_token_is_refused_with_a_reason,
            event_mode_that_is_not_offered_does_no_harm,
            dependencies_are_those_of_the_description,
            debug_logging_can_be_switched,
            derivatives_agree_with_differences,
        ],
        sys.argv[1:],
    )
