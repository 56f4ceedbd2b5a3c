"""Which bodies there are, by the configuration that describes them."""

from __future__ import annotations

from veca_marl.sim.body.base import Body, BodyCfg
from veca_marl.sim.body.humanoid.humanoid import Humanoid, HumanoidCfg
from veca_marl.sim.body.walker.walker import Walker, WalkerCfg
from veca_marl.sim.physics.world import World


def make_body(name: str, cfg: BodyCfg, world: World, shirt: int = 0) -> Body:
    """Put a body into a world.

    Args:
        name: Unique in the world.
        cfg: What it is.
        world: Not yet frozen.
        shirt: Number of the shirt's colour.

    Raises:
        ValueError: If `cfg` describes no body.
    """
    if isinstance(cfg, WalkerCfg):
        return Walker(name, cfg, world, shirt)
    if isinstance(cfg, HumanoidCfg):
        return Humanoid(name, cfg, world, shirt)
    raise ValueError(f"{type(cfg).__name__} is no body; there are WalkerCfg and HumanoidCfg")
