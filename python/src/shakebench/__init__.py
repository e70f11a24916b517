"""Hydraulic shake tables as FMI components, co-simulated, identified and diagnosed.

Every function runs the program ``shakebench`` that comes with this package and returns what it
computed: :class:`Result` reads like the JSON object that the program prints, and holds the traces.
:class:`Simulation` steps a system inside of this process, with functions of Python in place of
components.

>>> import shakebench
>>> run = shakebench.run("mpc", duration="5 s")
>>> run["tracking"]["time_domain_percent"]      # doctest: +SKIP
2.1
>>> run.traces["table.displacement"].shape      # doctest: +SKIP
(2501,)
>>> sim = shakebench.Simulation("mpc", duration="2 s")     # doctest: +SKIP
>>> while sim.step():                                      # doctest: +SKIP
...     displacement = sim["table.displacement"]
"""

from ._campaign import campaign
from ._commands import (
    commission,
    compare,
    design,
    diagnose,
    doctor,
    export,
    identify,
    info,
    iterate,
    qualify,
    run,
    trs,
    tune,
    validate,
)
from ._fmus import fmu, fmus
from ._functions import Function
from ._program import Error, InputError, ProgramMissing, program, version
from ._results import Result
from ._simulation import Run, Simulation, State

__all__ = [
    "Error",
    "Function",
    "InputError",
    "ProgramMissing",
    "Result",
    "Run",
    "Simulation",
    "State",
    "campaign",
    "commission",
    "compare",
    "design",
    "diagnose",
    "doctor",
    "export",
    "fmu",
    "fmus",
    "identify",
    "info",
    "iterate",
    "program",
    "qualify",
    "run",
    "trs",
    "tune",
    "validate",
    "version",
]
__version__ = version()
