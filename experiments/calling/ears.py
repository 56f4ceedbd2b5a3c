"""Measure how loud calls are in both ears at rest: the numbers of the experts of hearing.

python experiments/calling/ears.py

Walkers that stand and crawlers that kneel hear a call from the same room or from another one. What
the ears hear on average is compared with 1 over the distance and the loss of the walls between,
their difference with the side that the call comes from.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from veca_marl.config import compose
from veca_marl.envs.core.game import Game
from veca_marl.envs.experts.control.locomotion import locomotion_of
from veca_marl.envs.experts.perception.call_localization import loudness
from veca_marl.envs.tasks.navigation.places import free_place
from veca_marl.envs.tasks.player_starts import place_player
from veca_marl.sim.sound import Call

CALLS = {"walker_voice": 300, "mitten_voice": 120}  # how many, by body
REST_STEPS = 40  # then a crawler's head is still
LEAST_M = 0.8  # between the two in one room


def listen(game: Game, together: bool, rng: np.random.Generator) -> NDArray[np.float64]:
    """Let one call and return what the other hears.

    Returns:
        Mean of the ears without distance and walls, difference of the ears (log10), how far to the
        left of the head the call comes from (sine).
    """
    game.reset(rng)
    ears, mouth = game.players
    world, task = game.world, game.task
    if together:
        room = task.plan.rooms[rng.integers(len(task.plan.rooms))]
        places = [np.zeros(3), np.zeros(3)]
        while math.dist(*places) < LEAST_M:
            places = [free_place(room, [], 0.5, rng) for _ in game.players]
        for player, place in zip(game.players, places, strict=True):
            place_player(player, place, rng.uniform(-math.pi, math.pi))
    legs = {p.name: locomotion_of(p, world.clock.step_s) for p in game.players}
    for player in game.players:
        game.observe(player)
    for _ in range(REST_STEPS):
        wishes = {ears.name: legs[ears.name].rest(), mouth.name: legs[mouth.name].rest(Call.high)}
        game.step({p.name: p.body.encode(wishes[p.name]) for p in game.players})
        heard, _ = [game.observe(player) for player in game.players]
    head, caller = ears.body.mount("head"), mouth.body.mount("mouth").position
    way = (caller - head.position) @ head.rotation
    away_m = float(np.linalg.norm(way))
    walls = world.house.obstacles_between(head.position, caller)
    left, right = loudness(heard["audio"])
    loss = world.playground.transmission_loss_db / 20.0 * walls
    return np.array(
        [(left + right) / 2.0 + math.log10(away_m) + loss, left - right, way[1] / away_m]
    )


def main() -> None:
    for body, calls in CALLS.items():
        shut = ["senses/vision=blind", "senses/touch=numb", "task.max_seconds=1000"]
        game = Game(compose(["+task=MultiAgentNav", f"body={body}", *shut]).game)
        rng = np.random.default_rng(5)
        rows = np.array([listen(game, bool(call % 2), rng) for call in range(calls)])
        mean, difference, left = rows.T
        slope, offset = np.polyfit(left, difference, 1)
        spread = np.std(difference - slope * left - offset)
        print(
            f"{body:13} {len(rows)} calls: at 1 m {mean.mean():.2f}, spread {mean.std():.2f}; "
            f"difference {slope:.2f} times the sine, spread {spread:.2f}"
        )
        game.close()


if __name__ == "__main__":
    main()
