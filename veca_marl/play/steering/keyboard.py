"""Keys that steer a walking body, by the names that pygame gives them."""

from __future__ import annotations

from veca_marl.sim.body import Body
from veca_marl.sim.body.action import VOICE
from veca_marl.sim.body.walker import WalkCommand, Walker
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
