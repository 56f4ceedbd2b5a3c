"""The laws of every task are tested with each task and each kind of action.

All laws of a task share one environment, which a session builds once: a law seeds it first.
"""

import pytest
from rollouts import KINDS, SHORT, game_cfg, play

from veca_marl.envs.adapters.torchrl.env import VecaEnv
from veca_marl.envs.core.game import Game
from veca_marl.envs.core.task import TASKS

# tasks that the quick suite plays also with a body that is not their own: walkers, joints, two
# teams, voices; the slow suite does with all
WITH_OTHER_BODY = ("KickTheBall", "TurnBaby", "PushOut1v1", "MultiAgentNav")
# games of several joint-level bodies with eyes and skin, which the quick suite plays with walkers
WITH_WALKERS = ("PushOut2v2", "SoccerTwoPlayer")
# tasks that the quick suite plays with every adapter and with extreme actions: besides those above
# one with hands, one with verbs and doors, and one of another suite
WITH_EVERY_ADAPTER = (*WITH_OTHER_BODY, "GrabObject", "BabyzumasRevenge", "HandRegard")
# those in which it asks experts for labels: of a path, by hearing, of gaits, stages and a script
LABELLED = ("ObjectNav", "KickTheBall", "CrawlBaby", "SitBaby", "PushOut1v1", "GrabObject")
# those that it plays in the worlds of a server: one agent, two teams with joints, several agents
ON_A_SERVER = ("KickTheBall", "PushOut1v1", "MultiAgentNav")
NARROW = {
    "test_every_adapter": WITH_EVERY_ADAPTER,
    "test_every_adapter_remotely": ON_A_SERVER,
    "test_every_label": LABELLED,
    "test_every_snapshot": WITH_EVERY_ADAPTER,
    "test_every_task_robustly": WITH_EVERY_ADAPTER,
    "test_every_task_with_bodies": WITH_EVERY_ADAPTER,
}
WORLDS, STEPS = 2, 25


def pytest_generate_tests(metafunc):
    """Give a test each task, and each kind of action if it depends on `kind`."""
    narrow = NARROW.get(metafunc.module.__name__.rpartition(".")[2])
    if "kind" in metafunc.fixturenames:
        pairs = [_pair(task, kind, narrow) for task in sorted(TASKS) for kind in KINDS]
        metafunc.parametrize(("task", "kind"), pairs, scope="session")
    elif "task" in metafunc.fixturenames:
        tasks = [_one(task, narrow) for task in sorted(TASKS)]
        metafunc.parametrize("task", tasks, scope="session")


def _pair(task, kind, narrow):
    quick = task in WITH_OTHER_BODY or (kind == "own") != (task in WITH_WALKERS)
    quick = quick and (narrow is None or (kind == "own" and task in narrow))
    return pytest.param(task, kind, marks=() if quick else pytest.mark.slow)


def _one(task, narrow):
    quick = narrow is None or task in narrow
    return pytest.param(task, marks=() if quick else pytest.mark.slow)


@pytest.fixture(scope="session")
def cfg(task, kind):
    """The game with short episodes, and with the state of the simulator among the data."""
    return game_cfg(task, kind, SHORT, "global_state=true")


@pytest.fixture(scope="session")
def env(cfg):
    env = VecaEnv(cfg, WORLDS, seed=0)
    yield env
    env.close()


@pytest.fixture(scope="session")
def rollout(env):
    return play(env, STEPS, seed=1)


@pytest.fixture(scope="session")
def own_game(task):
    """The game of a task with its own body; a law resets it first."""
    game = Game(game_cfg(task))
    yield game
    game.close()
