"""The predictors whose errors are rewarded: a forward model and random network distillation."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import cast

import torch
from tensordict import TensorDict, TensorDictBase
from torch import Tensor, nn
from torch.nn import functional
from torchrl.modules import MLP
from torchrl.objectives.rnd import RNDLoss

from veca_marl.algos.intrinsic.intrinsic_reward import register_intrinsic
from veca_marl.algos.intrinsic.prediction import PredictionReward, PredictionRewardCfg
from veca_marl.algos.networks.encoders import VectorEncoder
from veca_marl.algos.networks.layers import orthogonal
from veca_marl.algos.specs import ArrayLayout, TeamSpec, action_key


class Embedding(nn.Module):
    """Vectors ``(n, D)`` of several senses to ``(n, features)``.

    Each sense has an encoder with outputs of about the same scale, whatever its length is.

    Args:
        widths: Sense to the length of its vector; D is their sum.
        features: Length of the output.
    """

    def __init__(self, widths: dict[str, int], features: int) -> None:
        super().__init__()
        self._widths = list(widths.values())
        self.encoders = nn.ModuleList(
            VectorEncoder(_normalised(width), features) for width in widths.values()
        )
        self.join = orthogonal(nn.Linear(features * len(widths), features))

    def forward(self, vectors: Tensor) -> Tensor:
        """Embed `vectors`."""
        parts = vectors.split(self._widths, dim=-1)
        encoded = [encoder(part) for encoder, part in zip(self.encoders, parts, strict=True)]
        embedded: Tensor = self.join(torch.cat(encoded, dim=-1))
        return embedded


def _normalised(width: int) -> ArrayLayout:
    return ArrayLayout((width,), "float32", -math.inf, math.inf)


@dataclass
class ForwardModelCfg(PredictionRewardCfg):
    """Numbers of the forward model."""

    name: str = "forward"


class ForwardModel(PredictionReward):
    """Error of a learnt network that predicts the next observation from observation and action.

    Observations are embedded by a fixed random network (Burda et al. 2019, "Large-scale study of
    curiosity-driven learning", random features). The predictor reads the embedded observation and
    every part of the action (discrete parts one-hot) and gives the change of the embedding.
    Observations that are random whatever the agent does keep a large error (the noisy-TV problem
    of that study). TorchRL has no forward model.
    """

    def make_model(self, widths: dict[str, int]) -> nn.Module:
        """See `PredictionReward`."""
        size, hidden = self.cfg.features, self.cfg.hidden
        actions = sum(layout.size for layout in self.spec.actions.values())
        embedding = Embedding(widths, size).requires_grad_(False)
        return _Prediction(embedding, MLP(size + actions, size, num_cells=[hidden, hidden]))

    def rows(self, batch: TensorDictBase, counted: Tensor) -> TensorDict:
        """See `PredictionReward`: observations before and after the steps, and actions."""
        after = self.read(batch["next"], counted)
        actions = joined_actions(batch, self.team, self.spec)[counted].to(after.device)
        before = self.read(batch, counted)
        return TensorDict({"before": before, "action": actions, "after": after}, [len(after)])

    def errors(self, rows: TensorDict) -> Tensor:
        """See `PredictionReward`."""
        before, after = (self.senses(rows[name]) for name in ("before", "after"))
        errors: Tensor = self.model(before, rows["action"], after)
        return errors


class _Prediction(nn.Module):
    """Squared error of the predicted change of the embedding."""

    def __init__(self, embedding: Embedding, change: nn.Module) -> None:
        super().__init__()
        self.embedding, self.change = embedding, change

    def forward(self, before: Tensor, action: Tensor, after: Tensor) -> Tensor:
        """Return errors ``(n,)``."""
        start, end = self.embedding(before), self.embedding(after)
        change = self.change(torch.cat([start, action], dim=-1))
        errors: Tensor = (start + change - end).square().mean(-1)
        return errors


def joined_actions(batch: TensorDictBase, team: str, spec: TeamSpec) -> Tensor:
    """Return all parts of the actions as one vector, ``(worlds, steps, agents, A)``."""
    parts = []
    for part, layout in spec.actions.items():
        action = batch[action_key(team, part)]
        if layout.discrete:
            action = functional.one_hot(action.long(), layout.size)
        parts.append(action.float())
    return torch.cat(parts, dim=-1)


register_intrinsic("forward", ForwardModelCfg, ForwardModel)


@dataclass
class RNDCfg(PredictionRewardCfg):
    """Numbers of random network distillation."""

    name: str = "rnd"


class RND(PredictionReward):
    """Error of a learnt network that predicts the output of a fixed random one.

    The error is large for observations that are unlike those that were learnt from. Both networks
    read the observation after the step. TorchRL's `RNDLoss` computes the error; its `RNDTransform`
    is not used: it computes rewards inside the environment, in each worker process by itself, for
    a single agent without a mask.
    """

    def make_model(self, widths: dict[str, int]) -> nn.Module:
        """See `PredictionReward`."""
        size, hidden = self.cfg.features, self.cfg.hidden
        predictor = nn.Sequential(
            Embedding(widths, size), nn.ReLU(), MLP(size, size, num_cells=[hidden, hidden])
        )
        loss = RNDLoss(predictor, Embedding(widths, size), reduction="none", update_fraction=1.0)
        loss.set_keys(observation="after")
        return cast(nn.Module, loss)

    def rows(self, batch: TensorDictBase, counted: Tensor) -> TensorDict:
        """See `PredictionReward`: the observations after the steps."""
        after = self.read(batch["next"], counted)
        return TensorDict({"after": after}, [len(after)])

    def errors(self, rows: TensorDict) -> Tensor:
        """See `PredictionReward`."""
        normalised = TensorDict({"after": self.senses(rows["after"])}, rows.batch_size)
        errors: Tensor = self.model(normalised)["loss_predictor"]
        return errors


register_intrinsic("rnd", RNDCfg, RND)
