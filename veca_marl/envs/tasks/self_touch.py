"""SelfTouch: touch one's own body with both hands."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from veca_marl.envs.core.task import Player, register_task, require_humanoid, terms
from veca_marl.envs.tasks.locomotion.motor_skills import PosedStart, StartCfg, start_anywhere
from veca_marl.sim.body.humanoid import Humanoid, HumanoidCfg
from veca_marl.sim.body.humanoid.postures import ON_BACK

HANDS = {"left_hand": "l", "right_hand": "r"}
"""Reward term of each hand, and the prefix of its bones."""

TRUNK = ("pelvis", "spine", "chest", "neck", "head")
_ARM, _LEG = ("upper_arm", "forearm", "hand"), ("thigh", "shank", "foot")
_LIMB_PARTS = (*_ARM, *_LEG)


def regions_of(side: str) -> tuple[str, ...]:
    """Return the 14 regions that a hand can touch: trunk, the other arm, both legs.

    Args:
        side: ``l`` or ``r``: the hand that touches.
    """
    other = "r" if side == "l" else "l"
    arm = tuple(f"{other}_{part}" for part in _ARM)
    legs = tuple(f"{leg}_{part}" for part in _LEG for leg in "lr")
    return (*TRUNK, *arm, *legs)


def region_of(bone: str) -> str:
    """Return the region of a bone: itself, or the hand for the bones of a finger."""
    if bone in TRUNK:
        return bone
    side, part = bone.split("_", 1)
    return bone if part in _LIMB_PARTS else f"{side}_hand"


def touched_regions(body: Humanoid) -> dict[str, set[str]]:
    """Return the regions that each hand touches now, by the names in `HANDS`.

    A hand is its palm with the fingers.
    """
    touched: dict[str, set[str]] = {name: set() for name in HANDS}
    for pair in body.self_contacts():
        first, second = map(region_of, pair)
        for name, side in HANDS.items():
            touched[name] |= {
                other
                for hand, other in ((first, second), (second, first))
                if hand == f"{side}_hand" and other in regions_of(side)
            }
    return touched


@dataclass
class SelfTouchCfg(StartCfg):
    """Parameters of SelfTouch.

    Attributes:
        max_seconds: 1000 steps of the default clock, as in BabyBench.
        spread_deg: Standard deviation of every joint angle at the start about lying on the back, in
            [0, 30].
    """

    max_seconds: float = 40.0
    weights: dict[str, float] = terms(left_hand=0.5, right_hand=0.5)


@register_task
class SelfTouch(PosedStart):
    """A joint-level body lies on its back and touches as many regions of itself as possible.

    Not in the VECA paper: the self-touch task of BabyBench 2025 (suite `babybench`). As there, the
    score is the number of distinct regions that the left hand has touched plus that of the right
    hand, divided by the greatest possible number; with the default weights the return is the score
    of the episode, in [0, 1]. BabyBench itself gives no reward, its agents learn by intrinsic
    rewards: `task.weights.left_hand=0 task.weights.right_hand=0 intrinsic=rnd`. Contacts of the
    physics count, at the end of each step. An episode lasts 1000 steps and never terminates.

    Departures from BabyBench and its body, MIMo:

    - Regions are the 14 bones that a hand can touch: pelvis, spine, chest, neck, head, upper arm,
      forearm and hand of the other side, both thighs, shanks and feet. MIMo's are 34 geoms for
      each hand: one each for hip, lower body, head, eyes, upper arms, lower arms and upper legs,
      two each for palm, fingers, lower legs and toes, three each for upper body and feet. They
      include the own arm and the own fingers, which a hand cannot reach. Scores of the two bodies
      therefore differ by more than the policies.
    - A hand touches with palm and fingers, in MIMo with the palm only.
    - A step lasts 40 ms (1000 steps are 40 s), in MIMo 5 ms (5 s).
    - The body starts on its back with random joint angles about that posture; MIMo starts on its
      back and makes ten steps of random actions.
    - Torques drive the 40 joints of trunk and limbs of a body with fixed fingers (`mitten_limbs`);
      that of MIMo has 44 joints, of which those of feet and eyes are locked.

    Terms:
        left_hand: Regions that the left hand touches for the first time in this episode, as a
            fraction of 14.
        right_hand: The same for the right hand.
    """

    suite = "babybench"
    senses = ("touch", "proprioception")
    body_cfg = HumanoidCfg
    cfg: SelfTouchCfg

    def build(self) -> None:
        self.body = require_humanoid(self.players[0])
        self._forget()

    def _forget(self) -> None:
        self.touched: dict[str, set[str]] = {hand: set() for hand in HANDS}
        self._new = dict.fromkeys(HANDS, 0)

    def reset(self, rng: np.random.Generator) -> None:
        start_anywhere(self.world, self.body, ON_BACK, self.cfg.spread_deg, rng)
        self._forget()

    def after_step(self, rng: np.random.Generator) -> None:
        for hand, regions in touched_regions(self.body).items():
            self._new[hand] = len(regions - self.touched[hand])
            self.touched[hand] |= regions

    def reward(self, player: Player) -> dict[str, float]:
        return {hand: self._new[hand] / len(regions_of(side)) for hand, side in HANDS.items()}

    def state(self) -> dict[str, float]:
        return {
            f"{hand}_{region}": float(region in self.touched[hand])
            for hand, side in HANDS.items()
            for region in regions_of(side)
        }
