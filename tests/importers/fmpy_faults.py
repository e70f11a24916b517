"""A component that fails on demand: the importer gets a status and a reason, and lives on."""

import sys

from common import STEP, check, main
from fmpy.validation import validate_fmu

NONE, PANIC_IN_STEP, ERROR_IN_STEP, NAN, PANIC_IN_OUTPUTS, REFUSE = range(6)


def started(archive, fault, after=0, **values):
    instance = archive.open()
    instance.set_choice("fault", fault)
    instance.set_integer("fault_after", after)
    instance.initialize(values=values)
    return instance


def description_is_valid(archive):
    problems = validate_fmu(archive.path)
    check(problems == [], problems)


def panic_in_a_step_is_an_error_and_the_process_lives(archive):
    beside = started(archive, NONE)
    instance = started(archive, PANIC_IN_STEP, after=2)
    state = instance.get_state()
    instance.step(0.0)
    instance.step(STEP)
    instance.refused("panic", lambda: instance.step(2 * STEP), "step fails at 100 % on demand")
    check("src/lib.rs:" in instance.log[-1][2], f"no place in {instance.log[-1]}")
    # From now on it answers errors only, until it is freed.
    instance.refused("step", lambda: instance.step(3 * STEP), "panicked earlier")
    instance.refused("read", lambda: instance.get([archive.references["value"]]), "panicked earlier")
    instance.refused("reset", lambda: instance.fmu.reset(), "panicked earlier")
    instance.refused("state", lambda: instance.set_state(state), "panicked earlier")
    beside.step(0.0)
    beside.set_state(state)
    beside.free_state(state)
    instance.free()
    beside.free()


def panic_in_outputs_is_an_error(archive):
    instance = started(archive, PANIC_IN_OUTPUTS, after=1)
    instance.step(0.0)
    instance.refused("panic", lambda: instance.get([archive.references["value"]]), "outputs fail")
    instance.free()


def error_in_a_step_can_be_left_by_an_earlier_state_or_reset(archive):
    instance = started(archive, ERROR_IN_STEP, after=1)
    instance.step(0.0)
    state = instance.get_state()
    instance.refused("error", lambda: instance.step(STEP), "refused on demand")
    instance.refused("step", lambda: instance.step(STEP), "after a failed step")
    instance.set_state(state)
    instance.refused("error again", lambda: instance.step(STEP), "refused on demand")
    instance.fmu.reset()
    instance.initialize()
    instance.step(0.0)
    instance.free_state(state)
    instance.free()


def output_that_is_not_a_number_is_an_error_that_names_it(archive):
    instance = started(archive, NAN, after=1)
    value = [archive.references["value"]]
    instance.get(value)
    instance.step(0.0)
    instance.refused("nan", lambda: instance.get(value), "variable `value` became NaN at t = 0.002 s")
    instance.free()


def initialization_refused_names_the_parameter(archive):
    instance = archive.open()
    instance.set_choice("fault", REFUSE)
    instance.refused("initialization", instance.initialize, "parameter `fault` is 5")
    instance.free()


def values_of_every_type_arrive(archive):
    instance = archive.open()
    fmu, references = instance.fmu, archive.references
    instance.set_integer("fault_after", 7)
    instance.initialize(values={"gain": 2.0})
    instance.set([references["level"]], [3.0])
    fmu.setBoolean([references["enabled"]], [True])
    text = "50 % of größer"
    fmu.setString([references["label"]], [text])
    taps = [references[f"tap[{i}]"] for i in (1, 2, 3)]
    instance.set(taps, [1.0, 2.0, 4.0])
    check(instance.get([references["value"]])[0] == 6.0, "direct feedthrough")
    check(bool(fmu.getBoolean([references["active"]])[0]), "Boolean")
    echo = fmu.getString([references["echo"]])[0]
    check((echo.decode() if isinstance(echo, bytes) else echo) == text, f"text {echo}")
    integer = fmu.getInteger if archive.is2 else fmu.getInt32
    check(integer([references["fault_after"]])[0] == 7, "Int32")
    instance.step(0.0)
    check(integer([references["count"]])[0] == 1, "count")
    check(instance.get([references["sum"]])[0] == 7.0, "array")
    instance.set([references["gain"]], [-1.0])
    check(instance.get([references["value"]])[0] == -3.0, "tunable parameter")
    instance.free()


def values_out_of_range_are_refused_and_change_nothing(archive):
    instance = archive.open()
    references = archive.references
    instance.refused("choice", lambda: instance.set_choice("fault", 6), "0 (none), 1 (panic_in_step)")
    instance.refused("integer", lambda: instance.set_integer("fault_after", -1), "expected at least 0")
    instance.initialize()
    both = [references["gain"], references["level"]]
    instance.refused("range", lambda: instance.set(both, [2.0, 11.0]), "11 V, expected -10 to 10")
    check(instance.get(both) == [0.0, 0.0], "half of a refused call was carried out")
    instance.refused("wrong type", lambda: instance.set([references["enabled"]], [1.0]), "is a Boolean")
    instance.refused("Int32 fixed", lambda: instance.set_integer("fault_after", 1), "cannot be set")
    check(any("100 %" in v.description for v in archive.description.modelVariables), "escaped text")
    instance.free()


def null_pointers_and_wrong_lengths_are_refused(archive):
    import ctypes

    instance = archive.open()
    instance.initialize()
    fmu, component = instance.fmu, instance.fmu.component
    reference = (ctypes.c_uint32 * 1)(archive.references["level"])
    value = (ctypes.c_double * 2)(1.0, 2.0)
    if archive.is2:
        calls = [
            ("NULL", lambda: fmu.fmi2GetReal(component, None, 1, value)),
            ("NULL", lambda: fmu.fmi2GetReal(component, reference, 1, None)),
            ("NULL", lambda: fmu.fmi2SetReal(component, reference, 1, None)),
            ("NULL", lambda: fmu.fmi2GetFMUstate(component, None)),
            ("not a saved state", lambda: fmu.fmi2SetFMUstate(component, None)),
        ]
    else:
        calls = [
            ("NULL", lambda: fmu.fmi3GetFloat64(component, None, 1, value, 1)),
            ("NULL", lambda: fmu.fmi3GetFloat64(component, reference, 1, None, 1)),
            ("1 value references, but 2 values",
             lambda: fmu.fmi3SetFloat64(component, reference, 1, value, 2)),
            ("NULL", lambda: fmu.fmi3DoStep(component, 0.0, STEP, True, None, None, None, None)),
            ("not a saved state", lambda: fmu.fmi3SetFMUState(component, None)),
            ("no variables of this type",
             lambda: fmu.fmi3GetFloat32(component, reference, 1, (ctypes.c_float * 1)(), 1)),
            ("structural", lambda: fmu.enterConfigurationMode()),
        ]
    for expected, call in calls:
        instance.refused(expected, call, expected)
    # The instance is unharmed.
    instance.step(0.0)
    state = instance.get_state()
    kept = ctypes.c_void_p(state.value)
    instance.free_state(state)
    instance.refused("freed state", lambda: instance.set_state(kept), "already freed")
    instance.free()


if __name__ == "__main__":
    main(
        [
            description_is_valid,
            panic_in_a_step_is_an_error_and_the_process_lives,
            panic_in_outputs_is_an_error,
            error_in_a_step_can_be_left_by_an_earlier_state_or_reset,
            output_that_is_not_a_number_is_an_error_that_names_it,
            initialization_refused_names_the_parameter,
            values_of_every_type_arrive,
            values_out_of_range_are_refused_and_change_nothing,
            null_pointers_and_wrong_lengths_are_refused,
        ],
        sys.argv[1:],
    )
