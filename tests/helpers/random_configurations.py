"""Random configurations of games: presets with values that are changed to odd ones."""

import json
import random
from functools import cache

import torch
from omegaconf import DictConfig, ListConfig, OmegaConf

import veca_marl
from veca_marl.config import ConfigError, compose_node, to_config
from veca_marl.config.stored import change
from veca_marl.envs.adapters.torchrl.env import VecaEnv
from veca_marl.plugins import conf_dir

HOSTILE = ["0", "-1", "-0.5", "1e-9", "1e9", "1e308", "nan", "inf", "-inf", "abc", "null", "true"]
HOSTILE += ["[]", "[1]", "[0,0,0]", "[nan,1,1]", "[-1,-1,-1]", "{}", "{a:1}", "''", "1e-300"]
HOSTILE += ["100000", "2147483648", "9223372036854775808", "'../../etc/passwd'"]
GROUPS = ["task"] * 4 + ["playground"] * 2 + ["body"] * 2 + ["senses"] * 3 + ["clock"]
SENSES = ("vision", "audio", "proprioception", "touch")
STEPS = 5


@cache
def names(group):
    return sorted(path.stem for path in (conf_dir() / group).glob("*.yaml"))


@cache
def values(group, preset):
    """Return the keys and values of a group; None for the value of a group in it."""
    task = preset if preset and group == "task" else "+task=KickTheBall"
    node = compose_node([task, *([preset] if preset and group != "task" else [])])
    found = []

    def walk(inner, path):
        for key in inner:
            value = inner._get_node(key)
            name = f"{path}.{key}"
            if isinstance(value, DictConfig) and not value._is_none():
                found.append((name, None))
                walk(value, name)
            elif isinstance(value, ListConfig):
                found.append((name, OmegaConf.to_container(value)))
            else:
                found.append((name, value._value()))

    walk(node[group], group)
    return found


def draw(rng: random.Random):
    """Return overrides: a task, presets, and up to three values that are changed."""
    presets = draw_presets(rng)
    return [*presets, *draw_changes(rng, presets)]


def draw_presets(rng: random.Random):
    """Return overrides that choose a task, and presets of some groups."""
    overrides = [f"+task={rng.choice(names('task'))}"]
    for group, chance in (("body", 0.6), ("playground", 0.5), ("clock", 0.15)):
        if rng.random() < chance:
            overrides.append(f"{group}={rng.choice(names(group))}")
    for sense in SENSES:
        if rng.random() < 0.35:
            overrides.append(f"senses/{sense}={rng.choice(names(f'senses/{sense}'))}")
    return overrides


def draw_changes(rng: random.Random, presets, counts=(0, 1, 1, 1, 1, 2, 2, 3)):
    """Return overrides of values below presets; as many as one of `counts`, or fewer."""
    changes = []
    for _ in range(rng.choice(counts)):
        group = rng.choice(GROUPS)
        start = "+task=" if group == "task" else f"{group}="
        preset = next((text for text in presets if text.startswith(start)), None)
        try:
            changes.append(changed_value(rng, *rng.choice(values(group, preset))))
        except ConfigError:  # the preset does not fit KickTheBall
            continue
    return changes


def changed_value(rng, key, value):
    """Return an override of one value: scaled, or any of `HOSTILE`."""
    is_number = isinstance(value, (int, float)) and not isinstance(value, bool)
    if is_number and rng.random() < 0.45:
        scaled = value * rng.choice([0.5, 2, 10, 0.1, -1, 0.0, 100, 1000])
        return f"{key}={int(scaled) if isinstance(value, int) else scaled}"
    is_vector = (
        isinstance(value, list) and value and all(isinstance(x, (int, float)) for x in value)
    )
    if is_vector and rng.random() < 0.5:
        scaled = [x * rng.choice([0.5, 2, -1, 0, 10]) for x in value]
        if all(isinstance(x, int) for x in value):
            scaled = [int(x) for x in scaled]
        return f"{key}={json.dumps(scaled).replace(' ', '')}"
    return f"{key}={rng.choice(HOSTILE)}"


def refusal(overrides, seed):
    """Play a few random steps; return the message that refuses the configuration, or None.

    Raises:
        Exception: Any other than a refusal in one line, or values that are not finite.
    """
    options = {"senses": {}}
    others = []
    for text in overrides:
        key, _, value = text.partition("=")
        if key == "+task":
            task = value
        elif key in ("body", "playground"):
            options[key] = value
        elif key.startswith("senses/"):
            options["senses"][key.removeprefix("senses/")] = value
        else:
            others.append(text)
    return _refusal_by(
        lambda: veca_marl.make(task, worlds=1, seed=seed, overrides=others, **options)
    )


def refusal_of_changes(node, changes, seed):
    """The same for changes of a composed configuration, as `play` and `evaluate` make them.

    It takes a fraction of the time: Hydra composes nothing.
    """

    def make():
        changed = node.copy()
        change(changed, changes)
        return VecaEnv(to_config(changed).game, 1, seed)

    return _refusal_by(make)


def _refusal_by(make):
    try:
        env = make()
    except ValueError as error:  # also of a configuration
        if "\n" in str(error):
            raise
        return str(error)
    try:
        play(env)
    finally:
        env.close()
    return None


def play(env):
    """Check that all values of a few steps are finite and within their specs."""
    state = env.reset()
    check(env, state)
    for _ in range(STEPS):
        state = env.step(env.rand_action(state))["next"]
        check(env, state)
        if bool(state["done"].any()):
            state = env.reset()


def check(env, state):
    for key, value in state.items(True, True):
        if value.is_floating_point():
            assert torch.isfinite(value).all(), key
    for key in env.observation_spec.keys(True, True):
        assert env.observation_spec[key].is_in(state[key]), key
