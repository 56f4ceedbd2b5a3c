"""Demonstrations of a task of one agent as a data set of Minari, the standard of Gymnasium."""

from __future__ import annotations

import os
import warnings
from collections.abc import Iterator
from contextlib import closing, contextmanager
from copy import deepcopy
from pathlib import Path
from typing import Any

import gymnasium

from veca_marl.algos.demonstration_files import DemonstrationsError
from veca_marl.config import ConfigError
from veca_marl.demonstrations.export.agent import AgentEpisode, DemonstratedAgent

_ROOT = "MINARI_DATASETS_PATH"  # where Minari looks for data sets


def export_minari(agent: DemonstratedAgent, folder: Path, name: str | None = None) -> str:
    """Write a data set of Minari.

    Args:
        agent: The only agent of its task.
        folder: Folder of data sets, as Minari's ``MINARI_DATASETS_PATH``.
        name: Name of the data set; None is ``veca_marl/TASK/expert-v0``.

    Returns:
        The name.

    Raises:
        ModuleNotFoundError: Without the extra ``[minari]``.
        DemonstrationsError: If the task has several agents, its environment cannot be made, has
            other arrays, or the data set exists.
    """
    try:
        import minari
        from minari.data_collector.episode_buffer import EpisodeBuffer
    except ImportError as error:
        raise ModuleNotFoundError(
            "to=... of Minari needs its package: pip install 'veca_marl[minari]'", name="minari"
        ) from error
    card = agent.demonstrations.card
    name = name or f"veca_marl/{card.task}/expert-v0"
    if (folder / name).exists():
        raise DemonstrationsError(f"{folder / name} exists; choose another folder")
    spec = _environment(agent)

    def buffers() -> Iterator[EpisodeBuffer]:
        for number in range(len(agent.demonstrations)):
            episode = agent.episode(number)
            yield EpisodeBuffer(
                id=number,
                seed=card.seed,
                options={"world": number},  # see `Card.seed`
                observations=dict(episode.observations),
                actions=_actions(agent, episode),
                rewards=list(episode.rewards),
                terminations=list(episode.terminated),
                truncations=list(episode.truncated),
                infos={},
            )

    folder.mkdir(parents=True, exist_ok=True)
    with _root(folder), warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # asks for an author and an email address
        minari.create_dataset_from_buffers(
            dataset_id=name,
            buffer=buffers(),
            env=spec,
            algorithm_name="scripted expert",
            code_permalink=str(card.more.get("provenance", {}).get("commit")),
            description=f"The scripted expert of {card.task}; checksum {card.checksum}",
            data_format="arrow",
            jpeg_encoding=False,
        )
    return name


def _actions(agent: DemonstratedAgent, episode: AgentEpisode) -> Any:
    if agent.plain:
        return next(iter(episode.actions.values()))
    return dict(episode.actions)


def _environment(agent: DemonstratedAgent) -> Any:
    """Return the specification of the environment that was played, for Gymnasium.

    Raises:
        DemonstrationsError: If it has several agents, or other arrays than were recorded.
    """
    card = agent.demonstrations.card
    agents = sum(form.spec.agents for form in card.teams.values())
    if agents != 1:
        raise DemonstrationsError(
            f"{card.task} has {agents} agents, and Minari knows one; format=lerobot takes any"
        )
    words = card.more.get("provenance", {}).get("overrides", [])
    overrides = [word for word in words if not word.startswith(("+task=", "plugins="))]
    spec = deepcopy(gymnasium.spec(f"veca_marl/{card.task}-v0"))
    spec.kwargs |= {"overrides": overrides}
    try:
        with closing(gymnasium.make(spec)) as env:
            first = agent.episode(0)
            observation = {sense: rows[0] for sense, rows in first.observations.items()}
            fits = observation in env.observation_space
    except (ConfigError, ValueError) as error:
        raise DemonstrationsError(f"no environment of {card.task}: {error}") from error
    if not fits:
        raise DemonstrationsError(
            f"the environment of {card.task} with {overrides} observes other arrays than those "
            f"recorded: {', '.join(observation)}"
        )
    return spec


@contextmanager
def _root(folder: Path) -> Iterator[None]:
    """Let Minari write into a folder."""
    before = os.environ.get(_ROOT)
    os.environ[_ROOT] = str(folder.resolve())
    try:
        yield
    finally:
        if before is None:
            del os.environ[_ROOT]
        else:
            os.environ[_ROOT] = before
