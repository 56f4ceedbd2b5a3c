"""Agent steps per second through `VecaEnv.rollout`, and the part of each sense in them."""

from __future__ import annotations

import gc
import time
from dataclasses import dataclass, field
from statistics import median

import torch
from tensordict import TensorDictBase

from veca_marl.bench.stopwatch import Probes, Stopwatch
from veca_marl.envs.adapters.torchrl.env import VecaEnv
from veca_marl.envs.core.game import Game
from veca_marl.envs.core.game_cfg import GameCfg

PHYSICS, SOURCES, TASK, ENV, POLICY, TORCHRL = (
    "physics",
    "sound sources",
    "task",
    "VecaEnv",
    "policy",
    "TorchRL",
)


@dataclass
class Rollouts:
    """What rolling out one game cost.

    Attributes:
        task: Its name.
        playground: Where it was played.
        worlds: Worlds in the process.
        agents: Players in each of them.
        agent_steps_per_s: By processor time of the one thread, without the stopwatch.
        wall_agent_steps_per_s: By the clock on the wall.
        ms_per_part: Milliseconds of processor time per agent step, with the stopwatch.
        other_share: Part of the step that is neither physics nor senses.
        build_s: Seconds of processor time to build one more world.
    """

    task: str
    playground: str
    worlds: int
    agents: int
    agent_steps_per_s: float
    wall_agent_steps_per_s: float
    ms_per_part: dict[str, float] = field(default_factory=dict)
    other_share: float = 0.0
    build_s: float = 0.0


def measure_rollouts(game: GameCfg, worlds: int, steps: int, repeats: int) -> Rollouts:
    """Roll a game out under the same random actions, in turns with and without the stopwatch.

    Args:
        game: What is played.
        worlds: How many of it in one environment.
        steps: Steps of each rollout.
        repeats: Rollouts of either kind; medians count.
    """
    env = VecaEnv(game, worlds, seed=0)
    agents = len(env.games[0].players)
    policy = RandomMoves(env, steps)
    env.rollout(5, policy, break_when_any_done=False)
    seconds, wall_s, splits = [], [], []
    for _ in range(repeats):
        wall, cpu = time.perf_counter(), time.thread_time()
        env.rollout(steps, policy, break_when_any_done=False)
        seconds.append(time.thread_time() - cpu)
        wall_s.append(time.perf_counter() - wall)
        splits.append(_split(env, policy, steps))
    env.close()
    agent_steps = steps * worlds * agents
    parts = {
        part: 1e-6 * median(split[part] for split in splits) / agent_steps for part in splits[0]
    }
    rest = sum(parts.get(part, 0.0) for part in (TASK, ENV, POLICY, TORCHRL))
    return Rollouts(
        task=game.task.name,
        playground=game.playground.name,
        worlds=worlds,
        agents=agents,
        agent_steps_per_s=agent_steps / median(seconds),
        wall_agent_steps_per_s=agent_steps / median(wall_s),
        ms_per_part=parts,
        other_share=rest / sum(parts.values()),
        build_s=_build_s(game),
    )


class RandomMoves:
    """Drawn beforehand, so that the policy costs next to nothing.

    Args:
        env: Who moves.
        steps: After so many steps the moves come again.
    """

    def __init__(self, env: VecaEnv, steps: int) -> None:
        torch.manual_seed(0)
        spec = env.full_action_spec
        self._moves = {key: [spec[key].rand() for _ in range(steps)] for key in env.action_keys}
        self._step = 0

    def __call__(self, tensordict: TensorDictBase) -> TensorDictBase:
        """Write each team's next move."""
        for key, moves in self._moves.items():
            tensordict.set(key, moves[self._step % len(moves)])
        self._step += 1
        return tensordict


def _split(env: VecaEnv, policy: RandomMoves, steps: int) -> dict[str, int]:
    """Return nanoseconds by part of one rollout."""
    watch = Stopwatch(rest=TORCHRL)
    with Probes(watch) as probes:
        probes.put(ENV, env, "_step", "_reset")
        for game in env.games:
            _probe_game(game, probes)
        with watch.running():
            moves = watch.wrap(POLICY, policy)
            env.rollout(steps, moves, break_when_any_done=False, trust_policy=True)
    return dict(watch.nanoseconds)


def _probe_game(game: Game, probes: Probes) -> None:
    probes.put(PHYSICS, game.world, "step", "reset", "refresh")
    probes.put(SOURCES, game.world.sound, "advance")
    probes.put(TASK, game.task, "before_step", "after_step", "reward", "terminated", "reset")
    for player in game.players:
        probes.put(PHYSICS, player.body, "act")
        for name, sense in game.senses[player.name].items():
            probes.put(name, sense, "read")


def measure_first_world(game: GameCfg) -> float:
    """Return seconds of processor time to build a world and reset it, the first of a process.

    Tables and kernels are loaded in it; kernels that are not cached are compiled in it.
    """
    start = time.thread_time()
    env = VecaEnv(game, worlds=1, seed=0)
    env.reset()
    seconds = time.thread_time() - start
    env.close()
    return seconds


def _build_s(game: GameCfg) -> float:
    gc.collect()
    start = time.thread_time()
    Game(game).close()
    return time.thread_time() - start
