"""The registry of senses: which there are, how each is configured, and how a body gets them.

A further sense, in this package or in a plug-in, is a subclass of `Sense` with a dataclass of
settings that has the field `present`, registered under its name::

    @dataclass
    class SmellCfg:
        present: bool = True
        range_m: float = 2.0

    @register_sense("smell")
    class SmellSense(Sense):
        cfg_type = SmellCfg

        def __init__(self, cfg: SmellCfg, body: Body, world: World) -> None:
            super().__init__(world)
            self.specs = {"smell": ArraySpec((3,), np.float32)}
        ...

A task then names it in `senses`; `SensesCfg.extra` (``+senses.extra.smell.range_m=1.0``) holds its
settings where they differ from the defaults.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from typing import Any, Protocol, TypeVar

from veca_marl.registry import Registry
from veca_marl.sim.body import Body
from veca_marl.sim.body.proprioception import ProprioceptionCfg, ProprioceptionSense
from veca_marl.sim.hearing import AudioCfg, AudioSense
from veca_marl.sim.physics import World
from veca_marl.sim.sense import Sense
from veca_marl.sim.touch import TouchCfg, TouchSense
from veca_marl.sim.vision import VisionCfg, VisionSense, open_eyes


class SenseClass(Protocol):
    """What the registry holds: a subclass of `Sense` with this constructor.

    Attributes:
        cfg_type: The dataclass of its settings; all fields have defaults, `present` is one of them.
    """

    cfg_type: type[Any]

    def __call__(self, cfg: Any, body: Body, world: World) -> Sense:
        """Construct the sense of a body."""
        ...


SENSES: Registry[SenseClass] = Registry("sense")
SenseT = TypeVar("SenseT", bound=SenseClass)


def register_sense(name: str) -> Callable[[SenseT], SenseT]:
    """Return a class decorator that makes a sense available to tasks under a name.

    Args:
        name: As tasks name it; for a built-in sense also its field of `SensesCfg`.

    Raises:
        ValueError: By the decorator, if another class has the name, or the settings of this one
            lack the field `present`.
    """

    def register(sense: SenseT) -> SenseT:
        if "present" not in {f.name for f in fields(sense.cfg_type)}:
            raise ValueError(f"sense {name!r}: {sense.cfg_type.__name__} has no field 'present'")
        SENSES.add(name, sense)
        return sense

    return register


@dataclass
class SensesCfg:
    """Settings of senses. The task names the senses, this sets their quality.

    Presets of quality change what an observation contains, never its shape; resolution, encoding
    and number of bins change its shape. A sense that is not `present` is left out. A sense without
    settings here has the defaults of its dataclass, and in the settings of one team those of all
    teams.

    Attributes:
        vision: Settings of the eyes.
        audio: Settings of hearing.
        proprioception: Settings of proprioception.
        touch: Settings of the skin.
        extra: Settings of registered senses that have no field here, by name: an instance of the
            sense's own dataclass or a mapping of its fields.

    Raises:
        ValueError: If a name in `extra` is not that of a registered sense without a field here.
    """

    vision: VisionCfg | None = None
    audio: AudioCfg | None = None
    proprioception: ProprioceptionCfg | None = None
    touch: TouchCfg | None = None
    extra: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for name in self.extra:
            if name in self._own_fields():
                raise ValueError(f"senses.extra.{name}: set senses.{name}, which is built in")
            SENSES.find(name)

    @classmethod
    def _own_fields(cls) -> set[str]:
        return {f.name for f in fields(cls)} - {"extra"}

    @classmethod
    def complete(cls) -> SensesCfg:
        """Return settings in which each sense that has a field here has its defaults."""
        return cls(**{name: cls().of(name) for name in cls._own_fields()})

    @property
    def unset(self) -> set[str]:
        """Names of the senses that have a field and no settings."""
        return {name for name in self._own_fields() if getattr(self, name) is None}

    def of(self, name: str) -> Any:
        """Return the settings of one registered sense.

        Raises:
            ValueError: If no sense of that name is registered, or its settings in `extra` have
                a field that its dataclass has not.
        """
        cfg_type = SENSES.find(name).cfg_type
        given = getattr(self, name) if name in self._own_fields() else self.extra.get(name)
        if given is None:
            return cfg_type()
        return given if isinstance(given, cfg_type) else _from_mapping(name, cfg_type, given)

    def replaced_by(self, own: SensesCfg) -> SensesCfg:
        """Return these settings, of all teams, with those of the senses that one team has set.

        Args:
            own: Settings of the team.
        """
        given = {name: getattr(own, name) for name in self._own_fields() - own.unset}
        return replace(self, **given, extra={**self.extra, **own.extra})


def _from_mapping(name: str, cfg_type: type[Any], given: Any) -> Any:
    """Construct the settings of a sense from a mapping, with an error that lists its fields."""
    known = [f.name for f in fields(cfg_type)]
    if not isinstance(given, Mapping) or not set(given) <= set(known):
        raise ValueError(f"senses.extra.{name}={given!r}: must be a mapping of {known}")
    return cfg_type(**given)


def make_senses(body: Body, names: Sequence[str], cfg: SensesCfg, world: World) -> dict[str, Sense]:
    """Construct the senses of a body, and give it its sight (`Body.sight`).

    Sight has the camera of the sense of vision, also if the body has no such sense. It renders only
    when it is asked.

    Args:
        body: The body that perceives.
        names: The task's senses, such as `("vision", "audio")`.
        cfg: Their settings; a sense that is not `present` is left out.
        world: The world of the body.

    Raises:
        ValueError: If a name is not registered, or no sense is left.
    """
    settings = {name: cfg.of(name) for name in names}
    senses = {name: SENSES[name](own, body, world) for name, own in settings.items() if own.present}
    if names and not senses:
        raise ValueError(f"no sense is left: at least one of {list(names)} must be present")
    vision = senses.get("vision")
    if isinstance(vision, VisionSense):
        body.sight = vision.eyes
    else:
        open_eyes(world.scene, body, cfg.of("vision").camera())
    return senses


register_sense("vision")(VisionSense)
register_sense("audio")(AudioSense)
register_sense("proprioception")(ProprioceptionSense)
register_sense("touch")(TouchSense)
