"""What random actions show: specifications, finite rewards, observations that change, cost."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from numbers import Real
from time import perf_counter

import numpy as np

from veca_marl.checks.findings import Finding, finding
from veca_marl.envs.core.actions import random_action
from veca_marl.envs.core.episodes import Episodes
from veca_marl.envs.core.game import Game, Observation, Outcome
from veca_marl.sim.spec import ArraySpec

_GREATEST = float(np.finfo(np.float32).max)  # TorchRL's rewards are float32
NAMES = ("observations", "rewards", "no constant observation", "cost per step")


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
    seen = _play(game, steps, seed)
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


def _play(game: Game, steps: int, seed: int) -> _Seen:
    episodes, rng, seen = Episodes(seed), np.random.default_rng(seed), _Seen()
    done, before = True, dict[str, Observation]()
    for _ in range(steps):
        if done:
            game.reset(episodes.next())
            before = _observe(game, seen)
        started = perf_counter()
        outcome = game.step({p.name: random_action(p.body.action_spec, rng) for p in game.actors})
        after = {player.name: game.observe(player) for player in game.actors}
        seen.seconds.append(perf_counter() - started)
        _compare(before, after, seen)
        _add_problems(seen.rewards, reward_problems(game, outcome))
        _add_problems(seen.rewards, _undecided(game))
        before, done = _observe(game, seen), outcome.done
    return seen


def _observe(game: Game, seen: _Seen) -> dict[str, Observation]:
    """Return the observations of all actors; note those that do not fit."""
    _add_problems(seen.specs, observation_problems(game))
    return {player.name: game.observe(player) for player in game.actors}


def observation_problems(game: Game) -> Iterator[str]:
    """Yield the observations of all actors that do not fit their specifications."""
    for player in game.actors:
        senses = game.senses[player.name].values()
        specs = {key: spec for sense in senses for key, spec in sense.specs.items()}
        observation = game.observe(player)
        yield from (f"{player.name}: {text}" for text in _misfits(observation, specs))


def _misfits(observation: Observation, specs: Mapping[str, ArraySpec]) -> Iterator[str]:
    if set(observation) != set(specs):
        yield f"observes {sorted(observation)}, specified are {sorted(specs)}"
        return
    for key, spec in specs.items():
        array = observation[key]
        if array.shape != spec.shape or array.dtype != np.dtype(spec.dtype):
            expected = f"{spec.shape} {np.dtype(spec.dtype)}"
            yield f"{key!r} is {array.shape} {array.dtype}, specified is {expected}"
        elif not np.isfinite(array).all():
            yield f"{key!r} is not finite"
        elif array.size and (array.min() < spec.low or array.max() > spec.high):
            yield f"{key!r} exceeds its range [{spec.low:g}, {spec.high:g}]"


def _compare(
    before: Mapping[str, Observation], after: Mapping[str, Observation], seen: _Seen
) -> None:
    for name, observation in after.items():
        for key, array in observation.items():
            changed = not np.array_equal(array, before[name][key])
            seen.changed[name, key] = seen.changed.get((name, key), 0) + changed


def reward_problems(game: Game, outcome: Outcome) -> Iterator[str]:
    """Yield what is wrong with the reward terms of a step."""
    for name, terms in outcome.terms.items():
        if set(terms) != set(game.weights):
            yield f"{name} has the terms {sorted(terms)}, weights {sorted(game.weights)}"
        unfit = [
            f"term {term!r} of {name} is {_described(value)}"
            for term, value in terms.items()
            if not _is_number(value) or not _fits(value)
        ]
        yield from unfit
        if not unfit and set(terms) == set(game.weights) and not _fits(game.reward_of(terms)):
            yield f"the reward of {name} is {game.reward_of(terms)}"


def _is_number(value: object) -> bool:
    """Return whether a value is a number, as which an array of one number is not counted."""
    return isinstance(value, (Real, np.bool_))


def _described(value: object) -> str:
    return str(value) if _is_number(value) else f"of type {type(value).__name__}, not a number"


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
    median = float(np.median(seconds))
    return (
        f"{1000.0 * median:.2f} ms with all senses (median), "
        f"{len(game.actors) / median:.0f} agent steps per second"
    )
