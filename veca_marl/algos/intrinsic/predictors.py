"""Error of a forward model: what an action does is rewarded while it cannot be predicted."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from tensordict import TensorDict, TensorDictBase
from torch import Tensor, nn
from torch.nn import functional
from torchrl.modules import MLP

from veca_marl.algos.intrinsic.embedding import Embedding
from veca_marl.algos.intrinsic.intrinsic_reward import register_intrinsic
from veca_marl.algos.intrinsic.prediction import PredictionReward, PredictionRewardCfg
from veca_marl.algos.specs import TeamSpec, action_key


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
