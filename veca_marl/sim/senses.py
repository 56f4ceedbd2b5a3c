"""The registry of senses: which there are, how each is configured, and how a body gets them.

A further sense, in this package or in another one, is a subclass of `Sense` with a dataclass of
settings that has the field `present`, registered under its name::

    @dataclass
    class SmellCfg:
        present: bool = True
        range_m: float = 2.0

    class SmellSense(Sense):
        def __init__(self, cfg: SmellCfg, body: Body, world: World) -> None:
            super().__init__(world)
            self.specs = {"smell": ArraySpec((3,), np.float32)}
        ...

    register_sense("smell", SmellCfg, SmellSense)

A task then names it in `senses`; `SensesCfg.extra` (``+senses.extra.smell.range_m=1.0``) holds its
settings where they differ from the defaults.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields
from typing import Any, NamedTuple

from veca_marl.sim.body.base import Body
from veca_marl.sim.body.proprioception import ProprioceptionCfg, ProprioceptionSense
from veca_marl.sim.hearing.sense import AudioCfg, AudioSense
from veca_marl.sim.physics.world import World
from veca_marl.sim.sense import Sense
from veca_marl.sim.touch.sense import TouchCfg, TouchSense
from veca_marl.sim.vision.sense import VisionCfg, VisionSense


class SenseType(NamedTuple):
    """An entry of the registry.

    Attributes:
        cfg: The dataclass of its settings; all fields have defaults, `present` is one of them.
        make: Constructs the sense from settings, body and world, usually the class itself.
    """

    cfg: type[Any]
    make: Callable[[Any, Body, World], Sense]


_REGISTRY: dict[str, SenseType] = {}


def register_sense(name: str, cfg: type[Any], make: Callable[[Any, Body, World], Sense]) -> None:
    """Make a sense available to tasks under a name.

    Args:
        name: As tasks name it; for a built-in sense also its field of `SensesCfg`.
        cfg: See `SenseType`.
        make: See `SenseType`.

    Raises:
        ValueError: If the name is registered already, or the settings lack `present`.
    """
    if name in _REGISTRY:
        raise ValueError(f"sense {name!r} is already registered")
    if "present" not in {f.name for f in fields(cfg)}:
        raise ValueError(f"sense {name!r}: {cfg.__name__} has no field 'present'")
    _REGISTRY[name] = SenseType(cfg, make)


def list_senses() -> list[str]:
    """Return the names of all registered senses, sorted."""
    return sorted(_REGISTRY)


@dataclass
class SensesCfg:
    """The quality of each sense. The task names the senses, this grades them.

    Quality changes what an observation contains, never its shape; a sense that is not `present`
    is left out of the observation.

    Attributes:
        vision: Settings of the eyes.
        audio: Settings of hearing.
        proprioception: Settings of proprioception.
        touch: Settings of the skin.
        extra: Settings of registered senses that have no field here, by name: an instance of the
            sense's own dataclass or a mapping of its fields. A sense that is not in it has its
            defaults.
    """

    vision: VisionCfg = field(default_factory=VisionCfg)
    audio: AudioCfg = field(default_factory=AudioCfg)
    proprioception: ProprioceptionCfg = field(default_factory=ProprioceptionCfg)
    touch: TouchCfg = field(default_factory=TouchCfg)
    extra: dict[str, Any] = field(default_factory=dict)

    def of(self, name: str) -> Any:
        """Return the settings of one registered sense.

        Raises:
            ValueError: If no sense of that name is registered, or its settings in `extra` have
                a field that its dataclass has not.
        """
        if name not in _REGISTRY:
            raise ValueError(f"unknown sense {name!r}; registered are {list_senses()}")
        if name in _BUILT_IN:
            return getattr(self, name)
        cfg_type = _REGISTRY[name].cfg
        given = self.extra.get(name, {})
        if isinstance(given, cfg_type):
            return given
        return _from_mapping(name, cfg_type, given)


def _from_mapping(name: str, cfg_type: type[Any], given: Any) -> Any:
    """Construct the settings of a sense from a mapping, with an error that lists its fields."""
    known = [f.name for f in fields(cfg_type)]
    if not isinstance(given, Mapping) or not set(given) <= set(known):
        raise ValueError(f"senses.extra.{name}={given!r}: must be a mapping of {known}")
    return cfg_type(**given)


def make_senses(body: Body, names: Sequence[str], cfg: SensesCfg, world: World) -> dict[str, Sense]:
    """Construct the senses of a body.

    Args:
        body: The body that perceives.
        names: The task's senses, such as `("vision", "audio")`.
        cfg: Their settings; a sense that is not `present` is left out.
        world: The world of the body.

    Raises:
        ValueError: If a name is not registered, or no sense is left.
    """
    unknown = sorted(set(names) - set(_REGISTRY))
    if unknown:
        raise ValueError(f"unknown senses {unknown}; registered are {list_senses()}")
    settings = {name: cfg.of(name) for name in names}
    senses = {
        name: _REGISTRY[name].make(own, body, world)
        for name, own in settings.items()
        if own.present
    }
    if names and not senses:
        raise ValueError(f"no sense is left: at least one of {list(names)} must be present")
    return senses


register_sense("vision", VisionCfg, VisionSense)
register_sense("audio", AudioCfg, AudioSense)
register_sense("proprioception", ProprioceptionCfg, ProprioceptionSense)
register_sense("touch", TouchCfg, TouchSense)
_BUILT_IN = frozenset(_REGISTRY)
