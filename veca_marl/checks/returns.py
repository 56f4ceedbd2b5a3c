"""Whole episodes of the expert and of the random policy: reward terms, returns, solved."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from veca_marl.algos.evaluation.comparison import paired_difference
from veca_marl.checks.episodes import reward_problems
from veca_marl.checks.findings import Finding, Status, finding
from veca_marl.envs.core.episodes import Episodes, first_team, play_to_end
from veca_marl.envs.core.expert import find_expert, has_expert, missing_needs
from veca_marl.envs.core.game import Game
from veca_marl.envs.core.game_cfg import Script

NAMES = ("reward terms", "expert", "goal")


@dataclass(frozen=True)
class _Played:
    """One episode.

    Attributes:
        score: Undiscounted return, mean over the first team.
        solved: Share of the first team for which the goal was reached at the end.
        nonzero: Names of the terms that were not 0 in some step, for some player.
        problems: Terms that were not finite.
    """

    score: float
    solved: float
    nonzero: frozenset[str]
    problems: tuple[str, ...]


def check_returns(game: Game, episodes: int, seed: int) -> Iterator[Finding]:
    """Play whole episodes from equal starts by the expert and by the random policy.

    The first team is played by either; players of other teams act at random.

    Args:
        game: The game.
        episodes: Number of episodes of each policy.
        seed: Seed of the episodes.

    Yields:
        ``reward terms``: each is finite and was not 0 in some step; skipped if only punishments,
        terms of negative weight, were 0 in all: good play avoids them. ``expert``: the 95 %
        interval of the paired difference of the returns is above 0. ``goal``: the expert ends more
        episodes solved than the random policy. The last two are skipped without an expert that can
        play, and the last one without a goal.
    """
    random = _play_all(game, Script.random, episodes, seed)
    reason = _no_expert(game)
    expert = [] if reason else _play_all(game, Script.expert, episodes, seed)
    yield _terms(game, [*random, *expert])
    if reason:
        yield from (Finding(name, Status.skipped, reason) for name in NAMES[1:])
        return
    yield _expert(expert, random)
    yield _goal(game, expert, random)


def _no_expert(game: Game) -> str:
    """Return why no expert can play the first team; an empty text if one can."""
    if not has_expert(game.cfg.task.name):
        return "the task has no expert"
    expert = find_expert(game.cfg.task.name)
    clock = game.world.clock
    missing = sorted({n for p in first_team(game) for n in missing_needs(expert, p, clock)})
    return f"the expert needs {', '.join(missing)}" if missing else ""


def _play_all(game: Game, script: Script, episodes: int, seed: int) -> list[_Played]:
    stream = Episodes(seed)
    return [_play(game, script, stream.next()) for _ in range(episodes)]


def _play(game: Game, script: Script, rng: np.random.Generator) -> _Played:
    team, score, nonzero, problems = first_team(game), 0.0, set[str](), list[str]()
    game.reset(rng)
    for outcome in play_to_end(game, script):
        score += float(np.mean([game.reward_of(outcome.terms[p.name]) for p in team]))
        nonzero |= {n for terms in outcome.terms.values() for n, value in terms.items() if value}
        problems += reward_problems(game, outcome)
    solved = float(np.mean([outcome.solved.get(p.name, False) for p in team]))
    return _Played(score, solved, frozenset(nonzero), tuple(dict.fromkeys(problems)))


def _terms(game: Game, played: Sequence[_Played]) -> Finding:
    problems = list(dict.fromkeys(text for one in played for text in one.problems))
    reached = frozenset[str]().union(*(one.nonzero for one in played))
    unreached = {name: weight for name, weight in game.weights.items() if name not in reached}
    problems += [
        f"term {name!r} is 0 in all steps of {len(played)} episodes"
        for name, weight in unreached.items()
        if weight >= 0.0
    ]
    if unreached and not problems:
        return Finding("reward terms", Status.skipped, _unpunished(game, unreached, len(played)))
    return finding("reward terms", problems, f"{', '.join(game.weights)}: each is reached")


def _unpunished(game: Game, punishments: Collection[str], episodes: int) -> str:
    """Return why terms of negative weight that nothing earned could not be checked."""
    reached = ", ".join(name for name in game.weights if name not in punishments) or "none"
    return (
        f"no policy earned the punishment {', '.join(map(repr, punishments))} in {episodes} "
        f"episodes: play more, or test it yourself; reached: {reached}"
    )


def _expert(expert: Sequence[_Played], random: Sequence[_Played]) -> Finding:
    ours, theirs = (np.array([one.score for one in played]) for played in (expert, random))
    mean, low, high = paired_difference(ours, theirs)
    text = (
        f"return {ours.mean():.3f}, random policy {theirs.mean():.3f}, difference {mean:.3f} "
        f"[{low:.3f}, {high:.3f}] in {len(expert)} paired episodes"
    )
    return finding("expert", [] if low > 0.0 else [text], text)


def _goal(game: Game, expert: Sequence[_Played], random: Sequence[_Played]) -> Finding:
    if not game.task.has_goal():
        return Finding("goal", Status.skipped, "the task does not define solved()")
    ours, theirs = (float(np.mean([one.solved for one in each])) for each in (expert, random))
    text = f"solved at the end by the expert {ours:.0%}, by the random policy {theirs:.0%}"
    return finding("goal", [] if ours > theirs else [text], text)
