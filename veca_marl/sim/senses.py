"""The senses: which there are, how each is graded, and how a body gets them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from veca_marl.sim.body.base import Body
from veca_marl.sim.body.proprioception import ProprioceptionCfg, ProprioceptionSense
from veca_marl.sim.hearing.sense import AudioCfg, AudioSense
from veca_marl.sim.physics.world import World
from veca_marl.sim.sense import Sense
from veca_marl.sim.touch.sense import TouchCfg, TouchSense
from veca_marl.sim.vision.sense import VisionCfg, VisionSense


@dataclass
class SensesCfg:
    """How each sense is graded. The task says which senses there are, this says how good.

    Quality changes what an observation contains, never its shape; a sense that is not `present`
    is left out of the observation.
    """

    vision: VisionCfg = field(default_factory=VisionCfg)
    audio: AudioCfg = field(default_factory=AudioCfg)
    proprioception: ProprioceptionCfg = field(default_factory=ProprioceptionCfg)
    touch: TouchCfg = field(default_factory=TouchCfg)


def give_senses(body: Body, names: Sequence[str], cfg: SensesCfg, world: World) -> dict[str, Sense]:
    """Give a body the senses a task asks for.

    Args:
        body: Who gets them.
        names: The task's senses, such as `("vision", "audio")`.
        cfg: Their grades; those not present are left out.
        world: Where the body is.

    Raises:
        ValueError: If there is no sense of a name, or all are absent.
    """
    makers: dict[str, Callable[[], Sense]] = {
        "vision": lambda: VisionSense(cfg.vision, body, world.scene),
        "audio": lambda: AudioSense(cfg.audio, body, world.sound),
        "proprioception": lambda: ProprioceptionSense(cfg.proprioception, body, world),
        "touch": lambda: TouchSense(cfg.touch, body, world.scene),
    }
    unknown = sorted(set(names) - set(makers))
    if unknown:
        raise ValueError(f"unknown senses {unknown}; there are {sorted(makers)}")
    given = {name: makers[name]() for name in names if getattr(cfg, name).present}
    if names and not given:
        raise ValueError(f"no sense is left: at least one of {list(names)} must be present")
    return given
