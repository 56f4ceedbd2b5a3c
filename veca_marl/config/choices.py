"""Choices of a game: words of a command line as arguments of functions, see `veca_marl.make`."""

from __future__ import annotations

from collections.abc import Container, Mapping, Sequence
from dataclasses import fields
from typing import Any, TypedDict, Unpack

from veca_marl.config.compose import compose
from veca_marl.config.errors import ConfigError
from veca_marl.config.overrides import parse, root_of
from veca_marl.config.root import Config
from veca_marl.envs.core.game_cfg import GameCfg, Script
from veca_marl.override_text import normalised
from veca_marl.registry import unknown

# `opponent` is the configuration of `GameCfg.script`
_GAME_ROOTS = {f.name for f in fields(GameCfg)} - {"script"} | {
    "development",
    "opponent",
    "plugins",
}


class GameChoices(TypedDict, total=False):
    """Arguments that all functions for one task share; `make` describes them."""

    playground: str | None
    body: str | None
    senses: Mapping[str, str] | None
    development: float | None
    overrides: Sequence[str]
    plugins: Sequence[str]


def choose(task: str, **choices: Unpack[GameChoices]) -> GameCfg:
    """Return the configuration of the game that `make` makes.

    Raises:
        TypeError: If there is no such argument; the message lists those there are.
        ConfigError: If there is no such choice, or an override is not of the game; the message
            lists the choices there are.
    """
    check_names(choices)
    texts = chosen_overrides(task, **choices)
    check_overrides(choices.get("overrides", ()), {"task": "task", "seed": "seed"}, _GAME_ROOTS)
    return compose_game(texts).game


def compose_game(overrides: Sequence[str]) -> Config:
    """Return the configuration in which a game is composed from the words of a command line.

    Raises:
        ConfigError: If one is not of the game, or there is no such choice.
    """
    check_overrides(overrides, {}, _GAME_ROOTS)
    cfg = compose(overrides)
    for team, path in cfg.frozen.items():
        raise ConfigError(
            f"opponent.{team}={path}: an environment does not play the policy of a run; choices: "
            f"{', '.join(script.value for script in Script)}; `train` and "
            "python -m veca_marl.evaluate play it"
        )
    return cfg


def check_names(choices: Mapping[str, object]) -> None:
    """Raise `TypeError` for an argument that does not exist; the message lists those there are."""
    names = list(GameChoices.__annotations__)
    for name in choices.keys() - names:
        raise TypeError(
            f"{unknown('argument', name, names)}; further words of the command line are "
            'overrides=["KEY=VALUE"]'
        )


def chosen_overrides(
    task: str,
    *,
    playground: str | None = None,
    body: str | None = None,
    senses: Mapping[str, str] | None = None,
    development: float | None = None,
    overrides: Sequence[str] = (),
    plugins: Sequence[str] = (),
) -> list[str]:
    """Return choices as the overrides of a command line.

    Raises:
        ConfigError: If one is not of the type that `GameChoices` states.
    """
    check_list("plugins", plugins, '["my_tasks"]')
    check_list("overrides", overrides, '["task.life_s=4.0"]')
    if not isinstance(senses or {}, Mapping):
        raise ConfigError(f'senses={senses!r} must be a mapping, such as {{"audio": "mono"}}')
    named = {"playground": playground, "body": body}
    named |= {f"senses/{sense}": preset for sense, preset in (senses or {}).items()}
    chosen = {"+task": task} | {key: value for key, value in named.items() if value is not None}
    for key, value in chosen.items():
        if not isinstance(value, str):
            raise ConfigError(f"{key.lstrip('+')}={value!r} must be a name, as text")
    if development is not None:
        chosen["development"] = str(development)
    packages = [f"plugins=[{','.join(plugins)}]"] if plugins else []
    return [*(f"{key}={value}" for key, value in chosen.items()), *packages, *overrides]


def check_list(argument: str, value: Any, example: str) -> None:
    """Check an argument that is a list of texts; one text alone would be read letter by letter.

    Raises:
        ConfigError: If it is another thing.
    """
    is_list = isinstance(value, Sequence) and not isinstance(value, str)
    if not is_list or not all(isinstance(entry, str) for entry in value):
        raise ConfigError(f"{argument}={value!r} must be a list of texts, such as {example}")


def check_overrides(
    overrides: Sequence[str], arguments: Mapping[str, str], roots: Container[str] | None = None
) -> None:
    """Check that overrides leave out what arguments choose.

    Args:
        overrides: The overrides.
        arguments: Key of the configuration, or `hydra`, to the argument that chooses it.
        roots: Roots of keys that can be changed; None is all others.

    Raises:
        ConfigError: If one does not, or is of another root.
    """
    for text, override in zip(overrides, parse(normalised(overrides)), strict=True):
        key, root = override.key_or_group, root_of(override)
        if argument := arguments.get(root if root == "hydra" else key):
            raise ConfigError(f"overrides: {text!r} is chosen by the argument `{argument}`")
        if roots is not None and root not in roots:
            raise ConfigError(
                f"overrides: {text!r} is not of the game; choices: {', '.join(sorted(_GAME_ROOTS))}"
            )
