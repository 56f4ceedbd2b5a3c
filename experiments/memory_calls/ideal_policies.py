"""How often seekers with and without memory could reach the object at best.

python experiments/memory_calls/ideal_policies.py

Hand-written policies play 100 games of the experiment. Where the finder calls, they know the
direction of the object to within 11 degrees, which the experiment's agents have to learn to hear.
The one with memory turns towards it, counts its own turns, and walks. Those without memory turn by
one action when they hear the call; in the silence between they walk, or walk and stand at random.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod

import numpy as np

from veca_marl.config import compose
from veca_marl.envs.core.game import Game
from veca_marl.envs.core.task import Player
from veca_marl.sim.body.walker.actions import MOVES
from veca_marl.sim.geometry import Floats

GAMES = 100
PERIOD = 8  # actions from one call to the next
HEARING_STD_RAD = 0.2
STAND, FORWARD, LEFT, RIGHT = (list(MOVES).index(m) for m in ("stand", "forward", "left", "right"))


class Policy(ABC):
    """Chooses moves from the direction of the calls.

    Args:
        turn_rad: Angle of one turn.
        rng: Random generator.
    """

    def __init__(self, turn_rad: float, rng: np.random.Generator) -> None:
        self._turn_rad, self._rng = turn_rad, rng

    def _towards(self, left_rad: float) -> int:
        """Return the move that brings the agent nearer to a direction, positive to the left."""
        if abs(left_rad) <= self._turn_rad / 2.0:
            return FORWARD
        return LEFT if left_rad > 0.0 else RIGHT

    @abstractmethod
    def act(self, heard_rad: float | None) -> int:
        """Return a move.

        Args:
            heard_rad: Direction of the call that is heard now, positive to the left; None in
                silence.
        """


class Remembering(Policy):
    """Turns towards the last call, and counts its own turns."""

    _left_rad = 0.0

    def act(self, heard_rad: float | None) -> int:
        """See `Policy`."""
        if heard_rad is not None:
            self._left_rad = heard_rad
        move = self._towards(self._left_rad)
        self._left_rad -= self._turn_rad * ((move == LEFT) - (move == RIGHT))
        return move


class Walking(Policy):
    """Turns when it hears a call, and walks in the silence."""

    def act(self, heard_rad: float | None) -> int:
        """See `Policy`."""
        return FORWARD if heard_rad is None else self._towards(heard_rad)


class WalkingAndStanding(Policy):
    """Turns when it hears a call; in the silence it walks or stands, each with probability 0.5."""

    def act(self, heard_rad: float | None) -> int:
        """See `Policy`."""
        if heard_rad is None:
            return FORWARD if self._rng.random() < 0.5 else STAND
        return self._towards(heard_rad)


class Random(Policy):
    """Chooses all moves alike."""

    def act(self, heard_rad: float | None) -> int:
        """See `Policy`."""
        return int(self._rng.integers(len(MOVES)))


def direction_rad(player: Player, place: Floats) -> float:
    """Return the horizontal angle of a place to the heading of a player, positive to the left."""
    ahead, way = player.body.forward, place - player.body.position
    return math.atan2(ahead[0] * way[1] - ahead[1] * way[0], ahead[0] * way[0] + ahead[1] * way[1])


def is_solved(game: Game, policy: Policy, rng: np.random.Generator) -> bool:
    """Play one game; return whether the seeker reaches the object."""
    game.reset(rng)
    (seeker,) = game.actors
    while True:
        heard_rad = None
        if game.steps % PERIOD == 1:  # the call of the step before is heard
            there = direction_rad(seeker, game.task.target.position)
            heard_rad = there + rng.normal(0.0, HEARING_STD_RAD)
        outcome = game.step({seeker.name: np.array(policy.act(heard_rad))})
        if outcome.done:
            return outcome.terminated


def main() -> None:
    """Print the share of the games that each policy solves."""
    cfg = compose(["+experiment=memory_calls"]).game
    game = Game(cfg)
    turn_rad = math.radians(cfg.body.turn_speed_degps) * cfg.clock.step_s
    for kind in (Remembering, Walking, WalkingAndStanding, Random):
        generators = [np.random.default_rng([0, number]) for number in range(GAMES)]
        solved = [is_solved(game, kind(turn_rad, rng), rng) for rng in generators]
        print(f"{kind.__name__:18} {np.mean(solved):4.0%}", flush=True)
    game.close()


if __name__ == "__main__":
    main()
