"""Behaviour cloning: a policy that finds likely what a demonstrator did (Pomerleau 1989)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import torch
from tensordict import TensorDictBase
from tensordict.nn import TensorDictModuleBase
from torchrl.modules import set_recurrent_mode

from veca_marl.algos.algorithm import Algorithm, AlgorithmCfg
from veca_marl.algos.demonstrations import Demonstrations
from veca_marl.algos.imitation.loss import Imitated, ImitationLoss
from veca_marl.algos.imitation.samples import COUNTED, Samples, SequenceCfg
from veca_marl.algos.networks.factory import (
    NetworkCfg,
    copy_actor,
    make_network,
    trainable,
)
from veca_marl.algos.networks.layers import clip_norms, independent_parameters
from veca_marl.algos.networks.multisense import MultisenseCfg
from veca_marl.algos.specs import TeamSpec


@dataclass
class ImitatorCfg(AlgorithmCfg):
    """Numbers of algorithms that imitate; all of them are ours.

    Attributes:
        network: The network and its sizes, of which the actor learns. PPO with the same network
            starts from it by ``init_from``.
        learning_rate: Step size of Adam.
        batch_size: Labelled steps in an update.
        sequence_steps: Consecutive steps through which gradients of a network with hidden state
            flow; an update has ``batch_size / sequence_steps`` such sequences.
        burn_in: Steps before each sequence by which the hidden state is computed, from zero.
        least_scale: Standard deviation before tanh of continuous actions that the policy has learnt
            without an error, see `ImitationLoss`: what remains for PPO to explore with.
        max_gradient_norm: Gradients are scaled down to this norm.
    """

    network: NetworkCfg = field(default_factory=MultisenseCfg)
    learning_rate: float = 5e-4
    batch_size: int = 128
    sequence_steps: int = 32
    burn_in: int = 16
    least_scale: float = 0.2
    max_gradient_norm: float = 5.0

    def __post_init__(self) -> None:
        for name in ("learning_rate", "least_scale", "max_gradient_norm"):
            value = getattr(self, name)
            if not 0.0 < value < math.inf:
                raise ValueError(f"algo.{name} must be positive and finite, got {value}")
        for name in ("batch_size", "sequence_steps"):
            if getattr(self, name) < 1:
                raise ValueError(f"algo.{name} must be at least 1, got {getattr(self, name)}")
        if self.burn_in < 0:
            raise ValueError(f"algo.burn_in must be 0 or more, got {self.burn_in}")
        if self.network.recurrent and self.batch_size % self.sequence_steps:
            raise ValueError(
                f"algo.sequence_steps={self.sequence_steps} must divide algo.batch_size, "
                f"got {self.batch_size}"
            )


@dataclass
class BCCfg(ImitatorCfg):
    """Numbers of behaviour cloning; all of them are ours.

    A run of ``total_frames`` makes ``total_frames / batch_size`` updates.

    Attributes:
        held_out: Fraction of the episodes that is not learnt from, and gives ``held_out_loss``; 0
            for none.
    """

    name: str = "bc"
    held_out: float = 0.05

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 0.0 <= self.held_out < 1.0:
            raise ValueError(f"algo.held_out must be in [0, 1), got {self.held_out}")

    def check_budget(self, frames: int) -> None:
        """See `AlgorithmCfg`: an update takes `batch_size` frames."""
        if frames < self.batch_size:
            raise ValueError(f"they are fewer than algo.batch_size={self.batch_size} of one update")


class Imitator(Algorithm):
    """Base class of algorithms that learn an actor from labelled observations.

    Args:
        team: Name of the team: the first part of all its keys.
        spec: Its arrays.
        cfg: The numbers.
        device: Where it learns.
    """

    exact_resume = True

    def __init__(self, team: str, spec: TeamSpec, cfg: ImitatorCfg, device: torch.device) -> None:
        self.team, self.cfg, self._spec, self._device = team, cfg, spec, device
        self._actor = make_network(team, spec, cfg.network).actor.to(device)
        self._independent = independent_parameters([self._actor])
        self.optimizer = torch.optim.Adam(trainable(self._actor), cfg.learning_rate, fused=True)
        self.loss = ImitationLoss(team, spec.actions, cfg.least_scale)
        self._updates, self._due = 0, 0.0

    @property
    def network_cfg(self) -> NetworkCfg:
        """See `Algorithm`."""
        return self.cfg.network

    @property
    def actor(self) -> TensorDictModuleBase:
        """See `Algorithm`."""
        return self._actor

    def take_due(self, frames: int, updates_per_frame: float) -> int:
        """Return the number of updates for so many frames; what is left counts for the next."""
        self._due += frames * updates_per_frame
        whole = math.floor(self._due + 1e-9)  # 1 / batch_size may be rounded down
        self._due -= whole
        return whole

    def imitate(self, rows: TensorDictBase, loss: ImitationLoss | None = None) -> Imitated:
        """Return the loss of a sample, which is sequences for a network with hidden state."""
        rows = rows.to(self._device)
        with set_recurrent_mode(True):
            policy = self._actor.get_dist(rows.select(*self._actor.in_keys, strict=False))
        return (loss or self.loss)(policy, rows, rows[COUNTED])

    def update(self, imitated: Imitated) -> dict[str, float]:
        """Take one gradient step and return what was measured.

        Raises:
            FloatingPointError: If the gradient is not finite.
        """
        self.optimizer.zero_grad()
        imitated.loss.backward()
        norm = float(clip_norms(self._independent, self.cfg.max_gradient_norm))
        if not math.isfinite(norm):
            raise FloatingPointError(
                f"team {self.team!r}: the gradient is {norm}; observations are not finite, or the "
                "learning rate is too high"
            )
        self.optimizer.step()
        self._updates += 1
        return {
            "imitation_loss": float(imitated.loss.detach()),
            "action_error": float(imitated.error),
            "choice_agreement": float(imitated.agreement),
            "gradient_norm": norm,
        }

    def state_dict(self) -> dict[str, Any]:
        """See `Algorithm`: the actor, the optimiser and counts."""
        parts = {name: part.state_dict() for name, part in self.parts().items()}
        return parts | {"updates": self._updates, "due": self._due}

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """See `Algorithm`."""
        for name, part in self.parts().items():
            part.load_state_dict(state[name])
        self._updates, self._due = state["updates"], state["due"]

    def load_learnt(self, state: dict[str, Any]) -> None:
        """See `Algorithm`: the actor only."""
        self._actor.load_state_dict(state["actor"])

    def parts(self) -> dict[str, Any]:
        """Return what has a state of its own, by name."""
        return {"actor": self._actor, "optimizer": self.optimizer}

    def init_from(self, other: Algorithm) -> None:
        """See `Algorithm`: copies the actor of any algorithm with the same network."""
        copy_actor(self, other)


class BC(Imitator):
    """Behaviour cloning of one team.

    Its frames are demonstrated steps that were drawn; no world is stepped but for evaluations.
    Each step is drawn as often as any other.

    Args:
        team: Name of the team.
        spec: Its arrays.
        cfg: The numbers.
        device: Where it learns.
    """

    needs_experience = False
    needs_demonstrations = True

    _samples: Samples | None = None
    _held_out: Samples | None = None

    def __init__(self, team: str, spec: TeamSpec, cfg: BCCfg, device: torch.device) -> None:
        super().__init__(team, spec, cfg, device)
        self.cfg: BCCfg = cfg

    def take_demonstrations(self, demonstrations: Demonstrations) -> None:
        """See `Algorithm`."""
        last = len(demonstrations) - round(self.cfg.held_out * len(demonstrations))
        self._samples = self._draws_from(demonstrations, range(max(last, 1)))
        if last < len(demonstrations):
            held_out = range(max(last, 1), len(demonstrations))
            self._held_out = self._draws_from(demonstrations, held_out) if held_out else None

    def _draws_from(self, demonstrations: Demonstrations, episodes: Sequence[int]) -> Samples:
        return Samples(
            demonstrations,
            self.team,
            self._spec,
            self._actor,
            SequenceCfg(self.cfg.burn_in, self.cfg.sequence_steps),
            episodes,
        )

    @property
    def measures(self) -> list[str]:
        """See `Algorithm`."""
        return [*MEASURES, "held_out_loss", "epochs"]

    def learn(self, batch: TensorDictBase) -> dict[str, float]:
        """See `Algorithm`: make an update for each `batch_size` frames; the batch is empty."""
        if self._samples is None:
            raise RuntimeError("there are no demonstrations")
        size = self.cfg.batch_size
        count = self.take_due(batch.numel(), 1.0 / size)
        measured = [self.update(self.imitate(self._samples.draw(size))) for _ in range(count)]
        epochs = self._updates * size / self._samples.steps
        return mean(measured, MEASURES) | {"held_out_loss": self._validate(), "epochs": epochs}

    @torch.no_grad()
    def _validate(self) -> float:
        if self._held_out is None:
            return math.nan
        return float(self.imitate(self._held_out.draw(self.cfg.batch_size)).loss)


MEASURES = ("imitation_loss", "action_error", "choice_agreement", "gradient_norm")
"""Names of what an update measures."""


def mean(measured: Sequence[dict[str, float]], names: Sequence[str]) -> dict[str, float]:
    """Return the mean of each measure; not a number without any."""
    if not measured:
        return dict.fromkeys(names, math.nan)
    return {name: sum(one[name] for one in measured) / len(measured) for name in names}
