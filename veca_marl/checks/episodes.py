"""What random actions and whole episodes of the expert show."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from time import perf_counter
from typing import Any

import numpy as np

from veca_marl.algos.evaluation.comparison import paired_difference
from veca_marl.checks.findings import Finding, Status, finding
from veca_marl.envs.core.episodes import Episodes, first_team, play_to_end
from veca_marl.envs.core.expert import find_expert, has_expert, missing_needs
from veca_marl.envs.core.game import Game, Observation, Outcome, random_action
from veca_marl.envs.core.game_cfg import Script
from veca_marl.sim.sense import ArraySpec, SpecError

_GREATEST = float(np.finfo(np.float32).max)  # TorchRL's rewards are float32
RANDOM_PLAY_NAMES = ("observations", "rewards", "no constant observation", "cost per step")


@dataclass
class _Seen:
    """What was seen in a rollout.

    Attributes:
        specs: Observations that do not fit their specifications.
        rewards: Reward terms with wrong names or values that are not finite.
        changed: Number of steps in which an observation changed, by player and key.
        seconds: Duration of each step, s.
    """

    specs: list[str] = field(default_factory=list)
    rewards: list[str] = field(default_factory=list)
    changed: dict[tuple[str, str], int] = field(default_factory=dict)
    seconds: list[float] = field(default_factory=list)


def check_random_play(game: Game, steps: int, seed: int) -> Iterator[Finding]:
    """Play random actions and read all senses after each step.

    Args:
        game: The game.
        steps: Number of steps; several episodes if they are short.
        seed: Seed of episodes and actions.

    Yields:
        ``observations``: finite, of the shape, type and range of their specifications. ``rewards``:
        numbers, finite as float32, named as the weights; ``solved`` is True or False where it is
        defined.
        ``no constant observation``: each changes at least once.
        ``cost per step``: the median.
    """
    seen = _play_randomly(game, steps, seed)
    n = len(seen.changed)
    yield finding("observations", seen.specs, f"{n} arrays fit their specifications")
    yield finding("rewards", seen.rewards, f"finite in {steps} steps of random actions")
    constant = [f"{key!r} of {name} is" for (name, key), count in seen.changed.items() if not count]
    yield finding(
        "no constant observation",
        [f"{problem} equal in all {steps} steps" for problem in constant],
        f"all {n} change",
    )
    yield finding("cost per step", [], _cost(game, seen.seconds))


def _play_randomly(game: Game, steps: int, seed: int) -> _Seen:
    episodes, rng, seen = Episodes(seed), np.random.default_rng(seed), _Seen()
    done, before = True, dict[str, Observation]()
    for _ in range(steps):
        if done:
            game.reset(episodes.next())
            before = _observe(game, seen)
        started = perf_counter()
        try:
            outcome = game.step(_random_actions(game, rng))
        except SpecError as error:
            seen.rewards.append(str(error))
            break
        after = _observe(game, seen)
        seen.seconds.append(perf_counter() - started)
        _compare(before, after, seen)
        _add_problems(seen.rewards, reward_problems(game, outcome))
        _add_problems(seen.rewards, _undecided(game))
        before, done = after, outcome.done
    return seen


def _random_actions(game: Game, rng: np.random.Generator) -> dict[str, Any]:
    return {p.name: random_action(p.body.action_spec, rng) for p in game.actors}


def _observe(game: Game, seen: _Seen) -> dict[str, Observation]:
    """Return what the senses of all actors observe, but for those that fail; note misfits."""
    _add_problems(seen.specs, observation_problems(game))
    observed: dict[str, Observation] = {}
    for player in game.actors:
        observed[player.name] = {}
        for sense in game.senses[player.name].values():
            with suppress(SpecError):  # noted
                observed[player.name] |= sense.read()
    return observed


def observation_problems(game: Game) -> Iterator[str]:
    """Yield the observations of all actors that do not fit their specifications."""
    for player in game.actors:
        for sense in game.senses[player.name].values():
            try:
                observation = sense.read()
            except SpecError as error:
                yield f"{player.name}: {error}"
            else:
                problems = _misfits(observation, sense.specs)
                yield from (f"{player.name}: {text}" for text in problems)


def _misfits(observation: Observation, specs: Mapping[str, ArraySpec]) -> Iterator[str]:
    for key, spec in specs.items():
        array = observation[key]
        if not np.isfinite(array).all():
            yield f"{key!r} is not finite"
        elif array.size and (array.min() < spec.low or array.max() > spec.high):
            yield f"{key!r} exceeds its range [{spec.low:g}, {spec.high:g}]"


def _compare(
    before: Mapping[str, Observation], after: Mapping[str, Observation], seen: _Seen
) -> None:
    for name, observation in after.items():
        for key, array in observation.items():
            known = before[name]
            changed = key not in known or not np.array_equal(array, known[key])
            seen.changed[name, key] = seen.changed.get((name, key), 0) + changed


def reward_problems(game: Game, outcome: Outcome) -> Iterator[str]:
    """Yield the reward terms of a step that are not finite as float32."""
    for name, terms in outcome.terms.items():
        unfit = [
            f"term {term!r} of {name} is {value}"
            for term, value in terms.items()
            if not _fits(value)
        ]
        yield from unfit
        if not unfit and not _fits(game.reward_of(terms)):
            yield f"the reward of {name} is {game.reward_of(terms)}"


def _fits(value: float) -> bool:
    """Return whether a number is finite, also as float32."""
    return abs(value) <= _GREATEST


def _undecided(game: Game) -> Iterator[str]:
    """Yield the players for whom a task with a goal does not return whether it is reached."""
    if not game.task.has_goal():
        return
    for player in game.players:
        solved = game.task.solved(player)
        if not isinstance(solved, (bool, np.bool_)):
            yield f"solved() of {player.name} is {solved!r}, not True or False"


def _add_problems(found: list[str], problems: Iterator[str] | list[str]) -> None:
    """Add those that are new: the same problem is there in every step."""
    found.extend(problem for problem in problems if problem not in found)


def _cost(game: Game, seconds: list[float]) -> str:
    if not seconds:
        return "not measured: no step could be played"
    median = float(np.median(seconds))
    return (
        f"{1000.0 * median:.2f} ms with all senses (median), "
        f"{len(game.actors) / median:.0f} agent steps per second"
    )


RETURN_NAMES = ("reward terms", "expert", "goal")


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
        terms of negative weight, were 0 in all: good play avoids them; and if terms were 0 in all
        where no expert plays. ``expert``: the 95 %
        interval of the paired difference of the returns is above 0. ``goal``: the expert ends more
        episodes solved than the random policy. The last two are skipped without an expert that can
        play, and the last one without a goal.
    """
    random = _play_all(game, Script.random, episodes, seed)
    reason = _no_expert(game)
    expert = [] if reason else _play_all(game, Script.expert, episodes, seed)
    yield _terms(game, [*random, *expert], reason)
    if reason:
        yield from (Finding(name, Status.skipped, reason) for name in RETURN_NAMES[1:])
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
    return [_play_episode(game, script, stream.next()) for _ in range(episodes)]


def _play_episode(game: Game, script: Script, rng: np.random.Generator) -> _Played:
    team, score, nonzero, problems = first_team(game), 0.0, set[str](), list[str]()
    game.reset(rng)
    outcome: Outcome | None = None
    try:
        for outcome in play_to_end(game, script):
            score += float(np.mean([game.reward_of(outcome.terms[p.name]) for p in team]))
            nonzero |= {n for t in outcome.terms.values() for n, value in t.items() if value}
            problems += reward_problems(game, outcome)
    except SpecError as error:
        problems.append(str(error))
    ended = {} if outcome is None else outcome.solved
    solved = float(np.mean([ended.get(p.name, False) for p in team]))
    return _Played(score, solved, frozenset(nonzero), tuple(dict.fromkeys(problems)))


def _terms(game: Game, played: Sequence[_Played], no_expert: str) -> Finding:
    problems = list(dict.fromkeys(text for one in played for text in one.problems))
    reached = frozenset[str]().union(*(one.nonzero for one in played))
    unreached = {name: weight for name, weight in game.weights.items() if name not in reached}
    unearned = [name for name, weight in unreached.items() if weight >= 0.0]
    if unearned and no_expert and not problems:
        return Finding("reward terms", Status.skipped, _unearned(unearned, no_expert, len(played)))
    problems += [f"term {name!r} is 0 in all steps of {len(played)} episodes" for name in unearned]
    if unreached and not problems:
        return Finding("reward terms", Status.skipped, _unpunished(game, unreached, len(played)))
    return finding("reward terms", problems, f"{', '.join(game.weights)}: each is reached")


def _unearned(terms: Collection[str], no_expert: str, episodes: int) -> str:
    """Return why terms that the random policy did not earn could not be checked."""
    return (
        f"the random policy did not earn {', '.join(map(repr, terms))} in {episodes} episodes, and "
        f"{no_expert}: register one, play more, or test the terms yourself"
    )


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
