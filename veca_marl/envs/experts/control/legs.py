"""Getting about on two legs or on hands and knees: what experts of games know of bodies."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol

from veca_marl.envs.core.task import Player, walker
from veca_marl.envs.experts.control.crawl import Crawl
from veca_marl.envs.experts.control.rhythms import BACK, CRAWL, KNEEL, Rhythm
from veca_marl.envs.experts.control.walking import bearing_rad, walk_to
from veca_marl.envs.tasks.multi_agent.floor_plan import Passing
from veca_marl.sim.body.humanoid.humanoid import Humanoid
from veca_marl.sim.body.humanoid.joint_controls import Springs
from veca_marl.sim.body.walker.walker import Walker
from veca_marl.sim.geometry.pose import Floats
from veca_marl.sim.sound.calls import Call

_CIRCLE_M = 0.35  # who crawls and turns comes back when it is farther than this from where it began


@dataclass(frozen=True)
class Reach:
    """How near things are, and how well a body keeps to a line; from the pelvis, in metres.

    Attributes:
        ball_m: There a ball before the body goes off, away from it.
        run_up_m: From so far a body comes at a ball that shall go straight on.
        clear_m: A ball passed at this distance stays where it is.
        wall_m: Nearer to a wall no run-up begins.
        other_m: Between two who push each other.
        turning_m: Room that it takes to turn round, as a radius.
        back_rad: Where it has no room to turn, it goes backwards to what is farther aside.
        look_ahead_m: Who follows a line goes to where it is so far ahead.
        aside_m: Whether a body is on the line of a shot: so far aside of it when the ball goes off,
        funnel: and so much more for each metre before.
        passing: How it goes through doors.
    """

    ball_m: float
    run_up_m: float
    clear_m: float
    wall_m: float
    other_m: float
    turning_m: float
    back_rad: float
    look_ahead_m: float
    aside_m: float
    funnel: float
    passing: Passing


class Legs(Protocol):
    """How a player gets about. What its methods return is a wish for `Body.encode`.

    Attributes:
        reach: How near it comes to things.
    """

    reach: Reach

    def to(self, place: Floats, call: Call = Call.none) -> Any:
        """Go to a place ``(2,)`` or ``(3,)``, metres, and on through it; call on the way."""
        ...

    def turn(self, left: float, call: Call = Call.none) -> Any:
        """Turn where it is, as fast as it can at -1 and 1."""
        ...

    def rest(self, call: Call = Call.none) -> Any:
        """Stay, and hold the head still."""
        ...

    def back(self, call: Call = Call.none) -> Any:
        """Go straight back."""
        ...


class TwoLegs:
    """Those of a walker.

    Args:
        body: Whose they are.
    """

    reach = Reach(
        ball_m=0.38,
        run_up_m=0.55,
        clear_m=0.42,
        wall_m=0.13,
        other_m=0.3,
        turning_m=0.0,
        back_rad=math.pi,
        look_ahead_m=0.25,
        aside_m=0.05,
        funnel=0.4,
        passing=Passing(before_m=0.4, right_m=0.2),
    )

    def __init__(self, body: Walker) -> None:
        self._body = body

    def to(self, place: Floats, call: Call = Call.none) -> tuple[float, float, Call]:
        """See `Legs`."""
        return *walk_to(self._body, place), call

    def turn(self, left: float, call: Call = Call.none) -> tuple[float, float, Call]:
        """See `Legs`."""
        return 0.0, left, call

    def rest(self, call: Call = Call.none) -> tuple[float, float, Call]:
        """See `Legs`."""
        return 0.0, 0.0, call

    def back(self, call: Call = Call.none) -> tuple[float, float, Call]:
        """See `Legs`."""
        return -1.0, 0.0, call


class HandsAndKnees:
    """Those of a joint-level body that crawls.

    Args:
        body: Whose they are; it is on hands and knees now.
        step_s: Time between two wishes.
    """

    # found by trying some in the ring and on the pitch
    reach = Reach(
        ball_m=0.5,
        run_up_m=1.1,
        clear_m=0.6,
        wall_m=0.45,
        other_m=0.75,
        turning_m=0.5,
        back_rad=2.1,
        look_ahead_m=0.5,
        aside_m=0.2,
        funnel=0.8,
        passing=Passing(before_m=0.9, right_m=0.0),
    )

    def __init__(self, body: Humanoid, step_s: float) -> None:
        self._body, self._step_s = body, step_s
        self._crawl = Crawl(body, step_s)
        self._pivot: Floats | None = None

    def to(self, place: Floats, call: Call = Call.none) -> Springs:
        """See `Legs`; it turns on the way, and what it runs into holds it: `back` frees it."""
        self._pivot = None
        aside_rad = bearing_rad(self._body, place)
        return self._in(CRAWL).towards(aside_rad)._replace(call=call)

    def turn(self, left: float, call: Call = Call.none) -> Springs:
        """Crawl round where it began to turn, the nearest to `Legs.turn` that it can."""
        here = self._body.position[:2]
        if self._pivot is None:
            self._pivot = here
        if math.dist(here, self._pivot) < _CIRCLE_M:
            return self._in(CRAWL).wish(left)._replace(call=call)
        inwards_rad = bearing_rad(self._body, self._pivot)
        return self._in(CRAWL).towards(inwards_rad)._replace(call=call)

    def rest(self, call: Call = Call.none) -> Springs:
        """See `Legs`."""
        return self._in(KNEEL).wish()._replace(call=call)

    def back(self, call: Call = Call.none) -> Springs:
        """See `Legs`."""
        return self._in(BACK).wish()._replace(call=call)

    def _in(self, rhythm: Rhythm) -> Crawl:
        if self._crawl.rhythm is not rhythm:
            self._crawl = Crawl(self._body, self._step_s, rhythm)
        return self._crawl


def legs_of(players: Sequence[Player], step_s: float) -> dict[str, Legs]:
    """Return by name how players get about from now on: on two legs, or on hands and knees.

    Args:
        players: Who; joint-level bodies are on hands and knees now.
        step_s: Time between two wishes.
    """
    return {player.name: _legs_of(player, step_s) for player in players}


def _legs_of(player: Player, step_s: float) -> Legs:
    if isinstance(player.body, Humanoid):
        return HandsAndKnees(player.body, step_s)
    return TwoLegs(walker(player))
