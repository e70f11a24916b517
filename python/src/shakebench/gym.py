"""A ``gymnasium`` environment: an agent in place of the table's controller.

    pip install gymnasium

>>> import shakebench.gym                                   # doctest: +SKIP
>>> env = shakebench.gym.ShakeTable("three-variable", specimen="yielding")   # doctest: +SKIP
>>> observation, info = env.reset(seed=1)                   # doctest: +SKIP
"""

from __future__ import annotations

from typing import Any, Dict, Optional, Sequence, SupportsFloat, Tuple

import gymnasium
import numpy as np

from ._functions import Function
from ._simulation import Simulation

#: What the agent sees: the motion that is asked for, and what is measured of the table.
OBSERVED = (
    "reference.displacement",
    "reference.velocity",
    "reference.acceleration",
    "table.displacement",
    "table.velocity",
    "table.acceleration",
)


class ShakeTable(gymnasium.Env):
    """The agent gives the valve's command, -1 to 1 of ``limit`` (V), at each sample of the controller.

    An action takes effect at the sample after the observation, as in a computer that needs one period
    to compute. The reward of a step is minus the squared error of ``signal`` (a pair: asked for, and
    done), relative to the motion's peak. An episode ends with its motion (``truncated``) or when the run
    is stopped (``terminated``). Without ``record`` or ``reference`` each seed of ``reset`` gives another
    motion. Further keywords are those of :class:`shakebench.Simulation`.
    """

    metadata: Dict[str, Any] = {"render_modes": []}

    def __init__(
        self,
        system: str = "three-variable",
        *,
        observed: Sequence[str] = OBSERVED,
        signal: Tuple[str, str] = ("reference.acceleration", "table.acceleration"),
        limit: float = 10.0,
        **keywords: Any,
    ) -> None:
        self.action_space = gymnasium.spaces.Box(-1.0, 1.0, (1,), np.float64)
        self.observation_space = gymnasium.spaces.Box(-np.inf, np.inf, (len(observed),), np.float64)
        self._system, self._keywords, self._limit = system, keywords, limit
        self._observed, self._signal = tuple(observed), signal
        self._command = 0.0
        self._begin(None)

    def _begin(self, seed: Optional[int]) -> None:
        keywords = dict(self._keywords)
        if seed is not None and not {"record", "reference", "seed"} & keywords.keys():
            keywords["seed"] = seed
        self._command = 0.0
        self.simulation = Simulation(
            self._system, functions={"control": Function(lambda: self._command)}, **keywords
        )
        names = self.simulation.names
        self._places = [names.index(name) for name in self._observed]
        self._pair = [names.index(name) for name in self._signal]
        self._values = self.simulation.signals
        self._start = None
        self._peak = 0.0

    def reset(
        self, *, seed: Optional[int] = None, options: Optional[Dict[str, Any]] = None
    ) -> Tuple[np.ndarray, Dict[str, Any]]:
        super().reset(seed=seed)
        motion = None if seed is None else int(self.np_random.integers(1, 2**31))
        self._begin(motion)
        return self._values[self._places], {"time": 0.0}

    def step(
        self, action: Any
    ) -> Tuple[np.ndarray, SupportsFloat, bool, bool, Dict[str, Any]]:
        command = float(np.asarray(action, dtype=float).reshape(-1)[0])
        self._command = self._limit * min(max(command, -1.0), 1.0)
        self.simulation.step()
        asked, done = self._values[self._pair]
        self._peak = max(self._peak, abs(asked))
        reward = -(((asked - done) / max(self._peak, 1e-3)) ** 2)
        ended = self.simulation.ended
        over = ended is not None
        info = {"time": self.simulation.time, "ended": ended}
        return self._values[self._places], reward, over and ended != "complete", ended == "complete", info
