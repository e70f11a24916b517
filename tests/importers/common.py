"""What the importers' scripts share: opening FMUs in fmpy, and running a component without FMI."""

import ctypes
import tempfile
import xml.etree.ElementTree as ElementTree
from ctypes import POINTER, byref, c_char_p, c_double, c_size_t, c_uint32, c_void_p

import numpy as np
from fmpy import extract, read_model_description
from fmpy.fmi2 import (
    FMU2Model,
    FMU2Slave,
    fmi2CallbackAllocateMemoryTYPE,
    fmi2CallbackFreeMemoryTYPE,
    fmi2CallbackFunctions,
    fmi2CallbackLoggerTYPE,
    fmi2StepFinishedTYPE,
)
from fmpy.fmi3 import FMU3Model, FMU3Slave
from fmpy.model_description import ModelDescription

# What a component that names no step of its own is stepped by, s.
STEP = 0.002


class Failure(Exception):
    pass


def check(condition, message):
    if not condition:
        raise Failure(message)


class Archive:
    """An FMU unpacked: its description and where it lies."""

    def __init__(self, path):
        self.path = path
        # Kept until the archive goes; a library that is still loaded may keep it longer.
        self.kept = tempfile.TemporaryDirectory(prefix="fmu-", ignore_cleanup_errors=True)
        self.folder = self.kept.name
        extract(path, unzipdir=self.folder)
        self.description: ModelDescription = read_model_description(path)
        self.name = self.description.modelName
        self.is2 = self.description.fmiVersion == "2.0"
        self.label = f"{self.name} (FMI {self.description.fmiVersion})"
        experiment = self.description.defaultExperiment
        # Of a law that is sampled at a period of its own, no other step is taken.
        self.step = float(getattr(experiment, "stepSize", None) or STEP)
        self.references = {v.name: v.valueReference for v in self.description.modelVariables}

    def variables(self, causality, type_=None):
        """Variables of a causality, Float64 ones unless another type is named."""
        types = {type_} if type_ else {"Real", "Float64"}
        return [
            v
            for v in self.description.modelVariables
            if v.causality == causality and v.type in types
        ]

    def offers(self, ability):
        """Whether co-simulation has an ability; FMI 3.0 calls it by a plural."""
        root = ElementTree.parse(f"{self.folder}/modelDescription.xml").getroot()
        interface = root.find("CoSimulation")
        return "true" in (interface.get(ability), interface.get(ability + "s"))

    def open(self, **options):
        return Instance(self, **options)


class Instance:
    """One instance in fmpy that hides the difference between the versions and keeps the log."""

    def __init__(self, archive, name="instance", token=None, model_exchange=False, debug=False,
                 instantiate=True, **options):
        self.archive = archive
        self.is2 = archive.is2
        self.log = []
        description = archive.description
        interface = description.modelExchange if model_exchange else description.coSimulation
        types = [[FMU3Slave, FMU3Model], [FMU2Slave, FMU2Model]]
        self.fmu = types[self.is2][model_exchange](
            guid=description.guid if token is None else token,
            unzipDirectory=archive.folder,
            modelIdentifier=interface.modelIdentifier,
            instanceName=name,
        )
        if instantiate:
            if self.is2:
                self.callbacks = fmi2CallbackFunctions()
                self.callbacks.logger = fmi2CallbackLoggerTYPE(
                    lambda e, i, status, category, message: self.note(status, category, message))
                self.callbacks.allocateMemory = fmi2CallbackAllocateMemoryTYPE()
                self.callbacks.freeMemory = fmi2CallbackFreeMemoryTYPE()
                self.callbacks.stepFinished = fmi2StepFinishedTYPE()
                self.fmu.instantiate(callbacks=self.callbacks, loggingOn=debug)
            else:
                self.fmu.instantiate(
                    loggingOn=debug,
                    logMessage=lambda e, status, category, message:
                        self.note(status, category, message),
                    **options,
                )

    def note(self, status, category, message):
        text = message.decode()
        # In FMI 2.0 the text is a format for `printf`, in which `%%` stands for `%`.
        self.log.append((status, category.decode(), text.replace("%%", "%") if self.is2 else text))

    def refused(self, what, action, expected):
        """The action must fail with a status, and the log must say why."""
        before = len(self.log)
        try:
            action()
        except Exception as error:
            check("status" in str(error) or "nstantiate" in str(error), f"{what}: raised {error!r}")
        else:
            raise Failure(f"{what}: was not refused")
        messages = [message for _, _, message in self.log[before:]]
        check(messages, f"{what}: refused without a message")
        check(any(expected in m for m in messages), f"{what}: {messages} lacks `{expected}`")

    def initialize(self, start=0.0, stop=None, values=None):
        if self.is2:
            self.fmu.setupExperiment(startTime=start, stopTime=stop)
        for name, value in (values or {}).items():
            self.set([self.archive.references[name]], [value])
        if self.is2:
            self.fmu.enterInitializationMode()
        else:
            self.fmu.enterInitializationMode(startTime=start, stopTime=stop)
        self.fmu.exitInitializationMode()

    def set(self, references, values):
        (self.fmu.setReal if self.is2 else self.fmu.setFloat64)(references, values)

    def get(self, references):
        return (self.fmu.getReal if self.is2 else self.fmu.getFloat64)(references)

    def set_integer(self, name, value):
        references = [self.archive.references[name]]
        (self.fmu.setInteger if self.is2 else self.fmu.setInt32)(references, [value])

    def set_choice(self, name, value):
        references = [self.archive.references[name]]
        (self.fmu.setInteger if self.is2 else self.fmu.setInt64)(references, [value])

    def get_state(self):
        return self.fmu.getFMUstate() if self.is2 else self.fmu.getFMUState()

    def set_state(self, state):
        (self.fmu.setFMUstate if self.is2 else self.fmu.setFMUState)(state)

    def free_state(self, state):
        (self.fmu.freeFMUstate if self.is2 else self.fmu.freeFMUState)(state)

    def serialize(self, state):
        return (self.fmu.serializeFMUstate if self.is2 else self.fmu.serializeFMUState)(state)

    def deserialize(self, data):
        return (self.fmu.deSerializeFMUstate if self.is2 else self.fmu.deserializeFMUState)(data)

    def step(self, time, size=None):
        size = self.archive.step if size is None else size
        self.fmu.doStep(currentCommunicationPoint=time, communicationStepSize=size)

    def run(self, rows, outputs, start=0.0):
        """Sets a row of inputs, steps, reads; returns a row of outputs for each step."""
        inputs = [v.valueReference for v in self.archive.variables("input")]
        results = []
        for k, row in enumerate(rows):
            if inputs:
                self.set(inputs, list(row))
            self.step(start + k * self.archive.step)
            results.append(self.get(outputs))
        return np.array(results)

    def free(self):
        self.fmu.freeInstance()


def excitation(archive, steps, seed=1):
    """Smooth inputs of about a tenth of their nominal values, one row a step."""
    random = np.random.default_rng(seed)
    time = archive.step * np.arange(steps)
    columns = []
    for variable in archive.variables("input"):
        size = 0.1 * float(variable.nominal or 1.0)
        frequencies = random.uniform(0.3, 8.0, 4)
        phases = random.uniform(0.0, 2 * np.pi, 4)
        wave = np.sin(2 * np.pi * np.outer(time, frequencies) + phases).sum(axis=1) / 4
        columns.append(size * wave)
    return np.array(columns).T.reshape(steps, len(columns))


class Job(ctypes.Structure):
    _fields_ = [
        ("parameters", POINTER(c_uint32)),
        ("parameter_values", POINTER(c_double)),
        ("parameter_count", c_size_t),
        ("inputs", POINTER(c_uint32)),
        ("input_values", POINTER(c_double)),
        ("input_count", c_size_t),
        ("outputs", POINTER(c_uint32)),
        ("output_values", POINTER(c_double)),
        ("output_count", c_size_t),
        ("steps", c_size_t),
        ("start_time", c_double),
        ("step_size", c_double),
    ]


def run_without_fmi(archive, rows, outputs, parameters=None):
    """The same run by the component's trait alone, past the C interface of FMI."""
    instance = archive.open(instantiate=False)
    library = instance.fmu.dll
    run, free = library.shakebench_run_without_fmi, library.shakebench_free_text
    run.argtypes, run.restype = [c_void_p], c_void_p
    free.argtypes, free.restype = [c_void_p], None
    named = {archive.references[n]: v for n, v in (parameters or {}).items()}
    integers = lambda values: (c_uint32 * max(1, len(values)))(*values)
    reals = lambda values: (c_double * max(1, len(values)))(*values)
    inputs = [v.valueReference for v in archive.variables("input")]
    rows = np.ascontiguousarray(rows, dtype=np.float64)
    results = np.zeros((len(rows), len(outputs)))
    job = Job(
        integers(list(named)), reals(list(named.values())), len(named),
        integers(inputs), rows.ctypes.data_as(POINTER(c_double)), len(inputs),
        integers(outputs), results.ctypes.data_as(POINTER(c_double)), len(outputs),
        len(rows), 0.0, archive.step,
    )
    problem = run(byref(job))
    if problem:
        message = ctypes.cast(problem, c_char_p).value.decode()
        free(problem)
        raise Failure(f"{archive.label}: without FMI: {message}")
    instance.fmu.freeLibrary()
    return results


def main(checks, paths):
    """Runs every check on every FMU and ends with the number of failures."""
    failures = 0
    for path in paths:
        archive = Archive(path)
        if archive.offers("needsExecutionTool"):
            # Its equations are another program's, which its own tests start.
            print(f"SKIPPED {archive.label}: needs another program")
            continue
        for function in checks:
            try:
                note = function(archive)
            except Exception as error:
                failures += 1
                print(f"FAILED {archive.label}: {function.__name__}: {type(error).__name__}: {error}")
            else:
                print(f"ok {archive.label}: {function.__name__}" + (f": {note}" if note else ""))
    raise SystemExit(1 if failures else 0)
