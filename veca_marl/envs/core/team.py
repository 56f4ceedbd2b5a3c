"""What may differ from team to team: bodies, senses, and who decides for its players."""

from __future__ import annotations

from dataclasses import dataclass, field, fields, replace
from enum import Enum
from typing import Any

from veca_marl.sim.body.base import BodyCfg
from veca_marl.sim.body.proprioception import ProprioceptionCfg
from veca_marl.sim.hearing.sense import AudioCfg
from veca_marl.sim.senses import SensesCfg
from veca_marl.sim.touch.sense import TouchCfg
from veca_marl.sim.vision.sense import VisionCfg


@dataclass
class TeamSensesCfg:
    """The senses of one team; None is as for everyone. The fields are those of `SensesCfg`."""

    vision: VisionCfg | None = None
    audio: AudioCfg | None = None
    proprioception: ProprioceptionCfg | None = None
    touch: TouchCfg | None = None
    extra: dict[str, Any] | None = None

    def change(self, common: SensesCfg) -> SensesCfg:
        """Return the senses of everyone with what this team has otherwise."""
        own = {f.name: getattr(self, f.name) for f in fields(self)}
        return replace(common, **{name: cfg for name, cfg in own.items() if cfg is not None})


@dataclass
class TeamCfg:
    """What one team has otherwise than everyone.

    Attributes:
        body: What its players are; None is as for everyone.
        senses: How well they perceive.
    """

    body: BodyCfg | None = None
    senses: TeamSensesCfg = field(default_factory=TeamSensesCfg)


class Script(Enum):
    """Who decides for a team that nobody learns to play: it is part of the world.

    Attributes:
        expert: The task's hand-written rules.
        random: Rows drawn uniformly from the world's random stream.
        idle: Nobody: its players rest.
    """

    expert = "expert"
    random = "random"
    idle = "idle"
