"""Experts of SoccerOnePlayer and SoccerTwoPlayer: shots at the goal, and points to steer to."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from veca_marl.envs.core.expert import Expert, register_expert
from veca_marl.envs.experts.control.locomotion import Clearances, bearing_rad, locomotion_of
from veca_marl.envs.experts.control.path_following import WallRecovery
from veca_marl.envs.tasks.soccer import ATTACKER, Soccer
from veca_marl.envs.tasks.soccer_pitch import Pitch
from veca_marl.sim.geometry import Floats

# lateral distances of aims from the middle of the goal, as shares of its width
_AIM_SHARES = (0.0, 0.08, -0.08, 0.16, -0.16, 0.24, -0.24, 0.32, -0.32)
_OPEN_SHARE = 0.39  # where a ball that touches the inner side of a post has its centre
_DEPTH_M = 0.3  # aims are this far behind the goal line for a ball in front of the mouth
_FREE_M = 0.5  # a shot that passes the keeper at this distance is free
# costs in radians of additional turn about the ball, set by hand
_MARGIN_RAD, _MISS_COST = 0.3, 6.0  # angle to the nearer post that is wanted; cost per rad less
_KEEPER_COST, _RUN_UP_COST, _WALL_COST = 5.0, 1.0, 0.8
_DEVIATIONS_RAD = [side * math.radians(deg) for deg in range(0, 180, 15) for side in (1.0, -1.0)]


@dataclass(frozen=True)
class Shooter:
    """Positions of a body that will shoot and of an opponent.

    Attributes:
        here: Position of the body, ``(2,)`` metres.
        clearances: Distances that it needs.
        keeper: Position of an opponent, ``(2,)`` metres; None if there is none.
    """

    here: Floats
    clearances: Clearances
    keeper: Floats | None = None


def shot_at_goal(shooter: Shooter, ball: Floats, pitch: Pitch) -> Floats:
    """Return the direction in which to push a ball into the goal, a unit vector ``(2,)``.

    Of several points of the mouth it is the one with the least sum of costs: the turn of the body
    about the ball, a small angle to a post, a keeper near the path of the ball or near the run-up,
    and walls that leave no space for the run-up.

    Args:
        shooter: The body.
        ball: Position of the ball, ``(2,)`` metres.
        pitch: The pitch.
    """
    half_m = pitch.goal_width_m / 2.0
    is_in_front = abs(float(ball[1] - pitch.goal[1])) < half_m
    depth_m = _DEPTH_M if is_in_front else 0.0
    aims = (np.array([depth_m, share * pitch.goal_width_m]) for share in _AIM_SHARES)
    shots = [unit(pitch.goal[:2] + aim - ball) for aim in aims]
    return min(shots, key=lambda shot: _cost(shot, shooter, ball, pitch))


def feasible_shot(ball: Floats, shot: Floats, clearances: Clearances, pitch: Pitch) -> Floats:
    """Return the direction nearest to a shot's for which the pitch has space for the run-up."""
    for deviation_rad in _DEVIATIONS_RAD:
        c, s = math.cos(deviation_rad), math.sin(deviation_rad)
        rotated = np.array([c * shot[0] - s * shot[1], s * shot[0] + c * shot[1]])
        if _has_run_up(ball, rotated, clearances, pitch):
            return rotated
    return shot


def segment_distance_m(start: Floats, end: Floats, point: Floats) -> float:
    """Return the distance of a point from a line segment, metres."""
    way = end - start
    share = float((point - start) @ way) / max(float(way @ way), 1e-9)
    return float(np.hypot(*(start + min(max(share, 0.0), 1.0) * way - point)))


def unit(way: Floats) -> Floats:
    """Return a vector of length 1 with the same direction."""
    return way / max(float(np.hypot(*way)), 1e-9)


def _cost(shot: Floats, shooter: Shooter, ball: Floats, pitch: Pitch) -> float:
    clearances = shooter.clearances
    turn_rad = _angle_rad(ball - shooter.here, shot)
    cost = turn_rad + _MISS_COST * max(_MARGIN_RAD - _post_margin_rad(shot, ball, pitch), 0.0)
    if not _has_run_up(ball, shot, clearances, pitch):
        cost += _WALL_COST
    if shooter.keeper is None:
        return cost
    end = ball + max(float(pitch.goal[0] - ball[0]), 0.0) / max(float(shot[0]), 0.1) * shot
    from_path_m = segment_distance_m(ball, end, shooter.keeper)
    start = ball - clearances.run_up_m * shot
    is_in_the_way = segment_distance_m(start, ball, shooter.keeper) < clearances.other_m
    blocked = max(1.0 - from_path_m / _FREE_M, 0.0)
    return cost + _KEEPER_COST * blocked + _RUN_UP_COST * float(is_in_the_way)


def _post_margin_rad(shot: Floats, ball: Floats, pitch: Pitch) -> float:
    """Return the angle between a shot and the direction of the nearer post."""
    open_m = _OPEN_SHARE * pitch.goal_width_m
    posts = (pitch.goal[:2] + np.array([0.0, side * open_m]) - ball for side in (1.0, -1.0))
    return min(_angle_rad(shot, post) for post in posts)


def _has_run_up(ball: Floats, shot: Floats, clearances: Clearances, pitch: Pitch) -> bool:
    start, margin = ball - clearances.run_up_m * shot, clearances.wall_m
    return bool((start > pitch.low + margin).all() and (start < pitch.high - margin).all())


def _angle_rad(a: Floats, b: Floats) -> float:
    return abs(math.atan2(float(a[0] * b[1] - a[1] * b[0]), float(a @ b)))


_BALL_M = 0.12
# deceleration of a rolling ball as observed, and the share of its path that a board leaves it
_ROLLING_MPS2, _REBOUND = 0.25, 0.6
_SPEED_MPS = 0.4  # of a body on hands and knees
_LEAST_PREDICTION_S, _MOST_PREDICTION_S = 0.25, 2.5


def attacking_point(shooter: Shooter, pitch: Pitch) -> Floats:
    """Return the point to steer to so that the ball moves into the goal, ``(2,)`` metres.

    Args:
        shooter: The body that shoots.
        pitch: The pitch with the ball.
    """
    ball = predicted_ball(pitch, shooter)
    return _pushing_point(shooter, pitch, ball, shot_at_goal(shooter, ball, pitch))


def clearing_point(shooter: Shooter, pitch: Pitch) -> Floats:
    """Return the point to steer to so that the ball moves away from the goal, ``(2,)`` metres.

    Arguments as of `attacking_point`.
    """
    ball = predicted_ball(pitch, shooter)
    return _pushing_point(shooter, pitch, ball, unit(ball - pitch.goal[:2]))


def predicted_ball(pitch: Pitch, shooter: Shooter) -> Floats:
    """Return where the ball will be when a body can reach it, ``(2,)`` metres.

    It decelerates uniformly and rebounds from the edges of the pitch; at most 2.5 s are predicted.
    """
    place, velocity = pitch.ball.position[:2], pitch.ball.velocity[:2]
    speed = float(np.hypot(*velocity))
    way_m = float(np.hypot(*(place - shooter.here))) - shooter.clearances.ball_m
    time_s = min(max(way_m / _SPEED_MPS, _LEAST_PREDICTION_S), _MOST_PREDICTION_S)
    time_s = min(time_s, speed / _ROLLING_MPS2)
    rolled_m = speed * time_s - _ROLLING_MPS2 * time_s**2 / 2.0
    ball = place + rolled_m * unit(velocity)
    low, high = pitch.low + _BALL_M, pitch.high - _BALL_M
    ball = ball + (1.0 + _REBOUND) * (np.maximum(low - ball, 0.0) - np.maximum(ball - high, 0.0))
    return np.clip(ball, low, high)


def _pushing_point(shooter: Shooter, pitch: Pitch, ball: Floats, shot: Floats) -> Floats:
    """Return the point to steer to so that the ball moves in a direction, ``(2,)`` metres.

    A body drives a ball in contact away from itself. The path therefore leads round the ball at a
    distance until the ball lies between the body and the aim, and then through the ball. Where
    walls leave no space for the run-up, the shot deviates from its direction as little as possible.
    """
    clearances, here = shooter.clearances, shooter.here
    shot = feasible_shot(ball, shot, clearances, pitch)
    behind, aside = float((ball - here) @ shot), abs(_cross(shot, ball - here))
    if aside < clearances.aside_m + clearances.funnel * (behind - clearances.ball_m):
        return ball - max(behind - clearances.look_ahead_m, 0.0) * shot
    start = ball - clearances.run_up_m * shot
    if shooter.keeper is not None:
        start = _around_keeper(shooter, start)
    return _around(here, ball, start, clearances.clear_m)


def _around_keeper(shooter: Shooter, goal: Floats) -> Floats:
    """Return the next point of a path to a goal past the keeper, ``(2,)`` metres."""
    keeper = shooter.keeper
    assert keeper is not None
    reach_m = min(math.dist(keeper, goal), math.dist(keeper, shooter.here)) - 0.1
    return _around(shooter.here, keeper, goal, min(shooter.clearances.other_m, reach_m))


def _around(here: Floats, obstacle: Floats, goal: Floats, clear_m: float) -> Floats:
    """Return the next point of a path to a goal that passes an obstacle, ``(2,)`` metres."""
    way = goal - here
    length = float(np.hypot(*way))
    along = unit(way)
    ahead = float((obstacle - here) @ along)
    left = np.array([-along[1], along[0]])
    aside = float((obstacle - here) @ left)
    if not (0.0 < ahead < length + 0.1 and abs(aside) < clear_m):
        return goal
    side = -math.copysign(1.0, aside)
    return obstacle + side * clear_m * 1.2 * left


def _cross(a: Floats, b: Floats) -> float:
    return float(a[0] * b[1] - a[1] * b[0])


_TURNING_S = 2.8  # from beside the ball to behind it
_CHEST_M = 0.3  # from the pelvis forwards, for bodies on hands and knees
_KEEPER_M = 0.7  # distance of the chest from the other player, likewise
_BEHIND_RAD = 2.5  # a body that turns to a place at a greater bearing does not change the side
_OFF_WALLS_M = 0.45  # distance of the chest from walls at which they do not stop the body


@register_expert("SoccerOnePlayer")
class SoccerExpert(Expert[Soccer]):
    """Goes behind the ball and drives it into the goal.

    Reads position and velocity of the ball, the positions of the players, its own heading, and
    edges and goal of the pitch from the simulator (privileged); on hands and knees also its own
    joint angles and the orientations of chest and pelvis, with which it gets up after a fall.
    """

    reads = ()

    def reset(self) -> None:
        """See `Expert.reset`."""
        step_s = self.task.world.clock.step_s
        locomotion = locomotion_of(self.player, step_s)
        self._locomotion = WallRecovery(
            self.player.body, locomotion, step_s, _TURNING_S, self._has_space
        )
        self._side = 0.0

    def act(self, observation: Mapping[str, NDArray[Any]]) -> Any:
        """Return a command for the player's kind of body, see `Expert.act`."""
        here = self.player.body.position[:2]
        shooter = Shooter(here, self._locomotion.clearances, self.keeper())
        return self._locomotion.to(self._on_one_side(self.point(shooter)))

    def follow_body(self) -> None:
        """See `Expert.follow_body`."""
        self._locomotion.follow_body()

    def point(self, shooter: Shooter) -> Floats:
        """Return the point to steer to, ``(2,)`` metres."""
        return attacking_point(shooter, self.task.pitch)

    def keeper(self) -> Floats | None:
        """Return the position of the opponent, ``(2,)`` metres; None if there is none."""
        others = [player for player in self.task.players if player is not self.player]
        return others[0].body.position[:2] if others else None

    def _on_one_side(self, point: Floats) -> Floats:
        """Return a point, or one beside the body while it turns to a point behind it.

        On hands and knees the heading swings by about 20 degrees during a stride. The point behind
        would be on the left and on the right in turn.
        """
        body = self.player.body
        bearing = bearing_rad(body, point)
        if abs(bearing) < _BEHIND_RAD or self._side == 0.0:
            self._side = math.copysign(1.0, bearing)
        if bearing * self._side > 0.0:
            return point
        ahead = body.forward[:2]
        return body.position[:2] + self._side * np.array([-ahead[1], ahead[0]])

    def _has_space(self) -> bool:
        """Return whether walls and the other player are too far away to stop the body."""
        body, pitch, keeper = self.player.body, self.task.pitch, self.keeper()
        chest = body.position[:2] + _CHEST_M * body.forward[:2]
        if keeper is not None and math.dist(chest, keeper) < _KEEPER_M:
            return False
        return bool(
            (chest > pitch.low + _OFF_WALLS_M).all() and (chest < pitch.high - _OFF_WALLS_M).all()
        )


@register_expert("SoccerTwoPlayer")
class SoccerTwoPlayerExpert(SoccerExpert):
    """As attacker shoots past the defender; as defender drives the ball away from the goal.

    Reads what `SoccerExpert` reads (privileged): position and velocity of the ball, the positions
    of the players, its own heading, edges and goal of the pitch; on hands and knees also its own
    joint angles and the orientations of chest and pelvis.
    """

    def point(self, shooter: Shooter) -> Floats:
        """See `SoccerExpert.point`."""
        if self.player.team == ATTACKER:
            return super().point(shooter)
        return clearing_point(replace(shooter, keeper=None), self.task.pitch)
