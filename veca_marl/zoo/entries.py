"""The entries of the zoo: what they are, and the policies in them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tensordict.nn import TensorDictModuleBase, TensorDictSequential

from veca_marl.algos.policy_files import read_policy
from veca_marl.config import Config, ConfigError
from veca_marl.envs.adapters.torchrl.env import VecaEnv
from veca_marl.policy_paths import ZOO, zoo_file, zoo_names
from veca_marl.runs.assembly import read_specs
from veca_marl.runs.run_folder import stored_actors, stored_configuration


@dataclass(frozen=True)
class Entry:
    """What is known of a policy.

    Attributes:
        name: Its name, without ``zoo/``.
        task: Name of the task.
        algorithm: Name of the algorithm of each team.
        frames: Frames of experience from which it has learnt.
        evaluation: The rows of `evaluate` for 100 episodes: of the policy and of a random one, by
            team; their return, its interval, and `solved` in a task with a goal.
        is_frozen: Whether these are the frozen episodes of the task; otherwise they are episodes of
            the game in which it has learnt.
        provenance: Overrides, commit and versions of the run.
        size: Bytes of its file.
    """

    name: str
    task: str
    algorithm: dict[str, str]
    frames: int
    evaluation: list[dict[str, Any]]
    is_frozen: bool
    provenance: dict[str, Any]
    size: int


@dataclass(frozen=True)
class Policy:
    """A policy of the zoo, with the game in which it has learnt.

    Attributes:
        entry: What is known of it.
        cfg: The configuration of its run, as changed by overrides.
        module: Writes the actions of all teams that are not scripted, as ``policy`` of
            ``env.rollout``.
    """

    entry: Entry
    cfg: Config
    module: TensorDictModuleBase

    def make(self, worlds: int = 1, seed: int | None = None) -> VecaEnv:
        """Make the environment in which it has learnt; see `veca_marl.make`."""
        return VecaEnv(self.cfg.game, worlds=worlds, seed=seed)


def load(name: str, overrides: Sequence[str] = ()) -> Policy:
    """Return a policy of the zoo.

    Args:
        name: Such as ``KickTheBall``; ``zoo/`` may stand in front.
        overrides: Changes of the game, such as ``["senses/audio=mono"]``. The policy must fit: the
            same senses in the same shapes, the same actions.

    Raises:
        ConfigError: If there is no such policy, or a change is impossible.
        CheckpointError: If the policy does not fit.
    """
    path = _path(name)
    cfg = stored_configuration(path, overrides, f"{ZOO}{name}: ")
    actors = stored_actors(cfg, path, read_specs(cfg.game))
    return Policy(read_entry(path), cfg, TensorDictSequential(*actors.values()))


def entries() -> list[Entry]:
    """Return what is known of all policies of the zoo, without loading torch modules."""
    return [read_entry(zoo_file(name)) for name in zoo_names()]


def read_entry(path: Path) -> Entry:
    """Return what the file of a policy says about it.

    Raises:
        CheckpointError: If it cannot be read.
    """
    content = read_policy(path)
    about = content["about"]
    return Entry(
        path.stem,
        content["identity"]["task"],
        {team: numbers["name"] for team, numbers in content["algorithms"].items()},
        int(about.get("frames", 0)),
        list(about.get("evaluation", [])),
        "benchmark" in about,
        dict(about.get("provenance", {})),
        path.stat().st_size,
    )


def _path(name: str) -> Path:
    try:
        return zoo_file(name.removeprefix(ZOO))
    except ValueError as error:
        raise ConfigError(str(error)) from error
