"""The numbers of soft actor-critic."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from enum import Enum

from veca_marl.algos.algorithm import AlgorithmCfg
from veca_marl.algos.imitation.term import ImitationCfg
from veca_marl.algos.networks.action_values import ActionValuesCfg, Normalisation
from veca_marl.algos.networks.factory import NetworkCfg, check_one_mode
from veca_marl.algos.networks.multisense import MultisenseCfg


class EncoderGradient(Enum):
    """Which loss trains the encoder, which actor and critics share.

    Attributes:
        both: The losses of the critics and of the policy.
        critic: The loss of the critics alone; the policy reads the features without gradient
            (Yarats et al. 2021, "Improving sample efficiency in model-free RL from images").
    """

    both = "both"
    critic = "critic"


class Targets(Enum):
    """The critics that give the targets.

    Attributes:
        average: A moving average of the critics.
        same: The critics themselves, which read both ends of a window in one batch (CrossQ,
            Bhatt et al. 2024, "CrossQ: batch normalization in deep reinforcement learning for
            greater sample efficiency and simplicity").
    """

    average = "average"
    same = "same"


class Adaptation(Enum):
    """How a temperature changes.

    Attributes:
        fixed: Stays at its initial value.
        automatic: Learnt so that the entropy stays near its target (Haarnoja et al. 2018, "Soft
            actor-critic algorithms and applications").
    """

    fixed = "fixed"
    automatic = "automatic"


@dataclass
class TemperatureCfg:
    """The weight alpha of the entropy, one for each part of the action.

    Attributes:
        initial: Initial value.
        adaptation: How it changes.
        entropy_per_dimension: Target entropy of a continuous part in nats, for each of its
            dimensions (-1: Haarnoja et al. 2018; the uniform policy on [-1, 1] has 0.69).
        entropy_of_choices: Target entropy of a discrete part as a fraction of that of the uniform
            policy (ours; Christodoulou 2019 takes 0.98, which is close to a random policy).
        learning_rate: Step size of Adam for the logarithms of automatic temperatures (ours: larger
            than that of the networks, because the right temperature is proportional to the rewards
            of a step, and those of the tasks differ by orders of magnitude).
        minimum: Lower bound of automatic temperatures. Without one they fall as long as the entropy
            is above its target, also before a reward has been found.
    """

    initial: float = 0.01
    adaptation: Adaptation = Adaptation.fixed
    entropy_per_dimension: float = -1.0
    entropy_of_choices: float = 0.3
    learning_rate: float = 2e-3
    minimum: float = 0.0

    def __post_init__(self) -> None:
        for name in ("initial", "learning_rate"):
            if not getattr(self, name) > 0.0:
                raise ValueError(f"temperature.{name} must be positive, got {getattr(self, name)}")
        if not 0.0 <= self.minimum <= self.initial:
            raise ValueError(
                f"temperature.minimum must be from 0 to temperature.initial ({self.initial}), got "
                f"{self.minimum}"
            )
        if not math.isfinite(self.entropy_per_dimension):
            raise ValueError(
                f"temperature.entropy_per_dimension={self.entropy_per_dimension} must be finite"
            )
        if not 0.0 <= self.entropy_of_choices <= 1.0:
            raise ValueError(
                f"temperature.entropy_of_choices must be in [0, 1], got {self.entropy_of_choices}"
            )


class Storage(Enum):
    """Where a replay buffer is.

    Attributes:
        memory: In memory.
        memmap: In memory-mapped files, which are removed at the end of the run; those of a run that
            was killed are removed by the next one in the same folder.
    """

    memory = "memory"
    memmap = "memmap"


@dataclass
class ReplayCfg:
    """The replay buffer.

    Attributes:
        capacity: Number of observations that are stored; the oldest are overwritten. Each end of an
            episode or of a batch takes one more than there are frames.
        warm_up_frames: Frames before the first update; the actions are uniformly random until then.
        storage: Where it is.
        folder: Folder for memory-mapped files; None for the system's temporary folder.
        in_checkpoint: Whether checkpoints contain it. Then a resumed run equals an uninterrupted
            one bit for bit, and each checkpoint takes as much disk space as the buffer, and
            saving it twice its memory. Otherwise a resumed run collects `warm_up_frames` with its
            policy before it goes on learning.
    """

    capacity: int = 50_000
    warm_up_frames: int = 2_000
    storage: Storage = Storage.memory
    folder: str | None = None
    in_checkpoint: bool = False

    def __post_init__(self) -> None:
        if self.warm_up_frames < 0:
            raise ValueError(f"replay.warm_up_frames must be 0 or more, got {self.warm_up_frames}")
        if self.capacity < max(self.warm_up_frames, 1):
            raise ValueError(
                f"replay.capacity={self.capacity} must be at least "
                f"replay.warm_up_frames={self.warm_up_frames}"
            )

    def check_batch(self, frames: int) -> None:
        """Check that it takes a batch of frames and the ends of its episodes.

        Raises:
            ValueError: If it does not.
        """
        if self.capacity < 2 * frames:
            raise ValueError(
                f"algo.replay.capacity={self.capacity} must be at least twice the {frames} frames "
                "of a batch"
            )

    def check_budget(self, frames: int) -> None:
        """Check that the frames of the warm-up precede the end of a run.

        Raises:
            ValueError: If they do not.
        """
        if frames < self.warm_up_frames:
            raise ValueError(
                f"the {frames} frames end before the first update, which needs "
                f"algo.replay.warm_up_frames={self.warm_up_frames}"
            )


@dataclass
class SACCfg(AlgorithmCfg):
    """Numbers of SAC; the defaults are those of the paper's table where it gives them.

    The table gives learning rate, batch size, temperature, gradient norm and discount. The others
    are ours, unless a source is named.

    Attributes:
        network: The encoder and its sizes; whether agents share parameters and what critics read.
        critic: Sizes of the critics.
        policy_hidden: Widths of the hidden layers between features and policy heads.
        encoder_gradient: Which loss trains the encoder.
        temperature: Weight of the entropy.
        replay: The replay buffer.
        gamma: Discount.
        steps: Number of rewards in a target before the value of the observation that follows
            (n-step returns; without correction for the policy that acted). The original algorithm
            has 1 (Haarnoja et al. 2018), with which values of rare rewards do not spread in the
            frames of a default run.
        learning_rate: Step size of Adam, for all parameters but the temperatures.
        batch_size: Frames in an update; those at which a batch or an episode ended are left out.
        sequence_steps: Consecutive steps through which gradients of a network with hidden state
            flow; an update has ``batch_size / sequence_steps`` such sequences. Not used without
            hidden state.
        burn_in: Steps before each sequence through which the stored hidden state is brought up to
            date without gradient; not used without hidden state.
        max_gradient_norm: The gradients of critics with encoder, and of policy heads, are each
            scaled down to this norm.
        targets: Which critics give the targets.
        tau: Fraction of the critics' parameters in the moving average that gives the targets (ours:
            twice the 0.005 of Haarnoja et al. 2018, because there are fewer updates).
        updates_per_frame: Updates for each frame that is collected.
        random_shift: Largest random shift of images in pixels, the same for both eyes; 0 for none.
        imitation: The term of imitation of a run with ``demonstrations=FOLDER``, in the unit of the
            values.
        demonstrated: Fraction of the replay buffer that demonstrations may fill before the first
            frame; they take the place of the warm-up.
    """

    name: str = "sac"
    network: NetworkCfg = field(default_factory=MultisenseCfg)
    critic: ActionValuesCfg = field(default_factory=ActionValuesCfg)
    policy_hidden: list[int] = field(default_factory=lambda: [256])
    encoder_gradient: EncoderGradient = EncoderGradient.both
    temperature: TemperatureCfg = field(default_factory=TemperatureCfg)
    replay: ReplayCfg = field(default_factory=ReplayCfg)
    gamma: float = 0.99
    steps: int = 5
    learning_rate: float = 2.5e-4
    batch_size: int = 64
    sequence_steps: int = 16
    burn_in: int = 8
    max_gradient_norm: float = 5.0
    targets: Targets = Targets.average
    tau: float = 0.01
    updates_per_frame: float = 0.125
    random_shift: int = 0
    imitation: ImitationCfg = field(default_factory=ImitationCfg)
    demonstrated: float = 0.5

    def __post_init__(self) -> None:
        if not 0.0 <= self.gamma <= 1.0:
            raise ValueError(f"algo.gamma must be in [0, 1], got {self.gamma}")
        if not 0.0 < self.tau <= 0.5:
            raise ValueError(f"algo.tau must be in (0, 0.5], got {self.tau}")
        for name in ("learning_rate", "max_gradient_norm", "updates_per_frame"):
            if not getattr(self, name) > 0.0:
                raise ValueError(f"algo.{name} must be positive, got {getattr(self, name)}")
        renormalised = self.critic.normalisation is Normalisation.batch_renorm
        if renormalised and self.targets is Targets.average:
            raise ValueError(
                "algo.critic.normalisation=batch_renorm needs algo.targets=same: a moving average "
                "of the critics has no statistics of its own inputs"
            )
        if not 0.0 <= self.demonstrated < 1.0:
            raise ValueError(f"algo.demonstrated must be in [0, 1), got {self.demonstrated}")
        if self.random_shift < 0:
            raise ValueError(f"algo.random_shift must be 0 or more, got {self.random_shift}")
        for name in ("steps", "batch_size", "sequence_steps"):
            if getattr(self, name) < 1:
                raise ValueError(f"algo.{name} must be at least 1, got {getattr(self, name)}")
        if self.burn_in < 0:
            raise ValueError(f"algo.burn_in must be 0 or more, got {self.burn_in}")
        if self.network.recurrent and self.batch_size % self.sequence_steps:
            raise ValueError(
                f"algo.sequence_steps={self.sequence_steps} must divide algo.batch_size, "
                f"got {self.batch_size}"
            )
        check_one_mode(self.network, "sac")
        if any(width < 1 for width in self.policy_hidden):
            raise ValueError(
                f"algo.policy_hidden: widths must be positive, got {list(self.policy_hidden)}"
            )

    def check_batch(self, worlds: int, steps: int) -> None:
        """See `AlgorithmCfg`: the replay buffer takes a batch and the ends of its episodes."""
        self.replay.check_batch(worlds * steps)

    def check_budget(self, frames: int) -> None:
        """See `AlgorithmCfg`: the frames of the warm-up precede the first update."""
        self.replay.check_budget(frames)
