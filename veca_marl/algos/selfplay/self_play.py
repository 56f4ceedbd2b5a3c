"""Self-play: teams learn in turns, against what the other team is now or was some time ago.

Against the present opponent alone two learners can chase each other in circles; past selves keep
old answers in demand (Bansal et al. 2018, "Emergent complexity via multi-agent competition",
section 4; AlphaStar's league is the grown-up form).
"""

from __future__ import annotations

import io
import math
import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import torch
from tensordict.nn import TensorDictSequential

from veca_marl.algos.ppo.ppo import PPO
from veca_marl.algos.training.checkpoint import CheckpointError

_DRAWS = 7  # keeps the random stream of the matches apart from those of the stages


@dataclass
class SelfPlayCfg:
    """Who plays against past selves.

    Attributes:
        teams: The two teams that learn in turns, a stage each; none for no self-play.
        latest: Share of the stages in which the opponent is the other team as it is now; in the
            others it is drawn uniformly from the pool of what it was.
    """

    teams: list[str] = field(default_factory=list)
    latest: float = 0.5

    def __post_init__(self) -> None:
        if len(set(self.teams)) not in (0, 2):
            raise ValueError(f"self_play.teams={list(self.teams)}: two teams, or none")
        if not 0.0 <= self.latest <= 1.0:
            raise ValueError(f"self_play.latest={self.latest} must be in [0, 1]")


class Matchmaking(Protocol):
    """Says, stage by stage, who learns and whom it meets."""

    def begin_stage(self, stage: int, frames: int) -> None:
        """Choose who learns and against whom; it depends on the arguments and the seed alone."""
        ...

    def dress(self, player: TensorDictSequential) -> None:
        """Give the copy of the policy that plays the parameters of the opponent."""
        ...

    def end_stage(self, frames: int) -> None:
        """Keep what was learnt as an opponent to come."""
        ...

    def note(self) -> dict[str, float]:
        """Return what the logs shall say of this stage's match."""
        ...


class AllLearn:
    """Every team learns in every stage, against the others as they are."""

    def begin_stage(self, stage: int, frames: int) -> None:
        """See `Matchmaking`."""

    def dress(self, player: TensorDictSequential) -> None:
        """See `Matchmaking`."""

    def end_stage(self, frames: int) -> None:
        """See `Matchmaking`."""

    def note(self) -> dict[str, float]:
        """See `Matchmaking`."""
        return {}


class Pool:
    """Past selves in a folder: the actor of a team after so many frames.

    Args:
        folder: Where they lie; made when the first is kept.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def keep(self, team: str, frames: int, actor: dict[str, Any]) -> None:
        """Write the state of an actor.

        Raises:
            CheckpointError: If it cannot be written.
        """
        path = self._path(team, frames)
        content = io.BytesIO()
        torch.save(actor, content)
        temporary = path.with_suffix(".tmp")
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            temporary.write_bytes(content.getbuffer())
            os.replace(temporary, path)
        except OSError as error:
            temporary.unlink(missing_ok=True)
            raise CheckpointError(f"cannot write {path}: {error}") from error

    def members(self, team: str, until: int | None = None) -> list[int]:
        """Return after how many frames past selves of a team were kept, the oldest first.

        Args:
            team: Whose.
            until: Leave out those of more frames: an interrupted run may have been further.
        """
        found = (int(path.stem.rpartition("_")[2]) for path in self.folder.glob(f"{team}_*.pt"))
        return sorted(frames for frames in found if until is None or frames <= until)

    def load(self, team: str, frames: int) -> dict[str, Any]:
        """Return the state of an actor."""
        state: dict[str, Any] = torch.load(self._path(team, frames), weights_only=True)
        return state

    def _path(self, team: str, frames: int) -> Path:
        return self.folder / f"{team}_{frames:012d}.pt"


class SelfPlay:
    """Two teams learn in turns; the one whose turn it is not plays as it is or as it was.

    Args:
        cfg: Which teams.
        algorithm: Learns both.
        pool: Where past selves are kept.
        seed: Of the draws.

    Raises:
        ValueError: If a team is not one that learns.
    """

    def __init__(self, cfg: SelfPlayCfg, algorithm: PPO, pool: Pool, seed: int) -> None:
        unknown = sorted(set(cfg.teams) - set(algorithm.learners))
        if unknown:
            raise ValueError(
                f"self_play.teams: {unknown} do not learn; there are {sorted(algorithm.learners)}"
            )
        self.cfg, self.pool = cfg, pool
        self._algorithm, self._seed = algorithm, seed
        self._bystanders = [team for team in algorithm.learners if team not in cfg.teams]
        self.turn, self.opponent = cfg.teams
        self.met: int | None = None

    def begin_stage(self, stage: int, frames: int) -> None:
        """See `Matchmaking`. `turn` learns, `opponent` is as after `met` frames, None is now."""
        if frames == 0:
            for team in self.cfg.teams:
                self._keep(team, 0)
        self.turn, self.opponent = self.cfg.teams if stage % 2 == 0 else self.cfg.teams[::-1]
        self._algorithm.learning = [self.turn, *self._bystanders]
        rng = np.random.default_rng([self._seed, stage, _DRAWS])
        members = self.pool.members(self.opponent, frames)
        self.met = None if rng.random() < self.cfg.latest else int(rng.choice(members))

    def dress(self, player: TensorDictSequential) -> None:
        """See `Matchmaking`."""
        if self.met is not None:
            part = list(self._algorithm.actors).index(self.opponent)
            player[part].load_state_dict(self.pool.load(self.opponent, self.met))

    def end_stage(self, frames: int) -> None:
        """See `Matchmaking`."""
        self._keep(self.turn, frames)

    def note(self) -> dict[str, float]:
        """See `Matchmaking`: which team learns, and how old its opponent is (blank: as now)."""
        met = math.nan if self.met is None else float(self.met)
        return {"self_play/turn": float(self.cfg.teams.index(self.turn)), "self_play/met": met}

    def _keep(self, team: str, frames: int) -> None:
        actor = self._algorithm.actors[team].state_dict()
        self.pool.keep(team, frames, {name: array.cpu() for name, array in actor.items()})
