"""The numbers of proximal policy optimisation."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from veca_marl.algos.algorithm import AlgorithmCfg
from veca_marl.algos.networks.factory import NetworkCfg
from veca_marl.algos.networks.multisense import MultisenseCfg
from veca_marl.algos.ppo.entropy import check_entropy_coefficient
from veca_marl.algos.ppo.value_normalisation import ValueNormalisation


@dataclass
class PPOCfg(AlgorithmCfg):
    """Numbers of PPO; the defaults are those of the paper's table where it gives them.

    Attributes:
        network: The network and its sizes.
        gamma: Discount.
        gae_lambda: Lambda of the generalised advantage estimate (Schulman et al. 2016).
        clip: Clipping range of the probability ratio, in (0, 1].
        entropy_coefficient: Weight of the entropy bonus: a number for all parts of the action, or
            one for each of them: ``algo.entropy_coefficient={move:0.003,voice:0.03}``.
        value_coefficient: Weight of the value loss.
        value_normalisation: What the critic predicts, and in which unit its loss is measured.
        max_gradient_norm: Gradients are scaled down to this norm, those of agents with networks of
            their own each by itself.
        epochs: Passes over each batch.
        minibatches: Parts of the batch in one pass.
        sequence_steps: Steps through which gradients of a network with hidden state flow: its
            minibatches consist of sequences of this length, as many frames as otherwise. Divides
            collect.steps; not used without hidden state.
        learning_rate: Initial value of the adaptive rate (ours).
        target_kl: The rate is divided by 1.5 above twice this divergence, multiplied by 1.5 below
            half of it: the rule of rl_games with its target of 0.008 (ours; the paper says
            "adaptive to the KL divergence"). The divergence of a minibatch is measured before its
            step: it is 0 in the first step after collection, and with one epoch of one minibatch
            the rate stays.
        min_learning_rate: Lower bound of the rate.
        max_learning_rate: Upper bound of the rate.
    """

    name: str = "ppo"
    network: NetworkCfg = field(default_factory=MultisenseCfg)
    gamma: float = 0.99
    gae_lambda: float = 0.95
    clip: float = 0.2
    entropy_coefficient: Any = 0.03  # float | dict[str, float], which OmegaConf cannot express
    value_coefficient: float = 0.5
    value_normalisation: ValueNormalisation = ValueNormalisation.none
    max_gradient_norm: float = 5.0
    epochs: int = 4
    minibatches: int = 4
    sequence_steps: int = 32
    learning_rate: float = 3e-4
    target_kl: float = 0.008
    min_learning_rate: float = 1e-6
    max_learning_rate: float = 1e-3

    def __post_init__(self) -> None:
        for name in ("gamma", "gae_lambda"):
            if not 0.0 <= getattr(self, name) <= 1.0:
                raise ValueError(f"algo.{name} must be in [0, 1], got {getattr(self, name)}")
        if not 0.0 < self.clip <= 1.0:
            raise ValueError(f"algo.clip must be in (0, 1], got {self.clip}")
        for name in ("max_gradient_norm", "target_kl", "min_learning_rate"):
            if not getattr(self, name) > 0.0:
                raise ValueError(f"algo.{name} must be positive, got {getattr(self, name)}")
        for name in ("epochs", "minibatches", "sequence_steps"):
            if getattr(self, name) < 1:
                raise ValueError(f"algo.{name} must be at least 1, got {getattr(self, name)}")
        check_entropy_coefficient(self.entropy_coefficient)
        if not self.min_learning_rate <= self.learning_rate <= self.max_learning_rate:
            raise ValueError(
                f"algo.learning_rate must be in [{self.min_learning_rate}, "
                f"{self.max_learning_rate}], got {self.learning_rate}"
            )

    def check_batch(self, worlds: int, steps: int) -> None:
        """See `AlgorithmCfg`: a minibatch has at least two frames, to normalise advantages."""
        length, unit = 1, "frames"
        if self.network.recurrent:
            check_sequences(self.sequence_steps, steps)
            length, unit = self.sequence_steps, f"sequences of {self.sequence_steps} steps"
        rows = worlds * steps // length
        if rows < self.minibatches:
            raise ValueError(
                f"a batch of {rows} {unit} cannot be split into algo.minibatches={self.minibatches}"
            )
        if rows // self.minibatches * length < 2:
            raise ValueError(
                f"algo.minibatches={self.minibatches} leaves one frame for a minibatch of a batch "
                f"of {worlds * steps}: one advantage has no standard deviation"
            )


def check_sequences(sequence_steps: int, steps: int) -> None:
    """Check that the steps of a batch are a multiple of those of a sequence.

    Raises:
        ValueError: If they are not.
    """
    if steps % sequence_steps:
        raise ValueError(
            f"algo.sequence_steps={sequence_steps} must divide collect.steps, got {steps}"
        )
