"""What must hold in every game at the start of an episode and after every step."""

from pathlib import Path

import numpy as np

from veca_marl.checks.episodes import observation_problems, reward_problems
from veca_marl.checks.starts import overlaps

BESIDE_ROOMS_M = 0.3  # walls are thinner; what stands in a doorway is between two rooms
BELOW_FLOOR_M = 0.1  # what is dropped penetrates the floor for a step: 7 cm at its edge were seen
ABOVE_CEILING_M = 0.5
PAGE_MB = 4096 / 2**20


def start_problems(game):
    """Return what is wrong with the start of an episode."""
    return [*state_problems(game), *observation_problems(game), *overlaps(game)]


def step_problems(game, outcome):
    """Return what is wrong after a step, without the observations."""
    found = [*state_problems(game), *reward_problems(game, outcome)]
    if game.steps > game.max_steps or (game.steps == game.max_steps) != outcome.truncated:
        found.append(f"step {game.steps} of {game.max_steps}: truncated is {outcome.truncated}")
    if set(outcome.eliminated) == {player.name for player in game.players} and not outcome.done:
        found.append("all players are eliminated and the episode continues")
    return found


def state_problems(game):
    """Yield the bodies and props that are not finite or not in the world any more."""
    for player in game.players:
        if not player.body.is_finite:
            yield f"{player.name} is not finite"
        yield from place_problems(game, player.name, player.body.position)
    for prop in game.world.props.values():
        if not prop.fixed:
            yield from place_problems(game, prop.name, prop.position)


def place_problems(game, name, position):
    """Yield a problem if a place is not finite, not in a room, below the floor or too high."""
    rooms = game.world.playground.rooms
    if not np.isfinite(position).all():
        yield f"{name} is at {position}"
        return
    away_m = min(room.distance_m(tuple(position[:2])) for room in rooms)
    low = min(room.lower_m[2] for room in rooms) - BELOW_FLOOR_M
    high = max(room.lower_m[2] + room.size_m[2] for room in rooms) + ABOVE_CEILING_M
    if away_m > BESIDE_ROOMS_M or not low < position[2] < high:
        yield f"{name} has left the rooms: it is at {np.round(position, 2)}"


def resident_mb():
    """Return the memory of this process that is in use, in MiB."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * PAGE_MB
