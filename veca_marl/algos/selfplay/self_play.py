"""Self-play: two teams learn in turns, against the current or a past policy of the other one.

Against the current opponent alone two learners can cycle through strategies; past policies as
opponents prevent that (Bansal et al. 2018, "Emergent complexity via multi-agent competition",
section 4; Vinyals et al. 2019 extend the idea to a league).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from veca_marl.algos.checkpoints.checkpoint_file import CheckpointError
from veca_marl.algos.policy import Policy
from veca_marl.algos.selfplay.pool import Pool
from veca_marl.algos.training.learners import TeamLearners

_DRAWS = 7  # the random stream of the matches differs from those of the stages


@dataclass
class SelfPlayCfg:
    """Which teams play against past policies.

    Attributes:
        teams: The two teams that learn in turns, a stage each; none for no self-play.
        latest: Share of the stages in which the opponent is the other team's current policy; in
            the others it is drawn uniformly from the pool of its past policies.
    """

    teams: list[str] = field(default_factory=list)
    latest: float = 0.5

    def __post_init__(self) -> None:
        if len(self.teams) not in (0, 2) or len(set(self.teams)) != len(self.teams):
            raise ValueError(f"self_play.teams={list(self.teams)}: two teams, or none")
        if not 0.0 <= self.latest <= 1.0:
            raise ValueError(f"self_play.latest={self.latest} must be in [0, 1]")


class SelfPlay:
    """Two teams learn in turns; the other one plays its current or a past policy.

    Args:
        cfg: Which teams.
        learners: The algorithms of both.
        pool: Where past policies are stored.
        seed: Seed of the draws.

    Attributes:
        turn: The team that learns in this stage.
        opponent: The other one.
        past_frames: Frames after which the opponent's policy was stored; None for the current one.

    Raises:
        ValueError: If a team does not learn.
    """

    def __init__(self, cfg: SelfPlayCfg, learners: TeamLearners, pool: Pool, seed: int) -> None:
        unknown = sorted(set(cfg.teams) - set(learners.algorithms))
        if unknown:
            raise ValueError(
                f"self_play.teams: {unknown} do not learn; there are {sorted(learners.algorithms)}"
            )
        self.cfg, self.pool = cfg, pool
        self._learners, self._seed = learners, seed
        self._others = [team for team in learners.algorithms if team not in cfg.teams]
        self.turn, self.opponent = cfg.teams
        self.past_frames: int | None = None

    def begin_stage(self, stage: int, frames: int) -> None:
        """See `Matchmaking`."""
        if frames == 0:
            for team in self.cfg.teams:
                self._store(team, 0)
        self.turn, self.opponent = self._order(stage)
        self._learners.learning = [self.turn, *self._others]
        rng = np.random.default_rng([self._seed, stage, _DRAWS])
        members = self.pool.members(self.opponent, frames)
        if not members:
            raise CheckpointError(f"{self.pool.folder} holds no past policy of {self.opponent!r}")
        latest = rng.random() < self.cfg.latest
        self.past_frames = None if latest else int(rng.choice(members))

    def _order(self, stage: int) -> Sequence[str]:
        """Return the team that learns in a stage, and its opponent."""
        return self.cfg.teams if stage % 2 == 0 else self.cfg.teams[::-1]

    def learns(self, team: str, stage: int) -> bool:
        """See `Matchmaking`."""
        return team in self._others or team == self._order(stage)[0]

    def load_opponent(self, policy: Policy) -> None:
        """See `Matchmaking`."""
        if self.past_frames is not None:
            actor = policy.actors[self.opponent]
            self.pool.load_into(actor, self.opponent, self.past_frames)
            policy.end_warm_up(self.opponent)

    def end_stage(self, frames: int) -> None:
        """See `Matchmaking`."""
        self._store(self.turn, frames)

    def measures(self) -> dict[str, float]:
        """See `Matchmaking`: index of the team that learns, frames of its opponent (NaN: now)."""
        past = math.nan if self.past_frames is None else float(self.past_frames)
        turn = float(self.cfg.teams.index(self.turn))
        return {"self_play/turn": turn, "self_play/opponent_frames": past}

    def _store(self, team: str, frames: int) -> None:
        actor = self._learners.algorithms[team].actor.state_dict()
        self.pool.store(team, frames, {name: array.cpu() for name, array in actor.items()})
