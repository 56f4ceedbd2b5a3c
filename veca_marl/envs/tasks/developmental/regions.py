"""Regions of the body that a hand can touch."""

from __future__ import annotations

from veca_marl.sim.body.humanoid import Humanoid

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
