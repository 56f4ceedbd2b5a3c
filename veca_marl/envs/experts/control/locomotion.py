"""Locomotion to points of the floor, on two legs or on hands and knees, behind one interface."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Protocol

from veca_marl.envs.core.task import Player, require_walker
from veca_marl.envs.experts.control.crawl_gait import BACK, CRAWL, KNEEL, CrawlGait, GaitPattern
from veca_marl.envs.experts.control.posture_transitions import FallRecovery
from veca_marl.envs.tasks.floors.floor_plan import DoorApproach
from veca_marl.sim.body import Body
from veca_marl.sim.body.humanoid import Humanoid, JointCommand
from veca_marl.sim.body.walker import Walker
from veca_marl.sim.geometry import Floats
from veca_marl.sim.sound import Call

_FULL_TURN_RAD = 0.25  # bearing at which the turning command saturates


def bearing_rad(body: Body, point: Floats) -> float:
    """Return the angle of a point to the left of a body's forward direction, in [-pi, pi].

    Args:
        body: The body.
        point: ``(2,)`` or ``(3,)`` metres; the height is ignored.
    """
    way, ahead = point[:2] - body.position[:2], body.forward
    return math.atan2(ahead[0] * way[1] - ahead[1] * way[0], float(ahead[:2] @ way))


def walk_to(body: Body, point: Floats, speed: float = 1.0) -> tuple[float, float]:
    """Return the command (forward, turn) of a walker that moves to a point.

    It turns towards the point and walks with the cosine of the bearing, if that is positive.

    Args:
        body: The body of the walker.
        point: ``(2,)`` or ``(3,)`` metres; the height is ignored.
        speed: Share of the greatest speed.
    """
    bearing = bearing_rad(body, point)
    turn = min(max(bearing / _FULL_TURN_RAD, -1.0), 1.0)
    return speed * max(0.0, math.cos(bearing)), turn


_TURNING_RADIUS_M = 0.35  # a body that crawls in a circle steers back when it is farther away


@dataclass(frozen=True)
class Clearances:
    """Distances that a kind of body needs, measured from the pelvis, and how well it steers.

    Attributes:
        ball_m: Distance at which a ball in front starts to be pushed.
        run_up_m: Distance behind the ball from which it can be driven straight.
        clear_m: Distance at which the body passes a ball without touching it.
        wall_m: Least distance from a wall at which a run-up can begin.
        other_m: Distance between two bodies that push each other.
        turning_m: Radius of the area that a full turn takes.
        back_rad: Bearing beyond which the body moves backwards, where it has no space to turn.
        look_ahead_m: Distance along a line to the point that is steered to when following it.
        aside_m: Largest lateral distance from the line of a shot at contact with the ball.
        funnel: Increase of the permitted lateral distance per metre before contact.
        door_approach: How the body passes through doors.
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
    door_approach: DoorApproach


class Locomotion(Protocol):
    """Moves a player over the floor. All methods return a command for `Body.encode`.

    One method is called per step. Each takes a call to utter during the step.

    Attributes:
        clearances: Distances that the body needs.
    """

    clearances: Clearances

    def to(self, place: Floats, call: Call = Call.none) -> Any:
        """Move towards a place, ``(2,)`` or ``(3,)`` metres, without stopping there."""
        ...

    def turn(self, left: float, call: Call = Call.none) -> Any:
        """Turn on the spot; `left` is in [-1, 1], a share of the greatest turning rate."""
        ...

    def rest(self, call: Call = Call.none) -> Any:
        """Stay, with the head at rest."""
        ...

    def back(self, call: Call = Call.none) -> Any:
        """Move backwards; on hands and knees the heading is not controlled."""
        ...

    def follow_body(self) -> None:
        """See `Expert.follow_body`."""
        ...


class WalkerLocomotion:
    """`Locomotion` of a walker.

    Args:
        body: The body to move.
    """

    clearances = Clearances(
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
        door_approach=DoorApproach(before_m=0.4, right_m=0.2),
    )

    def __init__(self, body: Walker) -> None:
        self._body = body

    def to(self, place: Floats, call: Call = Call.none) -> tuple[float, float, Call]:
        """See `Locomotion.to`."""
        return *walk_to(self._body, place), call

    def turn(self, left: float, call: Call = Call.none) -> tuple[float, float, Call]:
        """See `Locomotion.turn`."""
        return 0.0, left, call

    def rest(self, call: Call = Call.none) -> tuple[float, float, Call]:
        """See `Locomotion.rest`."""
        return 0.0, 0.0, call

    def back(self, call: Call = Call.none) -> tuple[float, float, Call]:
        """See `Locomotion.back`."""
        return -1.0, 0.0, call

    def follow_body(self) -> None:
        """See `Expert.follow_body`; a walker's command depends on its pose alone."""


class CrawlLocomotion:
    """`Locomotion` of a joint-level body on hands and knees, to which it returns after a fall.

    Args:
        body: The body to move; it must be on hands and knees, or lie, now.
        step_s: Duration of an environment step.
    """

    # tuned by hand on PushOut1v1 and SoccerOnePlayer
    clearances = Clearances(
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
        door_approach=DoorApproach(before_m=0.9, right_m=0.0),
    )

    def __init__(self, body: Humanoid, step_s: float) -> None:
        self._body, self._step_s = body, step_s
        self._gait: CrawlGait | None = None
        self._recovery = FallRecovery(body, step_s)
        self._pivot: Floats | None = None

    def to(self, place: Floats, call: Call = Call.none) -> JointCommand:
        """See `Locomotion.to`. The body turns while it moves; obstacles stop it."""
        self._pivot = None
        return (self._rising() or self._towards(place))._replace(call=call)

    def turn(self, left: float, call: Call = Call.none) -> JointCommand:
        """Crawl in a small circle about the place where the turn began; see `Locomotion.turn`."""
        return (self._rising() or self._turning(left))._replace(call=call)

    def rest(self, call: Call = Call.none) -> JointCommand:
        """See `Locomotion.rest`."""
        return (self._rising() or self._with_pattern(KNEEL).command())._replace(call=call)

    def back(self, call: Call = Call.none) -> JointCommand:
        """See `Locomotion.back`."""
        return (self._rising() or self._with_pattern(BACK).command())._replace(call=call)

    def follow_body(self) -> None:
        """See `Expert.follow_body`."""
        self._recovery.follow_body()
        if self._gait is not None:
            self._gait.follow_body()

    def _rising(self) -> JointCommand | None:
        """Return the command of a body that has fallen; a new gait begins when it is up."""
        command = self._recovery.command()
        if command is not None:
            self._gait = None
        return command

    def _turning(self, left: float) -> JointCommand:
        here = self._body.position[:2]
        if self._pivot is None:
            self._pivot = here
        if math.dist(here, self._pivot) >= _TURNING_RADIUS_M:
            return self._towards(self._pivot)
        return self._with_pattern(CRAWL).command(left)

    def _towards(self, place: Floats) -> JointCommand:
        return self._with_pattern(CRAWL).towards(bearing_rad(self._body, place))

    def _with_pattern(self, pattern: GaitPattern) -> CrawlGait:
        """Return the current gait, or a new one if the pattern changes."""
        if self._gait is None or self._gait.pattern is not pattern:
            self._gait = CrawlGait(self._body, self._step_s, pattern)
        return self._gait


def locomotion_of(player: Player, step_s: float) -> Locomotion:
    """Return the `Locomotion` for a player's kind of body.

    Args:
        player: The player; a joint-level body must be on hands and knees, or lie, now.
        step_s: Duration of an environment step.
    """
    if isinstance(player.body, Humanoid):
        return CrawlLocomotion(player.body, step_s)
    return WalkerLocomotion(require_walker(player))
