"""Agent steps per second through `VecaEnv.rollout`, and the part of each sense in them."""

from __future__ import annotations

import gc
import time
from dataclasses import dataclass
from statistics import median

import numpy as np
import torch
from tensordict import TensorDictBase

from veca_marl.bench.references import ReferenceView
from veca_marl.bench.stopwatch import Probes, Stopwatch, thread_ms
from veca_marl.config import compose
from veca_marl.envs.adapters.torchrl.env import VecaEnv
from veca_marl.envs.core.game import Game
from veca_marl.envs.core.game_cfg import GameCfg
from veca_marl.sim.body.walker import Walker
from veca_marl.sim.physics.bullet_client import BulletClient, pybullet

_SPHERES = 20
_STEPS = 100
_RADIUS_M = 0.1


class ReferenceWorkload:
    """PyBullet steps of falling spheres, and numpy arithmetic: the two kinds of work of a step."""

    def __init__(self) -> None:
        self._client = BulletClient()
        self._client.setGravity(0.0, 0.0, -9.81)
        sphere = self._client.createCollisionShape(pybullet.GEOM_SPHERE, radius=_RADIUS_M)
        floor = self._client.createCollisionShape(pybullet.GEOM_PLANE)
        self._client.createMultiBody(0.0, floor)
        self._spheres = [self._client.createMultiBody(1.0, sphere) for _ in range(_SPHERES)]
        self._matrix = np.random.default_rng(0).random((84, 84))

    def run_ms(self) -> float:
        """Return the milliseconds of processor time of one run; each run does the same work."""
        for number, body in enumerate(self._spheres):
            height = _RADIUS_M * (1 + 2 * number)
            self._client.resetBasePositionAndOrientation(
                body, (0.01 * (number % 2), 0.0, height), (0, 0, 0, 1)
            )
        return thread_ms(self._work)

    def _work(self) -> None:
        for _ in range(_STEPS):
            self._client.stepSimulation()
            np.tanh(self._matrix @ self._matrix)

    def close(self) -> None:
        """Disconnect from PyBullet."""
        self._client.close()


PHYSICS, SOURCES, TASK = "physics", "sound sources", "task"
ENV, POLICY, TORCHRL = "VecaEnv", "policy", "TorchRL"
_OVERHEAD = (TASK, ENV, POLICY, TORCHRL)
_WARM_UP_STEPS = 5
MOST_VIEWS_IN_A_ROOM, MOST_VIEWS_IN_A_HOUSE = 0.8, 1.2
"""Goals for the cost of an agent step of walkers, in views by TinyRenderer."""

_REFERENCE_PLAYGROUND = ("+task=KickTheBall", "playground=single_room")


@dataclass
class Rollouts:
    """Cost of rolling out one game, as medians over the repeats.

    Attributes:
        task: Name of the task.
        playground: Name of the playground.
        worlds: Worlds in the environment.
        agents: Agents in each world.
        agent_steps_per_s: Agent steps per second of processor time of the one thread.
        agent_steps_per_reference: Agent steps in the processor time of one run of
            `ReferenceWorkload`, measured in turns with the rollouts; comparable between machines.
        view_ms: Processor time of a `ReferenceView`; the median of all repeats.
        views_per_agent_step: Processor time of an agent step divided by that of a `ReferenceView`,
            measured in turns with the rollouts likewise.
        most_views_per_agent_step: The goal for it; None for joint-level bodies.
        wall_agent_steps_per_s: Agent steps per second of elapsed time.
        ms_per_part: Milliseconds of processor time per agent step for each part, with stopwatch.
        overhead: Share of the step that is neither physics nor sound sources nor senses.
        build_s: Seconds of processor time to build one more world.
    """

    task: str
    playground: str
    worlds: int
    agents: int
    agent_steps_per_s: float
    agent_steps_per_reference: float
    view_ms: float
    views_per_agent_step: float
    most_views_per_agent_step: float | None
    wall_agent_steps_per_s: float
    ms_per_part: dict[str, float]
    overhead: float
    build_s: float


@dataclass
class _Repeats:
    """Measurements of the repeats: processor and elapsed seconds, references, times by part."""

    cpu_s: list[float]
    wall_s: list[float]
    reference_s: list[float]
    view_s: list[float]
    parts_ns: list[dict[str, int]]


def measure_rollouts(game: GameCfg, worlds: int, steps: int, repeats: int) -> Rollouts:
    """Roll a game out with the same random actions, alternately with and without stopwatch.

    Args:
        game: The game.
        worlds: Number of worlds in the environment.
        steps: Steps of each rollout.
        repeats: Number of rollouts of either kind.

    Raises:
        ValueError: If no world can be made from `game`.
    """
    env = VecaEnv(game, worlds, seed=0)
    agents, goal = len(env.games[0].players), most_views(env.games[0])
    measured = _repeat(env, steps, repeats)
    env.close()
    agent_steps = steps * worlds * agents
    parts = {
        part: 1e-6 * median(split[part] for split in measured.parts_ns) / agent_steps
        for part in measured.parts_ns[0]
    }
    pairs = zip(measured.reference_s, measured.cpu_s, strict=True)
    views = zip(measured.view_s, measured.cpu_s, strict=True)
    return Rollouts(
        task=game.task.name,
        playground=game.playground.name,
        worlds=worlds,
        agents=agents,
        agent_steps_per_s=agent_steps / median(measured.cpu_s),
        agent_steps_per_reference=agent_steps * median(ref / cpu for ref, cpu in pairs),
        view_ms=1e3 * median(measured.view_s),
        views_per_agent_step=median(cpu / view for view, cpu in views) / agent_steps,
        most_views_per_agent_step=goal,
        wall_agent_steps_per_s=agent_steps / median(measured.wall_s),
        ms_per_part=parts,
        overhead=sum(parts.get(part, 0.0) for part in _OVERHEAD) / sum(parts.values()),
        build_s=_build_s(game),
    )


def most_views(game: Game) -> float | None:
    """Return the greatest cost of an agent step in views; None for joint-level bodies."""
    if not all(isinstance(player.body, Walker) for player in game.players):
        return None
    in_a_room = len(game.world.playground.rooms) == 1
    return MOST_VIEWS_IN_A_ROOM if in_a_room else MOST_VIEWS_IN_A_HOUSE


def _repeat(env: VecaEnv, steps: int, repeats: int) -> _Repeats:
    policy, reference = RandomActions(env, steps), ReferenceWorkload()
    view = ReferenceView(compose(_REFERENCE_PLAYGROUND).game.playground)
    env.rollout(_WARM_UP_STEPS, policy, break_when_any_done=False)
    measured = _Repeats([], [], [], [], [])
    for _ in range(repeats):
        wall, cpu = time.perf_counter(), time.thread_time()
        env.rollout(steps, policy, break_when_any_done=False)
        measured.cpu_s.append(time.thread_time() - cpu)
        measured.wall_s.append(time.perf_counter() - wall)
        measured.reference_s.append(1e-3 * reference.run_ms())
        measured.view_s.append(1e-3 * view.run_ms())
        measured.parts_ns.append(_split(env, policy, steps))
    reference.close()
    view.close()
    return measured


class RandomActions:
    """Uniformly random actions, drawn before the measurement so that the policy costs little.

    Args:
        env: The environment with the specs of the actions.
        steps: Number of actions drawn; they are repeated afterwards.
    """

    def __init__(self, env: VecaEnv, steps: int) -> None:
        torch.manual_seed(0)
        spec = env.full_action_spec
        self._actions = {key: [spec[key].rand() for _ in range(steps)] for key in env.action_keys}
        self._step = 0

    def __call__(self, tensordict: TensorDictBase) -> TensorDictBase:
        """Write the next action of each team."""
        for key, actions in self._actions.items():
            tensordict.set(key, actions[self._step % len(actions)])
        self._step += 1
        return tensordict


def _split(env: VecaEnv, policy: RandomActions, steps: int) -> dict[str, int]:
    """Return the nanoseconds of each part of one rollout."""
    watch = Stopwatch(rest=TORCHRL)
    with Probes(watch) as probes:
        probes.put(ENV, env, "_step", "_reset")
        for game in env.games:
            _probe_game(game, probes)
        with watch.running():
            timed = watch.wrap(POLICY, policy)
            env.rollout(steps, timed, break_when_any_done=False, trust_policy=True)
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
    """Return the seconds of processor time to build and reset the first world of a process.

    They include loading tables and kernels, and compiling kernels that are not in the cache.
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
