"""Steering the first agent: keys as commands of a walking body, the pointer as its gaze."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from veca_marl.envs.adapters.torchrl.env import VecaEnv
from veca_marl.envs.adapters.torchrl.scripted import CommandPolicy
from veca_marl.envs.core.expert import find_expert
from veca_marl.envs.core.game import Game, Observation
from veca_marl.envs.core.task import Player
from veca_marl.sim.body import Body
from veca_marl.sim.body.action import VOICE
from veca_marl.sim.body.walker import WalkCommand, Walker
from veca_marl.sim.geometry import Floats
from veca_marl.sim.physics.interactions import NO_VERB
from veca_marl.sim.sound import Call

FORWARD, BACKWARD = ("w", "up"), ("s", "down")
LEFT, RIGHT = ("a", "left"), ("d", "right")
VERB_KEYS = ("1", "2", "3", "4", "5", "6", "7", "8", "9", "0")
CALL_KEYS = {"z": Call.low, "x": Call.high, "c": Call.rising, "v": Call.falling}


class Keyboard:
    """Turns keys into commands for a walking body.

    Movement lasts as long as a key is held. A verb or a call is chosen once for each time its key
    is pressed, in the next step.
    """

    def __init__(self) -> None:
        self._held: set[str] = set()
        self._verb_key: str | None = None
        self._call = Call.none

    def press(self, key: str) -> None:
        """Note that a key went down."""
        self._held.add(key)
        if key in VERB_KEYS:
            self._verb_key = key
        self._call = CALL_KEYS.get(key, self._call)

    def release(self, key: str) -> None:
        """Note that a key went up."""
        self._held.discard(key)

    def release_all(self) -> None:
        """Forget all keys: the window lost the focus, or an episode begins."""
        self._held.clear()
        self._verb_key, self._call = None, Call.none

    def command(self, walker: Walker) -> WalkCommand:
        """Return the command of the next step; a chosen verb and call are used up.

        Args:
            walker: The body; keys of verbs that it does not have are ignored.
        """
        verbs = dict(zip(VERB_KEYS, walker.cfg.verbs, strict=False))
        verb = verbs.get(self._verb_key or "", NO_VERB)
        call, self._verb_key, self._call = self._call, None, Call.none
        forward, turn = self._axis(FORWARD, BACKWARD), self._axis(LEFT, RIGHT)
        return WalkCommand(forward, turn, call, verb)

    def _axis(self, positive: tuple[str, ...], negative: tuple[str, ...]) -> float:
        """Return 1, 0 or -1 for the keys of two opposite directions."""
        return float(any(key in self._held for key in positive)) - float(
            any(key in self._held for key in negative)
        )


def steering_help(walker: Walker) -> list[str]:
    """Return the lines that list the keys of a walking body."""
    lines = ["w s or up down: walk, a d or left right: turn"]
    verbs = [f"{key} {verb}" for key, verb in zip(VERB_KEYS, walker.cfg.verbs, strict=False)]
    lines += [", ".join(verbs[first : first + 5]) for first in range(0, len(verbs), 5)]
    if VOICE in walker.action_spec:
        lines.append(", ".join(f"{key} {call.name} call" for key, call in CALL_KEYS.items()))
    return [*lines, "left mouse button: look there; right: look ahead"]


def steerable(body: Body) -> Walker:
    """Return a body that keys can steer.

    Raises:
        ValueError: If it is no walking body.
    """
    if not isinstance(body, Walker):
        raise ValueError(
            f"policy=keyboard: {body.name} is a {type(body).__name__}; keys steer walking bodies "
            "alone (body=walker, body=walker_verbs, ...). Watch this one with policy=expert or "
            "policy=random"
        )
    return body


YAW_RAD, PITCH_RAD = math.radians(45.0), math.radians(35.0)
DISTANCE_M = 3.0


def gaze_point(body: Body, right: float, down: float) -> Floats:
    """Return the point to look at, ``(3,)`` metres in the world frame, 3 m from the head.

    Args:
        body: The body; the direction is relative to its head.
        right: -1 is 45 degrees to the left of straight ahead, 1 to the right.
        down: -1 is 35 degrees above straight ahead, 1 below.
    """
    yaw, pitch = -right * YAW_RAD, -down * PITCH_RAD
    direction = (
        math.cos(pitch) * math.cos(yaw),
        math.cos(pitch) * math.sin(yaw),
        math.sin(pitch),
    )
    head = body.mount("head")
    point: Floats = head.position + DISTANCE_M * (head.rotation @ np.array(direction))
    return point


class SteeredPolicy(CommandPolicy):
    """Plays the first actor by the keyboard and the others by the expert of the task.

    Args:
        env: The environment.
        keyboard: The keys.

    Raises:
        ValueError: If the first actor has no walking body, or there are others and no expert.
    """

    def __init__(self, env: VecaEnv, keyboard: Keyboard) -> None:
        super().__init__(env)
        self._keyboard = keyboard
        steerable(env.games[0].actors[0].body)
        if len(env.games[0].actors) > 1:
            find_expert(env.cfg.task.name)

    def command(self, game: Game, player: Player, observation: Observation) -> Any:
        """Return the command of the keyboard, or that of the player's expert."""
        if player is game.actors[0]:
            # a game makes new bodies when a simulation breaks down
            return self._keyboard.command(steerable(player.body))
        return game.expert_of(player).act(observation)
