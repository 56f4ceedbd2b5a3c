"""Checks of the arguments of `veca_marl.api`, which Hydra would answer in its own words."""

from __future__ import annotations

import operator
from collections.abc import Mapping, Sequence
from dataclasses import fields
from typing import Any

from veca_marl.config import Config, ConfigError
from veca_marl.config.overrides import parse, root_of
from veca_marl.envs.core.game_cfg import GameCfg, Script

# `opponent` is the configuration of `GameCfg.script`
_ROOTS_OF_GAMES = {f.name for f in fields(GameCfg)} - {"script"} | {"opponent", "plugins"}


def check_name(argument: str, value: Any) -> None:
    """Check an argument that is a name.

    Raises:
        ConfigError: If it is no text.
    """
    if not isinstance(value, str):
        raise ConfigError(f"{argument}={value!r} must be a name, as text")


def check_list(argument: str, value: Any, example: str) -> None:
    """Check an argument that is a list of texts.

    Args:
        argument: Its name.
        value: Its value.
        example: A list that it may be, for the message.

    Raises:
        ConfigError: If it is one text, or another thing than a list of texts.
    """
    is_list = isinstance(value, Sequence) and not isinstance(value, str)
    if not is_list or not all(isinstance(entry, str) for entry in value):
        raise ConfigError(f"{argument}={value!r} must be a list of texts, such as {example}")


def check_game_overrides(overrides: Sequence[str]) -> None:
    """Check that all overrides change the game, which is all that an environment has.

    Raises:
        ConfigError: If one is of the seed, or of another part of the configuration.
    """
    for override in parse(overrides):
        root = root_of(override)
        if override.key_or_group == "task":
            raise ConfigError(
                f"overrides: {override.input_line!r} chooses another task; give it as the argument "
                "`task`"
            )
        if root == "seed":
            raise ConfigError(
                f"overrides: {override.input_line!r} is not of the game; give the seed as the "
                "argument `seed` (of check_task as checks=CheckCfg(seed=...))"
            )
        if root not in _ROOTS_OF_GAMES:
            raise ConfigError(
                f"overrides: {override.input_line!r} is not of the game; "
                f"choices: {', '.join(sorted(_ROOTS_OF_GAMES))}"
            )


def check_run_overrides(overrides: Sequence[str], total_frames: Any) -> None:
    """Check that no override is of an argument of `train`, or of Hydra.

    Args:
        overrides: The overrides.
        total_frames: The argument; None if it was not given.

    Raises:
        ConfigError: If one is.
    """
    given = {"task": "task", "seed": "seed", "hydra": "folder"}
    if total_frames is not None:
        given["total_frames"] = "total_frames"
    for override in parse(overrides):
        key = override.key_or_group
        argument = given.get("hydra" if key.partition(".")[0] == "hydra" else key)
        if argument is not None:
            raise ConfigError(
                f"overrides: {override.input_line!r} is chosen by the argument `{argument}`"
            )


def check_scripted(cfg: Config) -> None:
    """Check that no opponent is the policy of a run, which no environment plays.

    Raises:
        ConfigError: If one is.
    """
    for team, path in cfg.frozen.items():
        raise ConfigError(
            f"opponent.{team}={path}: an environment does not play the policy of a run; choices: "
            f"{', '.join(script.value for script in Script)}; `train` and "
            "python -m veca_marl.evaluate play it"
        )


def check_presets(argument: str, value: Any) -> None:
    """Check an argument that gives names of senses the names of presets.

    Raises:
        ConfigError: If it does not.
    """
    is_mapping = isinstance(value, Mapping)
    if not is_mapping or not all(isinstance(part, str) for pair in value.items() for part in pair):
        raise ConfigError(f'{argument}={value!r} must be a mapping, such as {{"audio": "mono"}}')


def as_integer(argument: str, value: Any) -> int:
    """Return an argument that is an integral number, such as 1e6.

    Raises:
        ConfigError: If it is none.
    """
    try:
        return operator.index(value)  # exact, also where a float has fewer digits
    except TypeError:
        pass
    try:
        number = float(value)
        if number.is_integer() and not isinstance(value, str):
            return int(number)
    except (TypeError, ValueError, OverflowError):
        pass
    raise ConfigError(f"{argument}={value!r} must be an integral number")
