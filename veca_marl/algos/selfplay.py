"""Self-play: two teams learn in turns against past policies; pools, tournaments, Elo ratings.

Against the current opponent alone two learners can cycle through strategies; past policies as
opponents prevent that (Bansal et al. 2018, "Emergent complexity via multi-agent competition",
section 4; Vinyals et al. 2019 extend the idea to a league).
"""

from __future__ import annotations

import io
import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from scipy.optimize import minimize
from scipy.special import log_expit
from torch import nn
from torchrl.envs import EnvBase

from veca_marl.algos.checkpoints import CheckpointError, load_errors, load_file
from veca_marl.algos.evaluation.evaluate import Exploration, Scores, evaluate
from veca_marl.algos.files import WriteError, write_atomically
from veca_marl.algos.policy import Policy
from veca_marl.algos.training.finite import check_stored
from veca_marl.algos.training.learners import TeamLearners

_DIGITS = 12  # of the frames in the name of a file


class Pool:
    """Past policies in a folder: the actor of a team after so many frames.

    Args:
        folder: The folder, created with the first policy.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def store(self, team: str, frames: int, actor: dict[str, Any]) -> None:
        """Write the state of an actor.

        Raises:
            CheckpointError: If it cannot be written.
        """
        content = io.BytesIO()
        torch.save(actor, content)
        try:
            write_atomically(self._path(team, frames), content.getbuffer())
        except WriteError as error:
            raise CheckpointError(str(error)) from error

    def members(self, team: str, until: int | None = None) -> list[int]:
        """Return the frames after which policies of a team were stored, in ascending order.

        Args:
            team: Name of the team.
            until: Leave out later ones: an interrupted run may have been further.
        """
        files = self.folder.glob(f"{team}_{'[0-9]' * _DIGITS}.pt")
        found = (int(path.stem.rpartition("_")[2]) for path in files)
        return sorted(frames for frames in found if until is None or frames <= until)

    def load_into(self, actor: nn.Module, team: str, frames: int) -> None:
        """Load the state of a past policy into an actor.

        Raises:
            CheckpointError: If the file cannot be read, or holds another network.
        """
        path = self._path(team, frames)
        state = load_file(path, torch.device("cpu"))
        with load_errors(path):
            check_stored(state)
            actor.load_state_dict(state)

    def _path(self, team: str, frames: int) -> Path:
        return self.folder / f"{team}_{frames:0{_DIGITS}d}.pt"


_DRAWS = 7  # the random stream of the matches differs from those of the stages


@dataclass
class SelfPlayCfg:
    """Which teams play against past policies.

    Attributes:
        teams: The two teams that learn in turns, a stage each; none for no self-play.
        latest: Fraction of the stages in which the opponent is the other team's current policy; in
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


POINTS_PER_NEPER = 400.0 / math.log(10.0)


def elo_ratings(
    wins: NDArray[np.float64], mean: float = 1000.0, prior_games: float = 1.0
) -> NDArray[np.float64]:
    """Return the ratings under which the results are most likely.

    In Elo's model a player rated d points higher has the expected score 1 / (1 + 10^(-d / 400)).
    The likelihood of all games is maximised at once (Bradley & Terry 1952), so that the ratings do
    not depend on the order of the games, as ratings that are updated after each game do.

    Args:
        wins: ``(n, n)`` number of games that i won against j; a draw is half a game for each.
        mean: Mean of the ratings.
        prior_games: Drawn games of each player against one of rating `mean`; more than 0, so that
            the rating of a player that won all games is finite.

    Returns:
        ``(n,)`` Elo points.

    Raises:
        ValueError: If `wins` is not a square table of numbers that are 0 or more.
    """
    if wins.ndim != 2 or wins.shape[0] != wins.shape[1] or not (wins >= 0.0).all():
        raise ValueError(f"wins must be a square table of numbers, 0 or more; got {wins.tolist()}")
    if not prior_games > 0.0:
        raise ValueError(f"prior_games={prior_games} must be positive")

    def negative_log_likelihood(strengths: NDArray[np.float64]) -> float:
        ahead = strengths[:, None] - strengths[None, :]
        drawn = log_expit(strengths) + log_expit(-strengths)
        return -float((wins * log_expit(ahead)).sum() + 0.5 * prior_games * drawn.sum())

    fitted = minimize(negative_log_likelihood, np.zeros(len(wins)), method="BFGS")
    strengths: NDArray[np.float64] = fitted.x - fitted.x.mean()
    return mean + POINTS_PER_NEPER * strengths


@dataclass(frozen=True)
class Match:
    """Episodes between two past policies.

    Attributes:
        members: Frames after which each of them was stored, by team.
        wins: Episodes won, by team; the others are draws.
        episodes: Number of episodes.
        ahead: Mean of the first team's return minus the second's.
    """

    members: dict[str, int]
    wins: dict[str, int]
    episodes: int
    ahead: float

    @property
    def points(self) -> float:
        """Mean points of the first team: 1 for a win, one half for a draw."""
        first, second = self.wins.values()
        return (first + 0.5 * (self.episodes - first - second)) / self.episodes


@dataclass(frozen=True)
class Rating:
    """Strength of a past policy in Elo points; the mean of all is 1000."""

    team: str
    frames: int
    elo: float


def play_all(
    env: EnvBase,
    policy: Policy,
    pool: Pool,
    members: dict[str, list[int]],
    episodes: int,
    draw_margin: float,
    seed: int,
) -> list[Match]:
    """Let every past policy of one team play against every one of the other, from equal starts.

    Args:
        env: The environment.
        policy: A policy for all its teams, into which the past ones are loaded.
        pool: Where those are stored.
        members: Frames of the past policies by team, of two teams.
        episodes: Number of episodes of each match.
        draw_margin: In tasks without a goal, a smaller difference of the returns is a draw.
        seed: Seed of the starts.
    """
    first, second = members
    matches = []
    for one in members[first]:
        pool.load_into(policy.actors[first], first, one)
        for other in members[second]:
            pool.load_into(policy.actors[second], second, other)
            scores = evaluate(env, policy.play, episodes, seed, Exploration.stochastic)
            matches.append(make_match({first: one, second: other}, scores, draw_margin))
    return matches


def make_match(members: dict[str, int], scores: dict[str, Scores], draw_margin: float) -> Match:
    """Count the games that each team won.

    In a task with a goal that is the team of which the greater share of agents has reached it at
    the end: returns of teams that have not differ in shaping rewards.

    Args:
        members: See `Match`.
        scores: Scores of both teams.
        draw_margin: See `play_all`.
    """
    first, second = members
    ahead = scores[first].returns - scores[second].returns
    better, margin = ahead, draw_margin
    solved, other_solved = scores[first].solved, scores[second].solved
    if solved is not None and other_solved is not None:
        better, margin = solved - other_solved, 0.0
    wins = {first: int((better > margin).sum()), second: int((better < -margin).sum())}
    return Match(members, wins, len(ahead), float(ahead.mean()))


def rate(matches: list[Match]) -> list[Rating]:
    """Return the Elo ratings of all past policies in `matches`."""
    players = sorted({item for match in matches for item in match.members.items()})
    wins = np.zeros((len(players), len(players)))
    for match in matches:
        i, j = (players.index(item) for item in match.members.items())
        wins[i, j] += match.points * match.episodes
        wins[j, i] += (1.0 - match.points) * match.episodes
    return [
        Rating(team, frames, float(elo))
        for (team, frames), elo in zip(players, elo_ratings(wins), strict=True)
    ]


def table_of_points(matches: list[Match]) -> NDArray[np.float64]:
    """Return the first team's points: a row for each of its policies, a column for each other."""
    rows, columns = (
        sorted({list(match.members.values())[side] for match in matches}) for side in (0, 1)
    )
    table = np.full((len(rows), len(columns)), np.nan)
    for match in matches:
        one, other = match.members.values()
        table[rows.index(one), columns.index(other)] = match.points
    return table
