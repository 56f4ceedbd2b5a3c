"""Measure the levels of calls in both ears at rest: the constants of `call_localization`.

python experiments/calling/ears.py

Standing walkers and kneeling crawlers hear a call from the same room or from another one. The mean
level of the ears is compared with the energy of all paths, the difference of the ears with the
direction of the call.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from veca_marl.config import compose
from veca_marl.envs.core.game import Game
from veca_marl.envs.experts.control.locomotion import locomotion_of
from veca_marl.envs.experts.multi_agent_nav import arrival_of, loudness, sound_power
from veca_marl.envs.tasks.floors.places import free_place, place_player
from veca_marl.sim.sound import Call

CALLS = {"walker_voice": 300, "mitten_voice": 120}  # number of calls by body
REST_STEPS = 40  # after these the head of a crawler is at rest
LEAST_M = 0.8  # least distance of two agents in one room


def listen(game: Game, together: bool, rng: np.random.Generator) -> NDArray[np.float64]:
    """Let one agent call; return the levels at the ears of the other one.

    Returns:
        Mean level relative to the energy that arrives, difference of the levels (log10), and the
        sine of the azimuth of what arrives, positive to the left.
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
    locomotion = {p.name: locomotion_of(p, world.clock.step_s) for p in game.players}
    for player in game.players:
        game.observe(player)
    for _ in range(REST_STEPS):
        commands = {
            ears.name: locomotion[ears.name].rest(),
            mouth.name: locomotion[mouth.name].rest(Call.high),
        }
        game.step({p.name: p.body.encode(commands[p.name]) for p in game.players})
        heard, _ = [game.observe(player) for player in game.players]
    head, caller = ears.body.mount("head"), mouth.body.mount("mouth").position
    left, right = loudness(sound_power(ears.senses["audio"].log_magnitudes(heard["audio"])))
    level, side = arrival_of(world.house.arrivals(np.array(caller), head))
    return np.array([(left + right) / 2.0 - level, left - right, side])


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
