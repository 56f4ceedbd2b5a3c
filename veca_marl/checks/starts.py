"""Whether every start of an episode is possible and follows from its seed."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Sequence
from itertools import combinations

import numpy as np

from veca_marl.checks.findings import Finding, finding
from veca_marl.envs.core.benchmark import start_state
from veca_marl.envs.core.episodes import Episodes
from veca_marl.envs.core.game import Game, Outcome, random_action
from veca_marl.envs.core.game_cfg import Script
from veca_marl.sim.body.walker import Walker
from veca_marl.sim.geometry import Floats
from veca_marl.sim.physics import World

GREATEST_OVERLAP_M = 0.005
"""Depth up to which contacts are no overlap; skin yields by less, and so do resting props."""


def overlaps(game: Game, depth_m: float = GREATEST_OVERLAP_M) -> list[str]:
    """Return what penetrates each other by more than a depth, one entry for each pair.

    Bones of one body count, unless its joints keep them apart. Bullet's contacts are updated.

    Args:
        game: A game that has just been reset.
        depth_m: Greatest depth in metres that is no overlap.
    """
    names = _names(game)
    deepest: dict[tuple[str, str], float] = {}
    for one, other, distance_m in _contacts(game):
        pair = names[one], names[other]
        deepest[pair] = min(deepest.get(pair, 0.0), distance_m)
    return [
        f"{_described(*pair)} overlap by {-1000.0 * distance_m:.0f} mm"
        for pair, distance_m in deepest.items()
        if distance_m < -depth_m
    ]


def _names(game: Game) -> dict[int, str]:
    names = {player.body.body_id: player.name for player in game.players}
    names |= {prop.body_id: prop.name for prop in game.world.props.values()}
    return names | {game.world.floor_id: "floor"}


def _contacts(game: Game) -> Iterator[tuple[int, int, float]]:
    """Yield ids and distance of all contacts.

    Bullet looks for none between walkers and fixed props: neither has a mass.
    """
    client = game.world.client
    client.performCollisionDetection()
    points = list(client.getContactPoints())
    for one, other in _massless_pairs(game):
        points += client.getClosestPoints(one, other, 0.0)
    for point in points:
        yield point.body_a, point.body_b, point.distance_m


def _massless_pairs(game: Game) -> Iterator[tuple[int, int]]:
    walkers = [p.body.body_id for p in game.players if isinstance(p.body, Walker)]
    yield from combinations(walkers, 2)
    for walker in walkers:
        yield from ((walker, body_id) for body_id in _fixed(game.world))


def _fixed(world: World) -> list[int]:
    return [prop.body_id for prop in world.props.values() if prop.fixed and prop.cfg.tangible]


def _described(one: str, other: str) -> str:
    return f"bones of {one}" if one == other else f"{one} and {other}"


START_NAMES = ("starts", "first step")


def check_starts(game: Game, starts: int, seed: int) -> Iterator[Finding]:
    """Check the starts of some episodes, and one step in each in which all players rest.

    Args:
        game: The game.
        starts: Number of episodes.
        seed: Seed of the episodes.

    Yields:
        ``starts``: bodies are inside the rooms, poses are finite, nothing penetrates another thing
        by more than `GREATEST_OVERLAP_M`, starts differ. ``first step``: no
        episode ends by resting for one step, and not some of them are solved.
    """
    episodes, states, positions = Episodes(seed), [], []
    outside, outcomes = [], []
    for number in range(starts):
        game.reset(episodes.next())
        states.append(start_state(game).tobytes())
        positions.append(np.array([player.body.position for player in game.players]))
        outside += _problems(game, number)
        outcomes.append(_rest(game))
    different = len(set(states))
    if different == 1 and starts > 1:
        outside.append(f"all {starts} starts are equal: reset(rng) draws nothing that has effect")
    yield finding("starts", outside, f"{different} of {starts} differ; {_spread(game, positions)}")
    yield finding(
        "first step", _ends(outcomes), f"{starts} episodes continue while all players rest"
    )


def _problems(game: Game, number: int) -> list[str]:
    found = []
    if not np.isfinite(start_state(game)).all():
        found.append(f"episode {number} starts with a pose that is not finite")
    for player in game.players:
        x, y = player.body.position[:2]
        if min(room.distance_m((x, y)) for room in game.world.playground.rooms) > 0.0:
            place = f"({x:.2f}, {y:.2f})"
            found.append(f"episode {number} starts with {player.name} outside the rooms at {place}")
    return found + [f"episode {number} starts where {text}" for text in overlaps(game)]


def _rest(game: Game) -> Outcome:
    for player in game.actors:
        game.play_script(player, Script.idle)
    return game.advance()


def _ends(outcomes: Sequence[Outcome]) -> list[str]:
    """Return the episodes that terminate, and the players for whom some of the starts are solved.

    Where a goal is to avoid something, all starts are solved: that is no fault.
    """
    found = [
        f"episode {n} terminates in its first step" for n, o in enumerate(outcomes) if o.terminated
    ]
    for name in outcomes[0].solved:
        solved = [number for number, outcome in enumerate(outcomes) if outcome.solved[name]]
        if 0 < len(solved) < len(outcomes):
            found.append(
                f"{len(solved)} of {len(outcomes)} episodes are solved for {name} at their start"
            )
    return found


def _spread(game: Game, positions: list[Floats]) -> str:
    spread = np.std(positions, axis=0)
    parts = [
        f"{player.name} {x:.2f} m in x, {y:.2f} m in y"
        for player, (x, y, _) in zip(game.players, spread, strict=True)
    ]
    return "standard deviations of the positions: " + "; ".join(parts)


SEEDING_NAMES = ("seeding",)


def check_seeding(used: Game, new: Game, steps: int, seed: int) -> Iterator[Finding]:
    """Play the same random actions several times and compare observations and rewards.

    Args:
        used: A game; it plays another episode before it is compared.
        new: A game that was just built.
        steps: Number of steps of each rollout.
        seed: Seed of episodes and actions.

    Yields:
        ``seeding``: the rollout has the same bytes in a new and in a used world, and another seed
        starts another episode.
    """
    problems = []
    first = digest(used, steps, seed)
    other = _start(used, seed + 1)
    if digest(used, steps, seed) != first:
        problems.append("the same seed gives other bytes in a world that was used before")
    if digest(new, steps, seed) != first:
        problems.append("the same seed gives other bytes in a new world")
    if _start(used, seed) == other:
        problems.append(f"the seeds {seed} and {seed + 1} give the same start")
    yield finding("seeding", problems, f"{steps} steps have equal bytes in a new and a used world")


def digest(game: Game, steps: int, seed: int) -> str:
    """Return a hash of poses, observations, terms and flags of a rollout of random actions."""
    total, episodes, rng, done = hashlib.sha256(), Episodes(seed), np.random.default_rng(seed), True
    for _ in range(steps):
        if done:
            game.reset(episodes.next())
            _add_observations(total, game)
        outcome = game.step({p.name: random_action(p.body.action_spec, rng) for p in game.actors})
        done = outcome.done
        _add_observations(total, game)
        total.update(repr((outcome.terms, done, sorted(outcome.eliminated))).encode())
    return total.hexdigest()


def _start(game: Game, seed: int) -> str:
    """Return a hash of the start of the first episode; no action has an effect on it."""
    total = hashlib.sha256()
    game.reset(Episodes(seed).next())
    _add_observations(total, game)
    return total.hexdigest()


def _add_observations(total: hashlib._Hash, game: Game) -> None:
    """Add the poses, which senses need not show, and the observations."""
    total.update(start_state(game).tobytes())
    for player in game.actors:
        for key, array in sorted(game.observe(player).items()):
            total.update(key.encode())
            total.update(np.ascontiguousarray(array).tobytes())
