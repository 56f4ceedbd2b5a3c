"""Servers of worlds in a thread of the test, and the environments that connect to them."""

import threading
from contextlib import closing, contextmanager

from veca_marl.envs.adapters.gymnasium import VecaGymEnv
from veca_marl.envs.adapters.pettingzoo import VecaParallelEnv
from veca_marl.envs.adapters.torchrl.env import VecaEnv
from veca_marl.envs.core.game import Game
from veca_marl.remote.client import RemoteWorlds
from veca_marl.remote.description import GameSpecs
from veca_marl.remote.games import RemoteHost
from veca_marl.remote.server import Server, ServerCfg
from veca_marl.remote.worker import WorldsCfg

ANY_PORT = "tcp://127.0.0.1:*"


@contextmanager
def served(cfg, worlds=2, keys=None, address=ANY_PORT, plugins=(), configuration="", **changes):
    """Serve a game in a thread; yield the server."""
    with closing(Game(cfg)) as game:
        specs = GameSpecs.of(game, configuration)
    chosen = ServerCfg(address, worlds, **changes)
    with closing(Server(chosen, WorldsCfg(cfg, plugins), specs, keys)) as server:
        stop = threading.Event()
        thread = threading.Thread(target=server.run, args=(lambda: not stop.is_set(),))
        thread.start()
        try:
            yield server
        finally:
            stop.set()
            thread.join()


def torchrl_env(server, worlds=2, seed=0, address=None, **how):
    there = RemoteWorlds(address or server.address, **how)
    return VecaEnv(there.cfg, worlds, seed, host=RemoteHost(there))


def parallel_env(server, seed=0, **how):
    there = RemoteWorlds(server.address)
    return VecaParallelEnv(there.cfg, seed, host=RemoteHost(there), **how)


def gym_env(server, seed=0, address=None, timeout_s=60.0, **how):
    there = RemoteWorlds(address or server.address, timeout_s=timeout_s)
    return VecaGymEnv(there.cfg, seed, host=RemoteHost(there), **how)
