"""From features to the distribution of an action: a head for each of its parts.

Keys of a part named ``move``, written by `policy_head` and `action_distribution`::

    (team, "parameters", "move", "loc" | "scale" | "logits")   parameters of its distribution
    (team, "action", "move")                                   the sample
    (team, "action", "move_log_prob")                          its log-probability

An action without named parts uses ``(team, "loc" | "scale" | "logits")``, ``(team, "action")`` and
``(team, "action_log_prob")``.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import torch
from tensordict import TensorDictBase
from tensordict.nn import CompositeDistribution, NormalParamExtractor
from torch import Tensor, nn
from torch.distributions import Categorical, Distribution
from torchrl.modules import TanhNormal

from veca_marl.algos.acting import (
    ActionDistribution,
    ArrayModule,
    DrawnPart,
    draw_categorical,
    draw_tanh_normal,
)
from veca_marl.algos.specs import PLAIN, ActionLayout, action_key

_UNIT = {"low": -1.0, "high": 1.0}
SMALLEST_SCALE = 0.01
"""Lower bound of the scales that TensorDict's ``biased_softplus`` gives."""


def policy_head(
    team: str, part: str, layout: ActionLayout, layer: nn.Module, initial_scale: float = 1.0
) -> ArrayModule:
    """Return the module that writes the parameters of one part's distribution.

    Args:
        team: Name of the team.
        part: Name of the part.
        layout: Its layout.
        layer: Maps features ``(..., agents, F)`` to ``(..., agents, layout.parameters)``.
        initial_scale: Standard deviation, before tanh, where `layer` returns 0; greater than
            `SMALLEST_SCALE`.
    """
    if not layout.discrete:
        mapping = f"biased_softplus_{initial_scale}"
        layer = nn.Sequential(layer, NormalParamExtractor(scale_mapping=mapping))
    keys = _parameter_keys(team, part, layout)
    return ArrayModule(layer, in_keys=[(team, "features")], out_keys=keys)


def action_distribution(team: str, actions: Mapping[str, ActionLayout]) -> ActionDistribution:
    """Return the module that draws an action from the parameters that the heads wrote.

    Several parts are independent given the observation: a `CompositeDistribution`.
    """
    parts = _drawn_parts(team, actions)
    if set(actions) == {PLAIN}:
        return _plain_distribution(team, actions[PLAIN], parts)
    return ActionDistribution(
        parts,
        in_keys={"params": (team, "parameters")},
        out_keys=[action_key(team, part) for part in actions],
        distribution_class=CompositeDistribution,
        distribution_kwargs={
            "distribution_map": {part: _class_of(layout) for part, layout in actions.items()},
            "name_map": {part: action_key(team, part) for part in actions},
            "extra_kwargs": {part: _options_of(layout) for part, layout in actions.items()},
        },
    )


def log_prob_keys(team: str, actions: Mapping[str, ActionLayout]) -> list[tuple[str, ...]]:
    """Return where the log-probabilities of the parts are written, in the order of `actions`."""
    return [
        (*key[:-1], f"{key[-1]}_log_prob") for key in (action_key(team, part) for part in actions)
    ]


def action_log_prob(distribution: Any, batch: TensorDictBase, team: str) -> Tensor:
    """Return the log-probability of the actions in a batch, ``(..., agents)``.

    Parts of an action are independent given the observation: theirs are added.

    Args:
        distribution: What ``actor.get_dist(batch)`` returns, for one part or several.
        batch: Has the actions of the team.
        team: Name of the team.
    """
    if isinstance(distribution, CompositeDistribution):
        parts = [part.log_prob(batch[key]) for key, part in distribution.dists.items()]
        return torch.stack(parts).sum(0)
    likelihood: Tensor = distribution.log_prob(batch[team, "action"])
    return likelihood


def _drawn_parts(team: str, actions: Mapping[str, ActionLayout]) -> list[DrawnPart]:
    return [
        DrawnPart(
            draw_categorical if layout.discrete else draw_tanh_normal,
            tuple(_parameter_keys(team, part, layout)),
            action_key(team, part),
            log_prob,
        )
        for (part, layout), log_prob in zip(
            actions.items(), log_prob_keys(team, actions), strict=True
        )
    ]


def _plain_distribution(
    team: str, layout: ActionLayout, parts: list[DrawnPart]
) -> ActionDistribution:
    return ActionDistribution(
        parts,
        in_keys={name: (team, name) for name in _parameter_names(layout)},
        out_keys=[(team, "action")],
        distribution_class=_class_of(layout),
        distribution_kwargs=_options_of(layout),
        log_prob_key=(team, "action_log_prob"),
    )


def _parameter_keys(team: str, part: str, layout: ActionLayout) -> list[tuple[str, ...]]:
    return [(*_parameter_node(team, part), name) for name in _parameter_names(layout)]


def _parameter_node(team: str, part: str) -> tuple[str, ...]:
    return (team,) if part == PLAIN else (team, "parameters", part)


def _parameter_names(layout: ActionLayout) -> list[str]:
    return ["logits"] if layout.discrete else ["loc", "scale"]


def _class_of(layout: ActionLayout) -> type[Distribution]:
    return Categorical if layout.discrete else TanhNormal


def _options_of(layout: ActionLayout) -> dict[str, Any]:
    return {} if layout.discrete else dict(_UNIT)
