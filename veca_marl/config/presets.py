"""Names of presets: what an override of a group of configuration files may choose."""

from __future__ import annotations

from collections.abc import Sequence

from veca_marl.config.errors import ConfigError
from veca_marl.config.overrides import parse
from veca_marl.config.search_path import conf_dirs


def check_group_values(words: Sequence[str]) -> None:
    """Check that overrides of groups, such as ``senses/vision``, give the name of a preset.

    Hydra answers another value with an error of its own code.

    Args:
        words: Overrides and flags.

    Raises:
        ConfigError: If one does not; the message lists the presets.
    """
    of_groups = [word for word in words if word[:1] not in "~-" and presets_of(_group(word))]
    for override in parse(of_groups):
        if override.is_sweep_override():
            continue
        value = override.value()
        names = value if isinstance(value, list) else [value]
        if not all(isinstance(name, str) for name in names):
            raise ConfigError(
                f"{override.input_line}: must be the name of a preset; choices: "
                f"{', '.join(presets_of(override.key_or_group))}"
            )


def presets_of(group: str) -> list[str]:
    """Return the names in a group; none if there is no such group."""
    folders = [folder / group for folder in conf_dirs() if group and (folder / group).is_dir()]
    return sorted({file.stem for folder in folders for file in folder.glob("*.yaml")})


def _group(word: str) -> str:
    """Return the key of an override without its package; nothing for other words."""
    key, equals, _ = word.lstrip("+").partition("=")
    return key.partition("@")[0] if equals else ""
