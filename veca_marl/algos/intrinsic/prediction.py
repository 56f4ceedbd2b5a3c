"""Base class of intrinsic rewards that are the errors of a predictor which learns online."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

import torch
from tensordict import TensorDict, TensorDictBase
from torch import Tensor, nn
from torch.nn import functional
from torchrl.envs.transforms.rnd import RunningMeanStd

from veca_marl.algos.intrinsic.intrinsic_reward import IntrinsicCfg, IntrinsicReward
from veca_marl.algos.specs import ArrayLayout, TeamSpec

_CLIP = 5.0  # standard deviations; Burda et al. 2019, section 2.4
_PROPRIOCEPTION = "proprioception"
_BLOCK = 64  # rows that are pooled at a time: their floats fit the cache


def chosen_senses(team: str, spec: TeamSpec, senses: Sequence[str]) -> list[str]:
    """Return the senses that an intrinsic reward reads.

    Args:
        team: Name of the team, for the error message.
        spec: Its arrays.
        senses: Names; none for all senses but proprioception, or for proprioception if the team
            has no other sense. Every movement changes proprioception, so that its novelty
            rewards movements of the body instead of what they cause.

    Raises:
        ValueError: If the team does not have one of them.
    """
    unknown = sorted(set(senses) - set(spec.observations))
    if unknown:
        raise ValueError(
            f"intrinsic.senses: team {team!r} has no {', '.join(unknown)}; "
            f"choices: {', '.join(spec.observations)}"
        )
    others = [name for name in spec.observations if name != _PROPRIOCEPTION]
    return list(senses) or others or list(spec.observations)


class NormalisedSenses(nn.Module):
    """Observations of some senses as vectors, normalised by running mean and deviation.

    Images are averaged over squares of pixels first, to at most `cells` values along each side:
    a model of 84 x 84 pixels would cost as much as the policy itself. Every value is normalised by
    itself and clipped to [-5, 5] standard deviations (Burda et al. 2019, "Exploration by random
    network distillation", section 2.4).

    Args:
        layouts: Sense to layout.
        cells: See above.

    Attributes:
        widths: Sense to the length of its vector.
    """

    def __init__(self, layouts: dict[str, ArrayLayout], cells: int) -> None:
        super().__init__()
        self._windows = {name: _window(layout, cells) for name, layout in layouts.items()}
        self.widths = {
            name: _width(layout, self._windows[name]) for name, layout in layouts.items()
        }
        self.statistics = nn.ModuleDict(
            {name: RunningMeanStd((width,)) for name, width in self.widths.items()}
        )

    def read(self, observations: TensorDictBase) -> Tensor:
        """Return vectors ``(n, D)`` that are not yet normalised.

        Args:
            observations: Sense to array, ``(n,)``.
        """
        parts = [
            _pooled(observations[name], window) if window > 1 else observations[name].flatten(1)
            for name, window in self._windows.items()
        ]
        return torch.cat([part.float() for part in parts], dim=-1)

    def update(self, vectors: Tensor) -> None:
        """Add vectors ``(n, D)`` to the statistics."""
        if not len(vectors):
            return
        for statistics, part in self._parts(vectors):
            statistics.update(part)

    def forward(self, vectors: Tensor) -> Tensor:
        """Normalise and clip vectors ``(n, D)``."""
        parts = [statistics.normalize(part) for statistics, part in self._parts(vectors)]
        return torch.cat(parts, dim=-1).clamp(-_CLIP, _CLIP)

    def _parts(self, vectors: Tensor) -> Iterator[tuple[RunningMeanStd, Tensor]]:
        """Return the statistics and the vectors of each sense."""
        statistics = list(self.statistics.values())
        return zip(statistics, vectors.split(list(self.widths.values()), dim=-1), strict=True)


def _window(layout: ArrayLayout, cells: int) -> int:
    """Return the edge of the squares of pixels that are averaged; 1 for what is not an image."""
    return math.ceil(max(layout.shape[-2:]) / cells) if layout.is_image else 1


def _width(layout: ArrayLayout, window: int) -> int:
    if window == 1:
        return math.prod(layout.shape)
    *stack, height, width = layout.shape
    return math.prod(stack) * math.ceil(height / window) * math.ceil(width / window)


def _pooled(images: Tensor, window: int) -> Tensor:
    """Return means over squares of pixels, ``(n, D)``."""
    parts = [
        functional.avg_pool2d(_stacked(part).float(), window, ceil_mode=True).flatten(1)
        for part in images.split(_BLOCK)
    ]
    return torch.cat(parts)


def _stacked(images: Tensor) -> Tensor:
    """Return ``(n, channels, height, width)``: eyes and colours are channels."""
    channels = math.prod(images.shape[1:-2])
    return images.reshape(len(images), channels, *images.shape[-2:])


@dataclass
class PredictionRewardCfg(IntrinsicCfg):
    """Numbers of a prediction error.

    Attributes:
        senses: Senses that are read; none for all but proprioception, or for proprioception in a
            team that has no other sense.
        cells: Images are averaged over squares of pixels to at most so many values along each side.
        features: Length of the embedded observation.
        hidden: Width of the two hidden layers of the predictor.
        learning_rate: Step size of Adam (ours: Burda et al. use 1e-4 with 100 times the frames).
        minibatches: Gradient steps on each batch, each on another part of it.
        warm_up: Passes over the first batch before the first reward: the error of an untrained
            predictor is large for every observation and would dominate the normalisation (ours).
    """

    senses: list[str] = field(default_factory=list)
    cells: int = 21
    features: int = 64
    hidden: int = 128
    learning_rate: float = 1e-3
    minibatches: int = 4
    warm_up: int = 8

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("cells", "features", "hidden", "minibatches"):
            if getattr(self, name) < 1:
                raise ValueError(f"intrinsic.{name} must be at least 1, got {getattr(self, name)}")
        if self.warm_up < 0:
            raise ValueError(f"intrinsic.warm_up must be 0 or more, got {self.warm_up}")
        if not self.learning_rate > 0.0:
            raise ValueError(f"intrinsic.learning_rate must be positive, got {self.learning_rate}")


class PredictionReward(IntrinsicReward):
    """Rewards that are squared errors of a predictor; agents of a team share it.

    A step counts if the agent is present before and after it; other steps have reward 0 and are
    not learnt from.

    Args:
        team: Name of the team.
        spec: Its arrays.
        cfg: The numbers.
        device: Where it learns.
    """

    def __init__(
        self, team: str, spec: TeamSpec, cfg: PredictionRewardCfg, device: torch.device
    ) -> None:
        self.team, self.spec, self.cfg, self._device = team, spec, cfg, device
        chosen = chosen_senses(team, spec, cfg.senses)
        layouts = {name: spec.observations[name] for name in chosen}
        self.senses = NormalisedSenses(layouts, cfg.cells)
        self.model = self.make_model(self.senses.widths).to(device)
        self.senses.to(device)
        learnt = [p for p in self.model.parameters() if p.requires_grad]
        self.optimizer = torch.optim.Adam(learnt, lr=cfg.learning_rate)
        self._warm = False

    @abstractmethod
    def make_model(self, widths: dict[str, int]) -> nn.Module:
        """Return fixed and learnt networks.

        Args:
            widths: Sense to the length of its normalised vector.
        """

    @abstractmethod
    def rows(self, batch: TensorDictBase, counted: Tensor) -> TensorDict:
        """Return what `errors` reads of the steps that count, ``(n,)``, not yet normalised.

        Args:
            batch: Experience ``(worlds, steps)``.
            counted: ``(worlds, steps, agents)``.
        """

    @abstractmethod
    def errors(self, rows: TensorDict) -> Tensor:
        """Return the squared error ``(n,)`` of each row of `rows`."""

    @property
    def measures(self) -> Sequence[str]:
        """See `IntrinsicReward`."""
        return ["intrinsic_loss"]

    def learn(self, batch: TensorDictBase) -> tuple[Tensor, dict[str, float]]:
        """See `IntrinsicReward`: one pass over the batch, more over the first one."""
        counted = counted_steps(batch, self.team)
        rows = self.rows(batch, counted)
        self.senses.update(rows["after"])
        if not self._warm and len(rows):
            self._warm = True
            for _ in range(self.cfg.warm_up):
                self._pass(rows)
        rewards = torch.zeros(counted.shape)
        with torch.no_grad():
            rewards[counted] = self.errors(rows).cpu()
        return rewards.unsqueeze(-1), {"intrinsic_loss": self._pass(rows)}

    def _pass(self, rows: TensorDict) -> float:
        """Take a gradient step on each minibatch; return the mean loss."""
        order = torch.randperm(len(rows)).to(self._device)
        parts = [part for part in order.chunk(self.cfg.minibatches) if len(part)]
        losses = [self._step(rows[part]) for part in parts]
        return sum(losses) / len(losses) if losses else math.nan

    def _step(self, rows: TensorDict) -> float:
        loss = self.errors(rows).mean()
        self.optimizer.zero_grad()
        loss.backward()
        self.optimizer.step()
        return float(loss.detach())

    def read(self, step: TensorDictBase, counted: Tensor) -> Tensor:
        """Return the observations of the steps that count as vectors ``(n, D)``.

        Args:
            step: The batch, or its ``next`` part.
            counted: ``(worlds, steps, agents)``.
        """
        observations = step[self.team, "observation"].select(*self.senses.widths)
        return self.senses.read(observations[counted].to(self._device))

    def state_dict(self) -> dict[str, Any]:
        """See `IntrinsicReward`."""
        parts = {name: part.state_dict() for name, part in self._parts().items()}
        return parts | {"warm": self._warm}

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """See `IntrinsicReward`."""
        for name, part in self._parts().items():
            part.load_state_dict(state[name])
        self._warm = state["warm"]

    def _parts(self) -> dict[str, Any]:
        return {"senses": self.senses, "model": self.model, "optimizer": self.optimizer}


def counted_steps(batch: TensorDictBase, team: str) -> Tensor:
    """Return which agents are present before and after a step, ``(worlds, steps, agents)``."""
    before = batch[team].get("mask", None)
    if before is None:
        return torch.ones_like(batch["next", team, "reward"].squeeze(-1), dtype=torch.bool)
    present: Tensor = before & batch["next", team, "mask"]
    return present
