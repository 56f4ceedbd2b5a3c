"""Random network distillation (Burda et al. 2019, "Exploration by random network distillation")."""

from __future__ import annotations

from dataclasses import dataclass
from typing import cast

from tensordict import TensorDict, TensorDictBase
from torch import Tensor, nn
from torchrl.modules import MLP
from torchrl.objectives.rnd import RNDLoss

from veca_marl.algos.intrinsic.embedding import Embedding
from veca_marl.algos.intrinsic.intrinsic_reward import register_intrinsic
from veca_marl.algos.intrinsic.prediction import PredictionReward, PredictionRewardCfg


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
