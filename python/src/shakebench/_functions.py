"""Functions in place of components of a system."""

from __future__ import annotations

import inspect
import pickle
from typing import Any, Callable, Dict, List, Mapping, Optional, Union

from ._program import InputError

Outputs = Union[float, Mapping[str, float]]


class Function:
    """A function in place of a component, with inputs that the component has not.

    The names of the function's arguments are those of inputs of the component, or ``time`` and
    ``step`` (s); ``**inputs`` takes all inputs. It gives the output, or a dictionary of outputs. All
    values are SI. Where the component is sampled (a controller), the function is called at every
    sample with the values of that moment. Otherwise (a specimen) it is called for every step and
    gives what the outputs are at its end.

    ``inputs`` names the source of further inputs, ``{"force": "table.actuator_force"}``, and
    ``period`` (s) the time between two calls.

    >>> def law(displacement, velocity, reference_displacement):
    ...     return 40.0 * (reference_displacement - displacement) - 0.1 * velocity
    >>> law = Function(law, inputs={"displacement": "table.displacement", "velocity": "table.velocity"})

    A plain function has no state of its own. An object with ``__call__`` has: its attributes are
    saved and restored with the simulation.
    """

    def __init__(
        self,
        callable: Callable[..., Outputs],
        *,
        inputs: Optional[Mapping[str, str]] = None,
        period: Optional[float] = None,
    ) -> None:
        self.callable = callable
        self.sources: Dict[str, str] = dict(inputs or {})
        self.period = period
        #: Name of the component; given by the simulation.
        self.component = ""
        self.arguments: List[str] = []
        self.takes_all = False
        self.label = getattr(callable, "__qualname__", type(callable).__qualname__) + "()"
        self._read_signature()

    def _read_signature(self) -> None:
        if not callable(self.callable):
            raise InputError(f"{self.callable!r} cannot be called; expected a function")
        try:
            parameters = inspect.signature(self.callable).parameters.values()
        except (TypeError, ValueError):
            raise InputError(
                f"{self.label}: the names of its arguments cannot be read; wrap it in a function"
            ) from None
        for parameter in parameters:
            if parameter.kind is parameter.VAR_KEYWORD:
                self.takes_all = True
            elif parameter.kind is parameter.VAR_POSITIONAL or (
                parameter.kind is parameter.KEYWORD_ONLY and parameter.default is parameter.empty
            ):
                raise InputError(
                    f"{self.label}: `{parameter}` is not allowed; its arguments are named as inputs"
                )
            elif parameter.kind is not parameter.KEYWORD_ONLY and (
                parameter.default is parameter.empty
            ):
                self.arguments.append(parameter.name)
        if self.takes_all and self.arguments:
            raise InputError(
                f"{self.label}: it takes named arguments and **{{all inputs}}; expected one of both"
            )

    def given(self) -> Dict[str, Any]:
        """What the library is told of it."""
        return {
            "component": self.component,
            "arguments": [name for name in self.arguments if name not in ("time", "step")],
            "sources": self.sources,
            "period": self.period,
            "label": self.label,
        }

    def named(self, component: str) -> "Function":
        """The same for a component."""
        named = Function(self.callable, inputs=self.sources, period=self.period)
        named.component = component
        return named


def adapted(function: Function, interface: Mapping[str, Any]) -> Callable[..., None]:
    """The function as the library calls it: time, step, inputs and outputs in the component's order."""
    inputs, outputs = list(interface["inputs"]), list(interface["outputs"])
    single, call = interface["single"], function.callable
    special = {"time": -1, "step": -2}
    places = [special.get(name, -3) if name in special else inputs.index(name) for name in function.arguments]

    def adapter(time: float, step: float, given: Any, into: Any) -> None:
        if function.takes_all:
            result = call(**{name: given[place] for place, name in enumerate(inputs)})
        else:
            result = call(
                *[given[at] if at >= 0 else time if at == -1 else step for at in places]
            )
        if isinstance(result, Mapping):
            for name, value in result.items():
                if name not in outputs:
                    raise InputError(
                        f"{function.label} gives `{name}`, which is not an output of "
                        f"`{function.component}`; expected some of {', '.join(outputs)}"
                    )
                into[outputs.index(name)] = float(value)
            return
        if single is None:
            raise InputError(
                f"`{function.component}` has several outputs; {function.label} gives {result!r}, "
                f"expected a dictionary with {', '.join(outputs)}"
            )
        try:
            into[single] = float(result)
        except (TypeError, ValueError):
            raise InputError(
                f"{function.label} gives {result!r}, expected a number or a dictionary of outputs"
            ) from None

    return adapter


def owner(function: Any) -> Any:
    """What keeps the state of a callable: the object of a bound method, or the object itself."""
    return getattr(function, "__self__", function)


def save(function: Any) -> bytes:
    """The attributes of a callable object; nothing of a plain function."""
    if inspect.isfunction(function) or inspect.isbuiltin(function):
        return b""
    return pickle.dumps(vars(owner(function)) if hasattr(owner(function), "__dict__") else {})


def restore(function: Any, state: bytes) -> None:
    """Gives a callable object the attributes that :func:`save` read."""
    if state:
        attributes = vars(owner(function)) if hasattr(owner(function), "__dict__") else {}
        attributes.clear()
        attributes.update(pickle.loads(state))
