"""From the action tensors of a team to the numpy actions of its players."""

from __future__ import annotations

from typing import Any

import torch
from numpy.typing import NDArray
from tensordict import TensorDictBase
from torchrl.data import Composite, TensorSpec

# all players of a team in all worlds: one array ``(W, n, ...)``, or one for each part of the action
TeamActions = NDArray[Any] | dict[str, NDArray[Any]]


class ActionReader:
    """Reads one team's actions from the tensordict of a step, and checks their shapes.

    Args:
        team: The team's name.
        spec: Spec of `(team, "action")`.
    """

    def __init__(self, team: str, spec: TensorSpec) -> None:
        self._team = team
        self._spec = spec
        self._parts = dict(spec.items()) if isinstance(spec, Composite) else {}

    def read(self, tensordict: TensorDictBase) -> TeamActions:
        """Return the actions as numpy arrays.

        Raises:
            ValueError: If a tensor has another shape than its spec, or a type that numpy lacks.
        """
        action = tensordict.get((self._team, "action"))
        if not self._parts:
            return _to_numpy(f"action of {self._team}", action, self._spec)
        # TorchRL's policies write log-probabilities beside the parts
        if not isinstance(action, TensorDictBase) or not self._parts.keys() <= set(action.keys()):
            raise ValueError(
                f"action of {self._team} must be a tensordict with the parts {list(self._parts)}"
            )
        return {
            part: _to_numpy(f"action {part!r} of {self._team}", action.get(part), leaf)
            for part, leaf in self._parts.items()
        }


def action_of(actions: TeamActions, world: int, player: int) -> Any:
    """Return the action of one player: an array, or a mapping of parts."""
    if isinstance(actions, dict):
        return {part: array[world, player] for part, array in actions.items()}
    return actions[world, player]


def _to_numpy(what: str, action: Any, spec: TensorSpec) -> NDArray[Any]:
    if not isinstance(action, torch.Tensor) or action.shape != spec.shape:
        got = tuple(action.shape) if isinstance(action, torch.Tensor) else type(action).__name__
        raise ValueError(f"{what}: shape {got}, not {tuple(spec.shape)}")
    plain = action.is_cpu and not action.requires_grad
    try:
        array: NDArray[Any] = action.numpy() if plain else action.numpy(force=True)
    except TypeError:  # numpy has no such numbers
        raise ValueError(f"{what}: dtype {action.dtype}, not {spec.dtype}") from None
    return array
