"""Tournament: every past policy of one team against every one of the other, and their ratings."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from torchrl.envs import EnvBase

from veca_marl.algos.evaluation.evaluate import Exploration, Scores, evaluate
from veca_marl.algos.policy import Policy
from veca_marl.algos.selfplay.elo import elo_ratings
from veca_marl.algos.selfplay.pool import Pool


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
