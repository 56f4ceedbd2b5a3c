"""`compose` for tests of what is composed, without the composition of every set of numbers.

A composition by Hydra takes 0.2 s. Presets are composed once in a process; numbers below them
(``task.max_seconds=0.4``) are set in the dataclasses, except those of playgrounds, from which rooms
may be generated. The tests of composition itself use `veca_marl.config.compose`.
"""

import re
from copy import deepcopy
from dataclasses import is_dataclass, replace
from functools import cache

from omegaconf import OmegaConf
from omegaconf.errors import OmegaConfBaseException

from veca_marl import config
from veca_marl.config.errors import one_line
from veca_marl.config.overrides import parse
from veca_marl.override_text import normalised

NUMBER = re.compile(r"(?!playground\.)\w+(\.\w+)+=")


def compose(overrides=()):
    """Return a copy of what `veca_marl.config.compose` returns for the overrides."""
    presets = tuple(text for text in overrides if not NUMBER.match(text))
    numbers = parse(normalised([text for text in overrides if NUMBER.match(text)]))
    composed = deepcopy(_composed(presets))
    if not numbers:
        return composed
    try:
        composed = with_numbers(composed, {each.key_or_group: each.value() for each in numbers})
        composed.check_teams()
        composed.game.check_bodies()
        composed.game.check_playground()
        composed.game.check_clock()
    except (OmegaConfBaseException, ValueError) as error:
        raise config.ConfigError(one_line(error)) from error
    return composed


@cache
def _composed(presets):
    return config.compose(presets)


def with_numbers(cfg, numbers):
    """Return a dataclass with other values for dotted keys, converted and checked as by Hydra."""
    inner, own = {}, {}
    for key, value in numbers.items():
        name, _, rest = key.partition(".")
        if rest and is_dataclass(getattr(cfg, name)):
            inner.setdefault(name, {})[rest] = value
        else:
            own[key] = value
    changed = {name: with_numbers(getattr(cfg, name), found) for name, found in inner.items()}
    if own:
        node = OmegaConf.structured(cfg)
        for key, value in own.items():
            OmegaConf.update(node, key, value)
        typed = OmegaConf.to_object(node)
        changed |= {name: getattr(typed, name) for name in {key.partition(".")[0] for key in own}}
    return replace(cfg, **changed)
