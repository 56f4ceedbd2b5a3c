"""From features to the distribution of an action: a head for each of its parts.

Keys of a part named ``move``, written by `policy_head` and `action_distribution`::

    (team, "parameters", "move", "loc" | "scale" | "logits")   parameters of its distribution,
                                                               a mixture has all three
    (team, "action", "move")                                   the sample
    (team, "action", "move_log_prob")                          its log-probability

An action without named parts uses ``(team, "loc" | "scale" | "logits")``, ``(team, "action")`` and
``(team, "action_log_prob")``.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
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
    Draw,
    DrawnPart,
    draw_categorical,
    draw_tanh_normal,
)
from veca_marl.algos.networks.mixture import MixtureParameters, TanhNormalMixture, draw_mixture
from veca_marl.algos.specs import PLAIN, ActionLayout, action_key

SMALLEST_SCALE = 0.01
"""Lower bound of the scales that TensorDict's ``biased_softplus`` gives."""


def parameter_count(layout: ActionLayout, modes: int = 1) -> int:
    """Return the number of parameters of one part's distribution.

    Args:
        layout: Its layout.
        modes: Number of normal distributions that are mixed, if it is a vector.
    """
    if layout.discrete:
        return layout.size
    return 2 * layout.size if modes == 1 else modes * (2 * layout.size + 1)


def policy_head(
    team: str,
    part: str,
    layout: ActionLayout,
    layer: nn.Module,
    initial_scale: float = 1.0,
    modes: int = 1,
) -> ArrayModule:
    """Return the module that writes the parameters of one part's distribution.

    Args:
        team: Name of the team.
        part: Name of the part.
        layout: Its layout.
        layer: Maps features ``(..., agents, F)`` to ``(..., agents, P)``, see `parameter_count`.
        initial_scale: Standard deviation, before tanh, where `layer` returns 0; greater than
            `SMALLEST_SCALE`.
        modes: Number of normal distributions that are mixed.
    """
    if not layout.discrete:
        mapping = f"biased_softplus_{initial_scale}"
        if modes > 1:
            layer = MixtureParameters(layer, modes, layout.size, mapping)
        else:
            layer = nn.Sequential(layer, NormalParamExtractor(scale_mapping=mapping))
    keys = _parameter_keys(team, part, _form_of(layout, modes))
    return ArrayModule(layer, in_keys=[(team, "features")], out_keys=keys)


def action_distribution(
    team: str, actions: Mapping[str, ActionLayout], modes: int = 1
) -> ActionDistribution:
    """Return the module that draws an action from the parameters that the heads wrote.

    Several parts are independent given the observation: a `CompositeDistribution`.

    Args:
        team: Name of the team.
        actions: Name of each part to its layout.
        modes: Number of normal distributions that are mixed for a vector.
    """
    forms = {part: _form_of(layout, modes) for part, layout in actions.items()}
    parts = _drawn_parts(team, forms, log_prob_keys(team, actions))
    if set(actions) == {PLAIN}:
        return _plain_distribution(team, forms[PLAIN], parts)
    return ActionDistribution(
        parts,
        in_keys={"params": (team, "parameters")},
        out_keys=[action_key(team, part) for part in actions],
        distribution_class=CompositeDistribution,
        distribution_kwargs={
            "distribution_map": {part: form.kind for part, form in forms.items()},
            "name_map": {part: action_key(team, part) for part in actions},
            "extra_kwargs": {part: dict(form.options) for part, form in forms.items()},
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


@dataclass(frozen=True)
class _Form:
    """The form of a distribution.

    Attributes:
        kind: Its class.
        parameters: Names of its parameters, arguments of the class.
        draw: See `DrawnPart`; takes the parameters in their order.
        options: Further arguments of the class.
    """

    kind: type[Distribution]
    parameters: tuple[str, ...]
    draw: Draw
    options: Mapping[str, Any] = field(default_factory=dict)


_CHOICE = _Form(Categorical, ("logits",), draw_categorical)
_NORMAL = _Form(TanhNormal, ("loc", "scale"), draw_tanh_normal, {"low": -1.0, "high": 1.0})
_MIXTURE = _Form(TanhNormalMixture, ("loc", "scale", "logits"), draw_mixture)


def _form_of(layout: ActionLayout, modes: int) -> _Form:
    if layout.discrete:
        return _CHOICE
    return _NORMAL if modes == 1 else _MIXTURE


def _drawn_parts(
    team: str, forms: Mapping[str, _Form], log_probs: Sequence[tuple[str, ...]]
) -> list[DrawnPart]:
    return [
        DrawnPart(
            form.draw, tuple(_parameter_keys(team, part, form)), action_key(team, part), log_prob
        )
        for (part, form), log_prob in zip(forms.items(), log_probs, strict=True)
    ]


def _plain_distribution(team: str, form: _Form, parts: list[DrawnPart]) -> ActionDistribution:
    return ActionDistribution(
        parts,
        in_keys={name: (team, name) for name in form.parameters},
        out_keys=[(team, "action")],
        distribution_class=form.kind,
        distribution_kwargs=dict(form.options),
        log_prob_key=(team, "action_log_prob"),
    )


def _parameter_keys(team: str, part: str, form: _Form) -> list[tuple[str, ...]]:
    node = (team,) if part == PLAIN else (team, "parameters", part)
    return [(*node, name) for name in form.parameters]
