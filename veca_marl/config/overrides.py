"""Overrides as text: reading and normalising them before Hydra composes a configuration."""

from __future__ import annotations

import re
from collections.abc import Sequence

from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.core.override_parser.types import Override
from hydra.errors import HydraException

from veca_marl.config.errors import ConfigError, one_line

_EXPONENT = re.compile(r"[+-]?\d+(\.\d*)?[eE]\+?\d+")


def parse(overrides: Sequence[str]) -> list[Override]:
    """Parse overrides by Hydra's grammar.

    Raises:
        ConfigError: If one does not follow the grammar.
    """
    try:
        parsed: list[Override] = OverridesParser.create().parse_overrides(list(overrides))
    except HydraException as error:
        raise ConfigError(one_line(error)) from error
    return parsed


def root_of(override: Override) -> str:
    """Return the first part of the key of an override: ``senses`` of ``senses/audio=mono``."""
    return re.split(r"[./]", override.key_or_group, maxsplit=1)[0]


def plugins_in(overrides: Sequence[str]) -> list[str]:
    """Return the packages that `plugins=[...]` names.

    Raises:
        ConfigError: If its value is not a list of names.
    """
    texts = [text for text in overrides if text.lstrip("+").startswith("plugins=")]
    names: list[str] = []
    for override in parse(texts):
        value = override.value()
        if not isinstance(value, list) or not all(isinstance(name, str) for name in value):
            raise ConfigError(f"{override.input_line}: expected names: plugins=[my_package]")
        names += value
    return names


def with_integers(overrides: Sequence[str]) -> list[str]:
    """Write integral numbers in exponent notation with digits alone.

    ``total_frames=1e6`` becomes ``total_frames=1000000``, which fields of type int accept as well
    as those of type float; so do the values of a sweep. Everything else stays as it is.
    """
    return [_with_integers(text) for text in overrides]


def _with_integers(text: str) -> str:
    key, equals, value = text.partition("=")
    parts = value.split(",")
    if not equals or not all(parts):
        return text
    return f"{key}={','.join(map(_integer, parts))}"


def _integer(text: str) -> str:
    if not _EXPONENT.fullmatch(text.strip()):
        return text
    number = float(text)
    return str(int(number)) if number.is_integer() else text
