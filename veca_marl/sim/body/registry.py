"""The registry of bodies: `walker`, `humanoid`, and those that plug-ins add."""

from __future__ import annotations

from veca_marl.registry import Registry
from veca_marl.sim.body.base import Body
from veca_marl.sim.body.body_cfg import BodyCfg
from veca_marl.sim.body.humanoid.humanoid import Humanoid
from veca_marl.sim.body.walker.walker import Walker
from veca_marl.sim.physics import World

BODIES: Registry[type[Body]] = Registry("body")


def register_body(name: str, body_type: type[Body]) -> None:
    """Make a kind of body available by the class of its configuration, `Body.cfg_type`.

    Args:
        name: Its name in the configuration, such as `walker`.
        body_type: The class; its constructor takes the arguments of `Body`.

    Raises:
        ValueError: If another body has this name or this class of configuration.
    """
    for known, other in BODIES.items():
        if known != name and other.cfg_type is body_type.cfg_type:
            raise ValueError(f"{body_type.cfg_type.__name__} already describes the body {known!r}")
    BODIES.add(name, body_type)


def make_body(name: str, cfg: BodyCfg, world: World, shirt: int = 0) -> Body:
    """Put a body into a world.

    Args:
        name: Unique in the world.
        cfg: Its parameters; their class chooses the kind of body.
        world: The world, not yet frozen.
        shirt: Index of the shirt's colour.

    Raises:
        ValueError: If no body is registered for the class of `cfg`.
    """
    for body_type in BODIES.values():
        if body_type.cfg_type is type(cfg):
            return body_type(name, cfg, world, shirt)
    known = sorted(body_type.cfg_type.__name__ for body_type in BODIES.values())
    raise ValueError(f"no body is registered for {type(cfg).__name__}; there are {known}")


register_body("walker", Walker)
register_body("humanoid", Humanoid)
