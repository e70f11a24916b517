"""Hydraulic shake tables as FMI components, co-simulated, identified and diagnosed.

Every function runs the program ``shakebench`` that comes with this package and returns what it
computed: :class:`Result` reads like the JSON object that the program prints, and holds the traces.

>>> import shakebench
>>> run = shakebench.run("mpc", duration="5 s")
>>> run["tracking"]["time_domain_percent"]      # doctest: +SKIP
2.1
>>> run.traces["table.displacement"].shape      # doctest: +SKIP
(2501,)
"""

from ._campaign import campaign
from ._commands import compare, design, diagnose, doctor, identify, run, tune
from ._fmus import fmu, fmus
from ._program import Error, InputError, ProgramMissing, program, version
from ._results import Result

__all__ = [
    "Error",
    "InputError",
    "ProgramMissing",
    "Result",
    "campaign",
    "compare",
    "design",
    "diagnose",
    "doctor",
    "fmu",
    "fmus",
    "identify",
    "program",
    "run",
    "tune",
    "version",
]
__version__ = version()
