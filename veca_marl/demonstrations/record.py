"""Recording: episodes that experts play, by any number of processes, in the same bytes."""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence
from contextlib import closing
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torchrl.data import TensorSpec
from torchrl.envs.utils import step_mdp
from tqdm import tqdm

from veca_marl.algos.collection.experience import start_method
from veca_marl.algos.demonstration_files import (
    ACTION,
    END,
    OUTCOME,
    STATE,
    Array,
    Card,
    Episode,
    plain_json,
)
from veca_marl.algos.files import write_errors
from veca_marl.algos.specs import team_specs
from veca_marl.config import ConfigError, one_line
from veca_marl.demonstrations.episode_files import Archive, EpisodeWriter
from veca_marl.envs.adapters.torchrl.env import VecaEnv
from veca_marl.envs.adapters.torchrl.scripted import ExpertPolicy
from veca_marl.envs.core.benchmark import parameters
from veca_marl.envs.core.game_cfg import GameCfg
from veca_marl.envs.core.task import SOLVED
from veca_marl.plugins import load_plugins
from veca_marl.processes.pool import ProcessPool
from veca_marl.runs.demonstrations import team_forms

_THREADS = 1


@dataclass(frozen=True)
class Recording:
    """What is recorded.

    Attributes:
        game: The game; teams that it scripts are part of the world.
        episodes: Number of episodes.
        seed: Seed of the episodes.
        plugins: Packages that the game needs.
    """

    game: GameCfg
    episodes: int
    seed: int
    plugins: tuple[str, ...] = ()


def row_arrays(env: VecaEnv) -> tuple[Array, ...]:
    """Return the arrays of a row of what is recorded in an environment, in a fixed order."""
    arrays = []
    for role, spec in (
        (STATE, env.full_observation_spec),
        (ACTION, env.full_action_spec),
        (OUTCOME, env.full_reward_spec),
        (OUTCOME, env.full_done_spec),
    ):
        leaves: dict[Any, TensorSpec] = dict(spec.items(True, True))
        for key in sorted((key if isinstance(key, tuple) else (key,)) for key in leaves):
            leaf = spec[key]
            own = OUTCOME if key[1:2] == ("info",) else role
            dtype = str(leaf.dtype).removeprefix("torch.")
            arrays.append(Array(key, tuple(leaf.shape[1:]), dtype, own))
    arrays.append(Array((END,), (), "bool", OUTCOME))
    return tuple(arrays)


def make_card(recording: Recording, provenance: dict[str, Any]) -> Card:
    """Return the card of a recording that has not begun; one world is made for it.

    Raises:
        ConfigError: If the game is impossible, or no expert can play it.
    """
    try:
        with closing(VecaEnv(recording.game, 1, recording.seed)) as env:
            ExpertPolicy(env)
            arrays, specs = row_arrays(env), team_specs(env)
    except ValueError as error:
        raise ConfigError(one_line(error)) from error
    return Card(
        task=recording.game.task.name,
        seed=recording.seed,
        episodes=recording.episodes,
        complete=False,
        control_rate_hz=recording.game.clock.control_rate_hz,
        teams=team_forms(recording.game, specs),
        arrays=arrays,
        checksum="",
        more={
            "game": plain_json(parameters(recording.game)),
            "player": "expert",
            "provenance": provenance,
        },
    )


@dataclass(frozen=True)
class Request:
    """An episode that is to be recorded.

    Attributes:
        number: Its number.
        folder: Folder for its files.
    """

    number: int
    folder: Path


class Recorder:
    """Plays episodes and writes them, each in a new world.

    Making a world takes a tenth of a second or less. What Bullet keeps of the contacts of earlier
    episodes can, in long ones, change the last digits of later ones; the bytes of an episode would
    then depend on which process had played which others.

    Args:
        recording: What is recorded.
        count_step: Called after each step.
    """

    def __init__(self, recording: Recording, count_step: Callable[[], None]) -> None:
        torch.set_num_threads(_THREADS)
        load_plugins(recording.plugins)
        self._recording, self._count_step = recording, count_step

    def __call__(self, request: Request) -> Episode:
        """Play and write an episode; its rows are counted from 0."""
        seed = self._recording.seed
        env = VecaEnv(self._recording.game, 1, seed, first_world=request.number)
        with closing(env), write_errors(request.folder):
            return self._play(env, EpisodeWriter(request.folder, row_arrays(env)))

    def _play(self, env: VecaEnv, writer: EpisodeWriter) -> Episode:
        policy = ExpertPolicy(env)
        returns = dict.fromkeys(env.group_map, 0.0)
        state, done = env.reset(), False
        while not done:
            step = env.step(policy(state))
            writer.add(step)
            following = step["next"]
            for team in returns:
                returns[team] += float(following[team, "reward"].double().mean())
            done = bool(following["done"])
            state = step_mdp(step)
            self._count_step()
        solved = {
            team: float(following[team, "info", SOLVED].double().mean())
            for team in env.group_map
            if SOLVED in following[team, "info"].keys()  # noqa: SIM118  a TensorDict
        }
        return Episode(0, writer.steps, writer.end(following), returns, solved)


def record(recording: Recording, archive: Archive, processes: int, bar: bool = True) -> Card:
    """Record the episodes that are missing and return the card.

    Args:
        recording: What is recorded.
        archive: Where it is stored; it has begun.
        processes: Processes that play; 0 plays in this one.
        bar: Whether to show a progress bar.
    """
    first = len(archive.episodes)
    requests = [Request(n, archive.part(n)) for n in range(first, recording.episodes)]
    with closing(_answers(recording, requests, processes)) as answers:
        waiting: dict[int, Episode] = {}
        with tqdm(
            total=recording.episodes, initial=first, unit="episode", disable=None if bar else True
        ) as shown:
            for number, episode in answers:
                waiting[number] = episode
                while (following := len(archive.episodes) - first) in waiting:
                    archive.append(waiting.pop(following))
                    shown.update()
    return archive.finish(summary(archive.episodes))


def _answers(
    recording: Recording, requests: Sequence[Request], processes: int
) -> Generator[tuple[int, Episode], None, None]:
    if not requests:
        return
    if processes == 0:
        recorder = Recorder(recording, lambda: None)
        for number, request in enumerate(requests):
            yield number, recorder(request)
        return
    pool = ProcessPool(
        "recording process",
        partial(Recorder, recording),
        min(processes, len(requests)),
        method=start_method(_THREADS),
    )
    with closing(pool):
        yield from pool.answers(requests)


def summary(episodes: Sequence[Episode]) -> dict[str, Any]:
    """Return what a card says of all episodes."""
    teams = episodes[0].returns if episodes else {}
    return {
        "steps": sum(episode.steps for episode in episodes),
        "teams": {
            team: {
                "mean_return": float(np.mean([e.returns[team] for e in episodes])),
                "deviation": float(np.std([e.returns[team] for e in episodes])),
                **(
                    {"solved": float(np.mean([e.solved[team] for e in episodes]))}
                    if team in episodes[0].solved
                    else {}
                ),
            }
            for team in teams
        },
    }
