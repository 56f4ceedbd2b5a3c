"""The parameters of the walking body."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

from veca_marl.sim.body.anatomy import REFERENCE, Growth, load_skeleton
from veca_marl.sim.body.body_cfg import BodyCfg
from veca_marl.sim.body.walker.actions import WalkActionKind
from veca_marl.sim.physics import ClockCfg
from veca_marl.sim.physics.interactions import check_interactions


@dataclass
class WalkerCfg(BodyCfg):
    """Parameters of the walking body. The paper does not give them; the values are ours.

    Lengths, speeds, masses and impulses are those of the body of 0.78 m. A body of another age or
    height has them in proportion, see `sized`.

    Attributes:
        action: Continuous velocities or discrete moves.
        walk_speed_mps: Speed of a full forward action; see `greatest_speed_mps` for its limit.
        backward_share: Speed of a full backward action as a fraction of the forward speed, in
            [0, 1].
        turn_speed_degps: Turning speed of a full turn action.
        radius_m: Radius of the capsule in the physics.
        capsule_height_m: Height of the capsule.
        push_limit_kg: Props up to this mass are light: they are pushed, kicked and carried. Heavier
            ones stop the walker.
        restitution: 0 (nothing rebounds from the body) to 1 (things rebound as from the floor);
            multiplied by that of the prop. Above 0 props also leave a walking body faster than it
            walks.
        kick_reach_m: Largest distance from the capsule's surface to that of a prop it can kick.
        kick_angle_deg: Largest angle between the walker's heading and the direction of the prop's
            centre of mass.
        kick_height_m: Largest height of the prop's lowest point.
        kick_speed_mps: Speed away from the walker up to which a kick accelerates a prop.
        kick_impulse_ns: Largest impulse of a kick; heavy props do not reach that speed.
        head_pitch_deg: Pitch of the head at the start of an episode; down is positive.
        stride_height_m: Height of the highest fixed or heavy thing over which it walks, and rise of
            the steepest slope within its radius and 6 cm; 0.05: 16 degrees. 0: all stop it.
        step_height_m: Height of the highest prop onto which it steps.
        step_reach_m: Largest distance from the capsule's surface to such a prop.
        crawl_height_m: Height and width of the body in crawling.
        crawl_length_m: Its length in crawling, at least its height.
        crawl_share: Speed of crawling as a fraction of that of walking, in [0, 1].
        verbs: Verbs of the discrete action part `verb`, such as ``[grab, release]``; without
            verbs there is no such part. See `veca_marl.sim.physics.interactions`.
    """

    action: WalkActionKind = WalkActionKind.continuous
    walk_speed_mps: float = 1.0
    backward_share: float = 0.3
    turn_speed_degps: float = 120.0
    radius_m: float = 0.11
    capsule_height_m: float = 0.72
    push_limit_kg: float = 5.0
    restitution: float = 0.0
    kick_reach_m: float = 0.15
    kick_angle_deg: float = 60.0
    kick_height_m: float = 0.25
    kick_speed_mps: float = 3.0
    kick_impulse_ns: float = 3.0
    head_pitch_deg: float = 12.0
    stride_height_m: float = 0.05
    step_height_m: float = 0.2
    step_reach_m: float = 0.3
    crawl_height_m: float = 0.36
    crawl_length_m: float = 0.56
    crawl_share: float = 0.4
    verbs: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        """Check the choices, the numbers, the verbs, and that the capsule is higher than wide."""
        self._check_choices(action=WalkActionKind)
        super().__post_init__()
        if not 0.0 < 2.0 * self.radius_m <= self.capsule_height_m:
            raise ValueError(
                f"body.radius_m={self.radius_m}, body.capsule_height_m={self.capsule_height_m}: "
                "the radius must be positive and at most half the height"
            )
        if not 0.0 < self.crawl_height_m < self.crawl_length_m:
            raise ValueError(
                f"body.crawl_height_m={self.crawl_height_m}, "
                f"body.crawl_length_m={self.crawl_length_m}: the height must be positive and "
                "smaller than the length"
            )
        for name in ("backward_share", "restitution", "crawl_share"):
            if getattr(self, name) > 1.0:
                raise ValueError(f"body.{name}={getattr(self, name)} is not in [0, 1]")
        check_interactions("body.verbs", self.verbs)


def sized(cfg: WalkerCfg) -> WalkerCfg:
    """Return the parameters of a body of the size that a configuration asks for.

    Reach and heights of the feet follow the legs, speeds the root of that (`Growth.speed`), the
    capsule the trunk and the height, masses the mass, impulses mass times speed. Turning speeds and
    angles are those of the configuration.

    Args:
        cfg: For the body of 0.78 m.
    """
    growth = cfg.growth
    if growth == REFERENCE:
        return cfg
    mass, leg, speed = _mass_ratio(growth), growth.leg, growth.speed
    return replace(
        cfg,
        walk_speed_mps=cfg.walk_speed_mps * speed,
        radius_m=cfg.radius_m * growth.trunk.girth,
        capsule_height_m=cfg.capsule_height_m * growth.size,
        push_limit_kg=cfg.push_limit_kg * mass,
        kick_reach_m=cfg.kick_reach_m * leg,
        kick_height_m=cfg.kick_height_m * leg,
        kick_speed_mps=cfg.kick_speed_mps * speed,
        kick_impulse_ns=cfg.kick_impulse_ns * mass * speed,
        stride_height_m=cfg.stride_height_m * leg,
        step_height_m=cfg.step_height_m * leg,
        step_reach_m=cfg.step_reach_m * leg,
        crawl_height_m=cfg.crawl_height_m * growth.size,
        crawl_length_m=cfg.crawl_length_m * growth.size,
    )


def _mass_ratio(growth: Growth) -> float:
    return load_skeleton(growth).mass_kg / load_skeleton().mass_kg


def greatest_speed_mps(cfg: WalkerCfg, clock: ClockCfg) -> float:
    """Return the speed at which a walker moves by its radius in one physics step.

    The capsule is moved to its new position before contacts are resolved. If it moves by at most
    its radius, its axis is still on the near side of a wall that it touched, however thin, and it
    is moved back to that side.

    Raises:
        ValueError: If the configured speed is higher; the message names the limit.
    """
    limit = cfg.radius_m / clock.substep_s
    if cfg.walk_speed_mps > limit:
        raise ValueError(
            f"body.walk_speed_mps={cfg.walk_speed_mps} covers more than "
            f"body.radius_m={cfg.radius_m} in a physics step of {clock.substep_s:.4g} s and could "
            f"pass through walls: at most {limit:.4g} m/s, or raise clock.substeps"
        )
    return limit
