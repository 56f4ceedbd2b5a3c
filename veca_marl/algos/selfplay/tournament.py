"""Everyone against everyone: past selves of two teams, and how strong each of them was."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from tensordict.nn import TensorDictSequential
from torchrl.envs import EnvBase

from veca_marl.algos.ppo.ppo import PPO
from veca_marl.algos.selfplay.elo import elo_ratings
from veca_marl.algos.selfplay.self_play import Pool
from veca_marl.algos.training.evaluation import Exploration, Scores, evaluate


@dataclass(frozen=True)
class Match:
    """Some episodes between two past selves.

    Attributes:
        members: After how many frames each of them was kept, by team.
        wins: Episodes won, by team; the others are drawn.
        episodes: How many were played.
        ahead: Mean of the first team's return less the second's.
    """

    members: dict[str, int]
    wins: dict[str, int]
    episodes: int
    ahead: float

    @property
    def points(self) -> float:
        """Share of the first team: a win counts 1, a draw one half."""
        first, second = self.wins.values()
        return (first + 0.5 * (self.episodes - first - second)) / self.episodes


@dataclass(frozen=True)
class Rating:
    """How strong a past self is, in Elo points about a mean of 1000."""

    team: str
    frames: int
    elo: float


def play_all(
    env: EnvBase,
    algorithm: PPO,
    pool: Pool,
    members: dict[str, list[int]],
    episodes: int,
    draw_margin: float,
    seed: int,
) -> list[Match]:
    """Let every past self of one team meet every one of the other, from the same starts.

    Args:
        env: Where they play.
        algorithm: Made for it; its actors say how the past selves are built.
        pool: Where they are kept.
        members: Who plays: frames by team, of two teams.
        episodes: Of each match, rounded up to a multiple of the worlds.
        draw_margin: Returns nearer to each other than this are a draw: who kicked no goal may
            still have earned helper rewards.
        seed: Of the starts.
    """
    player = algorithm.copy_policy()
    first, second = members
    matches = []
    for one in members[first]:
        _dress(player, algorithm, pool, first, one)
        for other in members[second]:
            _dress(player, algorithm, pool, second, other)
            scores = evaluate(env, player, episodes, seed, Exploration.stochastic)
            pair = {first: one, second: other}
            matches.append(_judge(pair, scores, draw_margin))
    return matches


def _dress(
    player: TensorDictSequential, algorithm: PPO, pool: Pool, team: str, frames: int
) -> None:
    player[list(algorithm.actors).index(team)].load_state_dict(pool.load(team, frames))


def _judge(members: dict[str, int], scores: dict[str, Scores], draw_margin: float) -> Match:
    first, second = members
    ahead = scores[first].returns - scores[second].returns
    wins = {
        first: int((ahead > draw_margin).sum()),
        second: int((ahead < -draw_margin).sum()),
    }
    return Match(members, wins, len(ahead), float(ahead.mean()))


def rate(matches: list[Match]) -> list[Rating]:
    """Return the Elo ratings of all who played."""
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
    """Return the first team's points, a row for each of its members, a column for the other's."""
    rows, columns = (
        sorted({list(match.members.values())[side] for match in matches}) for side in (0, 1)
    )
    table = np.full((len(rows), len(columns)), np.nan)
    for match in matches:
        one, other = match.members.values()
        table[rows.index(one), columns.index(other)] = match.points
    return table
