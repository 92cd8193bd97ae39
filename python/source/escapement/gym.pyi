from collections.abc import Callable, Iterable, Mapping
from os import PathLike
from typing import Any

import gymnasium
import numpy as np
import numpy.typing as npt

from . import Outcome, Participant, Scenario, _Fault

_Array = npt.NDArray[np.float64]

class Env(gymnasium.Env[_Array, _Array]):
    agent: str
    action: _Array
    observation: _Array
    def __init__(
        self,
        scenario: str | PathLike[str] | Scenario,
        agent: str,
        *,
        reward: Callable[[_Array, _Array, float], float] | Mapping[str, float],
        reward_at: str = "step",
        terminated: Callable[[_Array, float], bool] | None = None,
        ranges: Mapping[str, tuple[Any, Any]] | None = None,
        set: Mapping[str, Any] | None = None,
        participants: Mapping[str, type[Participant] | str] | None = None,
        faults: _Fault | Iterable[_Fault] = (),
    ) -> None: ...
    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[_Array, dict[str, Any]]: ...
    def step(self, action: Any) -> tuple[_Array, float, bool, bool, dict[str, Any]]: ...
    def outcome(self) -> Outcome: ...
    def close(self) -> None: ...

class Policy:
    @staticmethod
    def of(env: Env, function: Callable[[_Array], Any]) -> type[Participant]: ...
