"""The configuration of single teams: body, senses, and scripts."""

from __future__ import annotations

from dataclasses import dataclass, field, fields, replace
from enum import Enum
from typing import Any

from veca_marl.sim.body import BodyCfg
from veca_marl.sim.body.proprioception import ProprioceptionCfg
from veca_marl.sim.hearing import AudioCfg
from veca_marl.sim.senses import SensesCfg
from veca_marl.sim.touch import TouchCfg
from veca_marl.sim.vision import VisionCfg


@dataclass
class TeamSensesCfg:
    """The senses of one team; None is as for all teams. The fields are those of `SensesCfg`."""

    vision: VisionCfg | None = None
    audio: AudioCfg | None = None
    proprioception: ProprioceptionCfg | None = None
    touch: TouchCfg | None = None
    extra: dict[str, Any] | None = None

    def replace_in(self, common: SensesCfg) -> SensesCfg:
        """Return the senses of all teams with those of this team replaced."""
        own = {f.name: getattr(self, f.name) for f in fields(self)}
        return replace(common, **{name: cfg for name, cfg in own.items() if cfg is not None})


@dataclass
class TeamCfg:
    """Body and senses of one team.

    Attributes:
        body: Body of its players; None is as for all teams.
        senses: Senses of its players.
    """

    body: BodyCfg | None = None
    senses: TeamSensesCfg = field(default_factory=TeamSensesCfg)

    def with_waveform(self) -> TeamCfg:
        """Return this team with the samples at the ears, if it has an audio setting of its own."""
        if self.senses.audio is None:
            return self
        audio = replace(self.senses.audio, waveform=True)
        return replace(self, senses=replace(self.senses, audio=audio))


class Script(Enum):
    """How the game chooses the actions of a scripted team, which is not part of the specs.

    Attributes:
        expert: By the expert of the task.
        random: Uniformly, with the generator of the episode.
        idle: Its players rest.
    """

    expert = "expert"
    random = "random"
    idle = "idle"
