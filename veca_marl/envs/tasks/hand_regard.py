"""HandRegard: keep the hands in view."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from veca_marl.envs.core.task import Player, register_task, require_humanoid, terms
from veca_marl.envs.tasks.locomotion.motor_skills import PosedStart, StartCfg, start_anywhere
from veca_marl.sim.body.humanoid import Humanoid, HumanoidCfg
from veca_marl.sim.body.humanoid.postures import ON_BACK
from veca_marl.sim.physics import PropCfg, World

_CEILING_M = 0.02  # thickness
EYES = {"left_eye": "eye_left", "right_eye": "eye_right"}
HANDS = {"left_hand": "l_hand", "right_hand": "r_hand"}
PAIRS = tuple((f"{eye}_{hand}", EYES[eye], HANDS[hand]) for eye in EYES for hand in HANDS)
"""Reward term, eye and hand of each pair."""


@dataclass
class HandRegardCfg(StartCfg):
    """Parameters of HandRegard.

    Attributes:
        max_seconds: 1000 steps of the default clock, as in BabyBench.
        spread_deg: Standard deviation of every joint angle at the start about lying on the back, in
            [0, 30].
        half_angle_deg: Greatest angle between the axis of an eye and the direction of a hand that
            it regards, above 0 and below 90; 15 in BabyBench.
    """

    max_seconds: float = 40.0
    half_angle_deg: float = 15.0
    weights: dict[str, float] = terms(
        left_eye_left_hand=0.25,
        left_eye_right_hand=0.25,
        right_eye_left_hand=0.25,
        right_eye_right_hand=0.25,
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 0.0 < self.half_angle_deg < 90.0:
            raise ValueError(f"task.half_angle_deg={self.half_angle_deg} must be in (0, 90)")


@register_task
class HandRegard(PosedStart):
    """A joint-level body lies on its back and keeps both hands before both eyes.

    Not in the VECA paper: the hand-regard task of BabyBench 2025 (suite `babybench`). As there, an
    eye regards a hand while the angle between the axis of the eye and the direction from the eye to
    the wrist is smaller than 15 degrees; what hides the hand does not matter, nor does the field of
    view of the images. The score is the fraction of steps in which a hand is regarded, mean over
    the four pairs of eye and hand; with the default weights the return is the score of the episode,
    in [0, 1]. BabyBench itself gives no reward, its agents learn by intrinsic rewards: set the four
    weights to 0 and choose `intrinsic=rnd`. An episode lasts 1000 steps and never terminates.

    Departures from BabyBench and its body, MIMo:

    - A step lasts 40 ms (1000 steps are 40 s), in MIMo 5 ms (5 s).
    - The body starts on its back with random joint angles about that posture; MIMo starts on its
      back and makes ten steps of random actions.
    - Torques drive the 40 joints of trunk and limbs; BabyBench's example drives arms, hands and
      head and locks the other joints. Eyes look straight ahead in both.
    - Images have the resolution and field of view of this body's eyes, MIMo's 64 x 64 pixels. A
      checkered ceiling is what the eyes see beside the body; BabyBench's example has toys on the
      floor about it.

    Terms:
        left_eye_left_hand: In a step in which the left eye regards the left hand, one divided by
            the number of steps of an episode; otherwise 0.
        left_eye_right_hand: The same for the left eye and the right hand.
        right_eye_left_hand: The same for the right eye and the left hand.
        right_eye_right_hand: The same for the right eye and the right hand.
    """

    suite = "babybench"
    senses = ("vision", "proprioception")
    body_cfg = HumanoidCfg
    cfg: HandRegardCfg

    def build(self) -> None:
        self.body = require_humanoid(self.players[0])
        add_ceiling(self.world)
        self._step = 1.0 / round(self.cfg.max_seconds / self.world.clock.step_s)
        self._half_angle_rad = math.radians(self.cfg.half_angle_deg)

    def reset(self, rng: np.random.Generator) -> None:
        start_anywhere(self.world, self.body, ON_BACK, self.cfg.spread_deg, rng)

    def reward(self, player: Player) -> dict[str, float]:
        return {
            term: self._step * (regard_rad(self.body, eye, hand) < self._half_angle_rad)
            for term, eye, hand in PAIRS
        }


def add_ceiling(world: World) -> None:
    """Add a checkered ceiling to the first room, so that movements of the head change the image."""
    room = world.playground.rooms[0]
    low, size = np.array(room.lower_m), np.array(room.size_m)
    x, y, z = low + size * (0.5, 0.5, 1.0)
    world.add_prop(
        PropCfg(
            name="ceiling",
            size_m=[float(size[0]), float(size[1]), _CEILING_M],
            position_m=(float(x), float(y), float(z) + _CEILING_M),
            colour=(0.8, 0.8, 0.75),
            checker_m=0.5,
            tangible=False,
        )
    )


def regard_rad(body: Humanoid, eye: str, hand: str) -> float:
    """Return the angle between the axis of an eye and the direction from it to a wrist, rad.

    Args:
        body: The body.
        eye: ``eye_left`` or ``eye_right``.
        hand: ``l_hand`` or ``r_hand``.
    """
    pose = body.mount(eye)
    away = body.bone(hand).position - pose.position
    cosine = float(away @ pose.rotation[:, 0]) / float(np.linalg.norm(away))
    return math.acos(min(max(cosine, -1.0), 1.0))
