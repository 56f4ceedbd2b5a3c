"""Whether every start of an episode is possible, and how starts are distributed."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from veca_marl.checks.findings import Finding, finding
from veca_marl.checks.overlaps import overlaps
from veca_marl.envs.core.benchmark import start_state
from veca_marl.envs.core.episodes import Episodes
from veca_marl.envs.core.game import Game, Outcome
from veca_marl.envs.core.game_cfg import Script
from veca_marl.sim.geometry import Floats

NAMES = ("starts", "first step")


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
