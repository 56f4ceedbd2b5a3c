"""A network that hears only: the mean of both ears and their difference."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from tensordict.nn import TensorDictModule
from torch import nn

from veca_marl.extend import NetworkCfg, NetworkFactory, register_network


@dataclass
class ComparedEarsCfg(NetworkCfg):
    """Numbers of the network.

    Attributes:
        width: Length of the feature vector.
    """

    name: str = "compared_ears"
    width: int = 64


class ComparedEars(nn.Module):
    """Spectra ``(..., agents, 2, 250)`` to features ``(..., agents, width)``."""

    def __init__(self, width: int) -> None:
        super().__init__()
        self.layers = nn.Sequential(nn.Linear(500, width), nn.Tanh())

    def forward(self, audio: torch.Tensor) -> torch.Tensor:
        left, right = audio.unbind(-2)
        return self.layers(torch.cat([(left + right) / 2, left - right], -1))


class ComparedEarsNetwork(NetworkFactory):
    """Heads and distributions follow from the action; only the encoder is here."""

    def __init__(self, team, spec, cfg: ComparedEarsCfg) -> None:
        super().__init__(team, spec, cfg)
        self.features = cfg.width

    def encoder(self) -> TensorDictModule:
        return TensorDictModule(
            ComparedEars(self.cfg.width),
            in_keys=[(self.team, "observation", "audio")],
            out_keys=[(self.team, "features")],
        )


register_network("compared_ears", ComparedEarsCfg, ComparedEarsNetwork)
