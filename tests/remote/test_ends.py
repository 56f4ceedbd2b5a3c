"""A client gives its worlds on a server back when it ends, so that the next one has a place.

Lost connections are kept for ten minutes here: worlds that end, end because of what their client
has said.
"""

import gc
import multiprocessing
import os
import signal
import sys
import time
from contextlib import closing
from functools import partial
from importlib.util import find_spec

import pytest
from commands import train
from composed import compose
from refusals import naming
from served import served, torchrl_env
from torchrl.envs.utils import RandomPolicy

from veca_marl.algos.collection.experience import CollectCfg, Engine, Experience
from veca_marl.config import ConfigError
from veca_marl.processes.children import prepare_child
from veca_marl.processes.pool import ProcessPool
from veca_marl.remote.channel import RemoteError
from veca_marl.remote.client import RemoteWorlds
from veca_marl.runs.served_worlds import ServedGames, game_text

PLACES = 3
LONG_S = 600.0
signals = pytest.mark.skipif(sys.platform == "win32", reason="Windows has no SIGTERM")


@pytest.fixture(scope="module")
def server(cfg):
    with served(cfg, 2, clients=PLACES, reconnect_s=LONG_S) as server:
        yield server


@pytest.fixture(autouse=True)
def places_are_free_afterwards(server):
    """Check after every test that no worlds are left, which is what most of them are for."""
    yield
    end = time.monotonic() + 30.0
    while server._sessions:
        assert time.monotonic() < end, "worlds of a client that has ended are left"
        time.sleep(0.05)


def make_player(address, _):
    """A server of a pool that has worlds as long as its process lives."""
    env = ServedGames(address)(2, 0)
    return lambda steps: env.rollout(steps).shape[-1]


def test_the_processes_of_a_pool_end_their_worlds(server):
    pool = ProcessPool("playing process", partial(make_player, server.address), 2, method="fork")
    with closing(pool):
        assert dict(pool.answers([3, 4])) == {0: 3, 1: 4}
        assert len(server._sessions) == 2


def collect_some(server, batches, engine):
    """Collect with two processes that have worlds, and close them."""
    with closing(torchrl_env(server, 2)) as env:
        policy = RandomPolicy(env.full_action_spec)
    cfg = CollectCfg(2, worlds=2, steps=4, processes=2, engine=engine)
    with closing(Experience(ServedGames(server.address), policy, cfg)) as experience:
        experience.restart(0)
        for _ in range(batches):
            experience.collect()
        assert len(server._sessions) == 2


@pytest.mark.parametrize("batches", [0, 1])
def test_processes_that_collect_end_their_worlds(server, batches):
    collect_some(server, batches, Engine.processes)


@pytest.mark.slow  # a cluster
@pytest.mark.skipif(find_spec("ray") is None, reason="Ray is not installed: [ray]")
def test_actors_end_their_worlds(server):
    import ray

    try:
        collect_some(server, 1, Engine.ray)
    finally:
        ray.shutdown()


def play_for_ever(address, playing):
    prepare_child(os.getppid())
    env = ServedGames(address)(2, 0)
    while True:
        env.rollout(2)
        playing.set()


@signals
def test_a_process_that_is_ended_while_it_plays_ends_its_worlds(server):
    context = multiprocessing.get_context("fork")
    playing = context.Event()
    process = context.Process(target=play_for_ever, args=(server.address, playing), daemon=True)
    process.start()
    assert playing.wait(60.0)
    process.terminate()
    process.join(30.0)
    assert process.exitcode == -signal.SIGTERM, "its parent does not see that the signal ended it"


def fail_in_play(address):
    prepare_child(os.getppid())
    env = ServedGames(address)(2, 0)
    env.reset()
    raise RuntimeError(f"{env.batch_size} worlds, and an error")


def test_a_process_that_fails_ends_its_worlds(server):
    context = multiprocessing.get_context("fork")
    process = context.Process(target=fail_in_play, args=(server.address,), daemon=True)
    process.start()
    process.join(60.0)
    assert process.exitcode == 1


def test_an_environment_that_is_dropped_ends_its_worlds(server):
    env = torchrl_env(server, 2)
    env.rollout(2)
    del env
    gc.collect()


def test_a_client_learns_how_many_places_are_free(cfg, server):
    first = torchrl_env(server, 1)
    others = [torchrl_env(server, 1) for _ in range(PLACES - 1)]
    there = RemoteWorlds(server.address)
    assert (there.clients, there.free) == (PLACES, 0)
    with pytest.raises(RemoteError, match=naming(f"clients={PLACES}")):
        torchrl_env(server, 1)
    first.close()
    there = RemoteWorlds(server.address)
    assert (there.clients, there.free) == (PLACES, 1)
    with closing(torchrl_env(server, 1)) as another:
        another.reset()
    for env in others:
        env.close()


def test_a_run_is_refused_before_it_begins_where_places_are_missing(cfg):
    with served(cfg, 2, clients=PLACES, configuration=game_text(cfg)) as server:
        games = ServedGames(server.address)
        games.check(cfg, 2, PLACES)
        with closing(torchrl_env(server, 1)):
            with pytest.raises(ConfigError, match=naming(PLACES - 1, f"clients={PLACES}")):
                games.check(cfg, 2, PLACES)
            games.check(cfg, 2, PLACES - 1)


GAME = ("+task=KickTheBall", "playground=simple", "senses/vision=blind", "task.max_seconds=0.4")
SHORT = (
    "collect.groups=2",
    "collect.worlds=1",
    "collect.steps=16",
    "algo.minibatches=1",
    "eval.episodes=2",
    "eval.worlds=2",
    "total_frames=64",
    "threads=1",
    "device=cpu",
    "log.progress_bar=false",
    "log.video=false",
    "log.logger=[csv]",
)


@pytest.mark.slow  # two runs
def test_a_run_that_needs_all_places_begins_as_soon_as_another_has_ended(tmp_path):
    """Two processes collect, and two evaluate."""
    game = compose(GAME).game
    with served(game, 2, clients=4, reconnect_s=LONG_S, configuration=game_text(game)) as own:
        there = (f"collect.server={own.address}", "collect.processes=2")
        for number in range(2):
            run = f"hydra.run.dir={tmp_path / str(number)}"
            assert train(tmp_path, *GAME, *SHORT, *there, run) == 0
