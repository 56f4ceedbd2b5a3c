"""The interface of evaluators, and the evaluator that plays in this process."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

from torch import nn
from torchrl.envs import EnvBase

from veca_marl.algos.evaluation.evaluate import Exploration, RandomTeams, Scores, evaluate
from veca_marl.algos.policy import Policy
from veca_marl.algos.specs import EnvFactory


@dataclass(frozen=True)
class Request:
    """Episodes to play.

    Attributes:
        player: Name of the policy.
        episodes: Number of episodes.
        seed: See `evaluate`.
        exploration: See `evaluate`.
        first: Number of the first episode.
    """

    player: str
    episodes: int
    seed: int
    exploration: Exploration
    first: int = 0


@dataclass(frozen=True)
class Players:
    """Makes the policies that a run evaluates.

    Attributes:
        policy: The policy of all teams.
        learning: Teams that learn: they act at random in the baseline, and the others as in every
            evaluation.
    """

    policy: Policy
    learning: tuple[str, ...]

    def __call__(self, env: EnvBase) -> dict[str, nn.Module]:
        """Return ``policy`` and ``random``."""
        others = [actor for t, actor in self.policy.actors.items() if t not in self.learning]
        return {
            "policy": self.policy.play,
            "random": RandomTeams(env, self.learning, others),
        }


def nothing() -> None:
    """Do nothing."""


class Evaluator(Protocol):
    """Plays episodes with policies that it knows by name."""

    def play(self, request: Request, meanwhile: Callable[[], None] = nothing) -> dict[str, Scores]:
        """Return each team's scores.

        Args:
            request: The episodes.
            meanwhile: Called once: while other processes play, or else before this one does.
        """
        ...

    def close(self) -> None:
        """Close the worlds."""
        ...


class LocalEvaluator:
    """Plays in worlds of this process.

    Args:
        make_env: Makes the worlds.
        players: Makes the policies for an environment.
        worlds: Number of worlds.
    """

    def __init__(self, make_env: EnvFactory, players: Players, worlds: int) -> None:
        self._env = make_env(worlds, 0)
        self._players = players(self._env)

    def count_steps(self, steps: Any) -> None:
        """Add 1 to ``steps.value`` before each action: another process sees that this one plays."""

        def count(*_: Any) -> None:
            steps.value += 1

        for player in self._players.values():
            player.register_forward_pre_hook(count)

    def play(self, request: Request, meanwhile: Callable[[], None] = nothing) -> dict[str, Scores]:
        """See `Evaluator`."""
        meanwhile()
        return evaluate(
            self._env,
            self._players[request.player],
            request.episodes,
            request.seed,
            request.exploration,
            request.first,
        )

    def close(self) -> None:
        """See `Evaluator`."""
        self._env.close()
