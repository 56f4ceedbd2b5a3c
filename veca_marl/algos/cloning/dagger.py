"""DAgger: the policy acts, the expert says what it would have done (Ross et al. 2011)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum
from typing import Any

import torch
from tensordict import TensorDictBase
from tensordict.nn import TensorDictModuleBase, TensorDictSequential
from torch import Tensor
from torchrl.envs import ExplorationType, set_exploration_type
from torchrl.envs.utils import exploration_type

from veca_marl.algos.acting import Arrays
from veca_marl.algos.cloning.bc import MEASURES, Imitator, ImitatorCfg, mean
from veca_marl.algos.demonstrations import Demonstrations
from veca_marl.algos.imitation.loss import Imitated, ImitationLoss
from veca_marl.algos.imitation.samples import COUNTED, Samples, SequenceCfg
from veca_marl.algos.networks.memory import memory_size
from veca_marl.algos.sac.config import ReplayCfg
from veca_marl.algos.sac.readers import memory_keys
from veca_marl.algos.sac.replay import VALID, Key, Replay, Span, StoredKeys, storage_needed
from veca_marl.algos.specs import TeamSpec, action_key
from veca_marl.algos.storage import StorageNeeded

LABEL = "expert_action"


class Acts(Enum):
    """Which actions a policy takes while it collects.

    Attributes:
        sampled: Drawn from its distribution. Where the labels have several modes, their mean can be
            an action that changes nothing; samples do not remain in such a state.
        most_likely: The deterministic actions, those of evaluations. The states that are labelled
            are then those that evaluations reach, which noise in many joints can prevent.
    """

    sampled = "sampled"
    most_likely = "most_likely"


@dataclass
class DaggerCfg(ImitatorCfg):
    """Numbers of DAgger; all of them are ours.

    Attributes:
        updates_per_frame: Updates for each frame that is collected.
        acts: See `Acts`.
        expert_frames: Frames over which the fraction of steps in which the expert acts falls from 1
            to 0; 0 lets the policy act from the start.
        demonstrated: Fraction of an update that is drawn from demonstrations, if there are any.
        replay: What was collected and labelled; the oldest is overwritten. Updates begin after
            `warm_up_frames`.
    """

    name: str = "dagger"
    updates_per_frame: float = 0.03125
    acts: Acts = Acts.sampled
    expert_frames: int = 20_000
    demonstrated: float = 0.25
    replay: ReplayCfg = field(default_factory=lambda: ReplayCfg(warm_up_frames=1_000))

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.updates_per_frame > 0.0:
            raise ValueError(
                f"algo.updates_per_frame must be positive, got {self.updates_per_frame}"
            )
        if self.expert_frames < 0:
            raise ValueError(f"algo.expert_frames must be 0 or more, got {self.expert_frames}")
        if not 0.0 <= self.demonstrated < 1.0:
            raise ValueError(f"algo.demonstrated must be in [0, 1), got {self.demonstrated}")

    def check_batch(self, worlds: int, steps: int) -> None:
        """See `AlgorithmCfg`: the replay buffer takes a batch and the ends of its episodes."""
        self.replay.check_batch(worlds * steps)

    def check_budget(self, frames: int) -> None:
        """See `AlgorithmCfg`: the frames of the warm-up precede the first update."""
        self.replay.check_budget(frames)


class MostLikely(TensorDictModuleBase):
    """Takes the deterministic action of a policy, whatever the exploration type asks for.

    Args:
        policy: The policy.
    """

    def __init__(self, policy: TensorDictModuleBase) -> None:
        super().__init__()
        self.policy = policy
        self.in_keys, self.out_keys = list(policy.in_keys), list(policy.out_keys)

    def forward(self, tensordict: TensorDictBase) -> TensorDictBase:
        """Write the action into `tensordict` and return it."""
        with set_exploration_type(ExplorationType.DETERMINISTIC):
            written: TensorDictBase = self.policy(tensordict)
        return written


class ExpertActs(TensorDictModuleBase):
    """Replaces a team's action by that of the expert in a fraction of the steps.

    Args:
        actions: Key of each part of the action to the key of its label.

    Attributes:
        fraction: Probability that the expert acts in a world and step, where the exploration type
            asks for samples.
    """

    fraction: Tensor

    def __init__(self, actions: Mapping[Key, Key]) -> None:
        super().__init__()
        self._labels = dict(actions)
        self.in_keys = [*actions, *actions.values()]
        self.out_keys = list(actions)
        self.register_buffer("fraction", torch.ones(()))

    def forward(self, tensordict: TensorDictBase) -> TensorDictBase:
        """Replace the action in place and return `tensordict`."""
        self.write(tensordict)
        return tensordict

    def write(self, arrays: Arrays) -> None:
        """See `acting.WritesArrays`."""
        if float(self.fraction) == 0.0 or exploration_type() not in (ExplorationType.RANDOM, None):
            return
        first = arrays[next(iter(self._labels))]
        expert = torch.rand(first.shape[0]) < self.fraction.cpu()
        for key, label in self._labels.items():
            action = arrays[key]
            chosen = expert.view(-1, *[1] * (action.ndim - 1)).to(action.device)
            arrays[key] = torch.where(chosen, arrays[label], action)


class Dagger(Imitator):
    """DAgger of one team.

    Collected observations and the expert's actions in them are stored, and every update draws from
    all that are stored, and from demonstrations if there are any.

    Args:
        team: Name of the team.
        spec: Its arrays.
        cfg: The numbers.
        device: Where it learns.
    """

    needs_labels = True

    _samples: Samples | None = None

    def __init__(self, team: str, spec: TeamSpec, cfg: DaggerCfg, device: torch.device) -> None:
        super().__init__(team, spec, cfg, device)
        self.cfg: DaggerCfg = cfg
        self.exact_resume = cfg.replay.in_checkpoint
        labels = {part: _label_key(team, part) for part in spec.actions}
        self._labelled = ImitationLoss(team, spec.actions, cfg.least_scale, labels)
        actions = {action_key(team, part): label for part, label in labels.items()}
        self._expert = ExpertActs(actions).to(device)
        self._set_fraction(0)
        acting = self._actor if cfg.acts is Acts.sampled else MostLikely(self._actor)
        self._explorer = TensorDictSequential(acting, self._expert)
        self._memory = memory_keys(self._actor, team)
        span = Span(cfg.burn_in, cfg.sequence_steps, 1) if self._memory else Span(0, 1, 1)
        keys = StoredKeys.of(team, spec, self._memory)
        self.replay = Replay(
            StoredKeys(team, keys.observation, keys.mask, keys.memory, tuple(labels.values())),
            cfg.replay,
            span,
        )
        self._span = span

    @property
    def explorer(self) -> TensorDictModuleBase:
        """See `Algorithm`: in a fraction of the steps the expert acts."""
        return self._explorer

    @property
    def measures(self) -> list[str]:
        """See `Algorithm`."""
        return [*MEASURES, "expert_fraction", "updates", "replay_rows"]

    @property
    def storage_needed(self) -> StorageNeeded:
        """See `Algorithm`: the replay buffer."""
        return storage_needed(self._spec, self.cfg.replay, memory_size(self._actor))

    def take_demonstrations(self, demonstrations: Demonstrations) -> None:
        """See `Algorithm`."""
        sequence = SequenceCfg(self.cfg.burn_in, self.cfg.sequence_steps)
        every = range(len(demonstrations))
        self._samples = Samples(demonstrations, self.team, self._spec, self._actor, sequence, every)

    def learn(self, batch: TensorDictBase) -> dict[str, float]:
        """See `Algorithm`: store the batch and make the updates that are due."""
        fraction = float(self._expert.fraction)
        self.replay.extend(batch)
        self._set_fraction(self.replay.frames)
        due = self.take_due(batch.numel(), self.cfg.updates_per_frame) if self.replay.ready else 0
        measured = [self.update(self._sample()) for _ in range(due)]
        return mean(measured, MEASURES) | {
            "expert_fraction": fraction,
            "updates": float(self._updates),
            "replay_rows": float(len(self.replay)),
        }

    def _set_fraction(self, frames: int) -> None:
        over = self.cfg.expert_frames
        self._expert.fraction.fill_(max(0.0, 1.0 - frames / over) if over else 0.0)

    def _sample(self) -> Imitated:
        """Return the loss of a sample of what is stored, and of demonstrations."""
        size = self.cfg.batch_size
        shown = round(self.cfg.demonstrated * size) if self._samples is not None else 0
        collected = self.imitate(self._collected(size - shown), self._labelled)
        if self._samples is None or not shown:
            return collected
        demonstrated = self.imitate(self._samples.draw(shown))
        weight = shown / size
        return Imitated(
            (1.0 - weight) * collected.loss + weight * demonstrated.loss,
            collected.error,
            collected.agreement,
        )

    def _collected(self, rows: int) -> TensorDictBase:
        span = self._span
        windows = self.replay.sample(max(1, rows // span.length))
        if windows.sequences is None:
            found, counted = windows.first, windows.took_place[:, 0]
        else:
            steps = span.burn_in + span.length
            found = windows.sequences[:, :steps]
            labels = windows.first.view(-1, span.length)
            for key in self._labels:
                found[key] = _behind(labels[key], span.burn_in)
            took_place = windows.took_place[:, 0].view(-1, span.length)
            counted = _behind(took_place, span.burn_in) & found[VALID]
        present = counted.unsqueeze(-1).expand(*counted.shape, self._spec.agents)
        mask = found.get((self.team, "mask"), None)
        found[COUNTED] = present if mask is None else present & mask
        return found

    @property
    def _labels(self) -> list[Key]:
        return [_label_key(self.team, part) for part in self._spec.actions]

    def parts(self) -> dict[str, Any]:
        """See `Imitator`."""
        return {**super().parts(), "replay": self.replay}

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """See `Algorithm`."""
        super().load_state_dict(state)
        self._set_fraction(self.replay.frames)


def _label_key(team: str, part: str) -> Key:
    own = action_key(team, part)
    return (own[0], LABEL, *own[2:])


def _behind(array: Tensor, steps: int) -> Tensor:
    """Return `array` ``(windows, length, ...)`` with zeros for the steps before."""
    before = array.new_zeros(array.shape[0], steps, *array.shape[2:])
    return torch.cat([before, array], 1)
