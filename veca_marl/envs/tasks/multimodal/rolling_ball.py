"""Launch of a ball that rolls out of a side wall."""

from __future__ import annotations

import math

import numpy as np

from veca_marl.sim.physics import ClockCfg, Prop, RoomCfg

_WALL_GAP_M = 0.02  # between the ball and the wall
_END_CLEARANCE_M = 1.0  # from the walls at both ends of the side wall


def check_ball_speed(speed_mps: float, radius_m: float, clock: ClockCfg) -> None:
    """Check that a ball moves by at most its radius in one physics step.

    Contacts are found after each physics step: a faster ball could pass through a wall.

    Raises:
        ValueError: If it is faster; the message names the limit.
    """
    limit = radius_m / clock.substep_s
    if speed_mps > limit:
        raise ValueError(
            f"task.speed_mps of up to {speed_mps:g} covers more than task.radius_m={radius_m:g} in "
            f"a physics step of {clock.substep_s:.4g} s: at most {limit:.4g} m/s, or raise "
            "clock.substeps"
        )


def launch_from_side_wall(
    ball: Prop,
    room: RoomCfg,
    speed_mps: tuple[float, float],
    spread_deg: float,
    rng: np.random.Generator,
) -> None:
    """Place a ball at the left (+y) or right (-y) wall of a room, rolling into the room.

    Args:
        ball: A sphere.
        room: The room.
        speed_mps: Least and greatest speed.
        spread_deg: Largest angle between its direction and the wall's normal.
        rng: Random generator of the episode.
    """
    radius_m = ball.cfg.size_m[0]
    side = rng.choice((-1.0, 1.0))
    start = room.sample_floor(rng, margin_m=_END_CLEARANCE_M)
    half = room.size_m[1] / 2
    start[1] = room.lower_m[1] + half + side * (half - (radius_m + _WALL_GAP_M))
    start[2] = radius_m
    angle = math.radians(rng.uniform(-spread_deg, spread_deg))
    direction = np.array([math.sin(angle), -side * math.cos(angle), 0.0])
    speed = rng.uniform(*speed_mps)
    spin = np.cross((0.0, 0.0, 1.0), direction) * speed / radius_m
    ball.place(start, velocity=speed * direction, angular_velocity=spin)
