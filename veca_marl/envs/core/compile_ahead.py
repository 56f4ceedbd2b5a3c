"""Worker processes that compile kernels while a game is played for the first time on a machine.

Which kernels a game needs, with which types of arguments, is known only by playing it. A worker
therefore makes the same game and reads its senses in another order. Each kernel is compiled by one
process (`veca_marl.sim.kernel_cache`), so that the process that plays finds in the cache what the
workers have compiled meanwhile.
"""

from __future__ import annotations

import gc
import logging
import os
import pickle
import subprocess
import sys
from contextlib import closing, suppress
from threading import Thread
from typing import Any

import numba
import numpy as np

from veca_marl.envs.core.game import Game, random_action
from veca_marl.envs.core.game_cfg import GameCfg
from veca_marl.processes.cores import usable_cores
from veca_marl.sim.kernel_cache import take_lock

MOST_WORKERS = 3
"""Workers at most, for eyes, ears and skin."""


class CompileWorkers:
    """Compiles the kernels of a game in worker processes, one for each core but that of this one.

    They end by themselves. What they cannot do, because the game has classes that another process
    cannot import, is left to this process.

    Args:
        cfg: The game.
    """

    def __init__(self, cfg: GameCfg) -> None:
        self._cfg = cfg
        self._most = min(usable_cores() - 1, MOST_WORKERS)

    def __call__(self) -> None:
        """Start the workers, but those that another process has started already."""
        for number in range(self._most):
            lock = take_lock(f"compile_worker_{number}")
            if lock is None:
                continue
            try:
                _start(pickle.dumps((number, self._cfg)), lock)
            except _NO_WORKER as error:
                _LOG.warning("kernels are compiled by one process alone: %s", error)
            finally:
                os.close(lock)  # the worker has a copy


_LOG = logging.getLogger(__name__)
_NO_WORKER = (OSError, pickle.PicklingError, AttributeError, TypeError)
"""Raised where no process can be started, and by pickle for classes defined in functions."""


def _start(packed: bytes, lock: int) -> None:
    settings: Any = numba.config  # numba sets its attributes at run time
    paths = {"PYTHONPATH": os.pathsep.join(sys.path), "NUMBA_CACHE_DIR": settings.CACHE_DIR}
    child = subprocess.Popen(
        [sys.executable, "-m", __name__],
        env=os.environ | paths,
        stdin=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        pass_fds=[lock],
    )
    assert child.stdin is not None
    with suppress(BrokenPipeError), child.stdin:
        child.stdin.write(packed)
    Thread(target=child.wait, daemon=True).start()  # takes its exit status when it ends


def play_in_another_order(cfg: GameCfg, number: int) -> None:
    """Make a game, read the senses of its players from the last to the first, and play one step.

    Args:
        cfg: The game.
        number: How many senses from the end are left for last.
    """
    rng = np.random.default_rng(0)
    with closing(Game(cfg)) as game:
        game.reset(rng)
        for player in game.players:
            names = list(reversed(game.senses[player.name]))
            for name in names[number:] + names[:number]:
                game.observe(player, [name])
        game.step({p.name: random_action(p.body.action_spec, rng) for p in game.actors})


if __name__ == "__main__":
    gc.disable()  # as in `CompilationNotice`
    chosen_number, chosen_cfg = pickle.load(sys.stdin.buffer)
    play_in_another_order(chosen_cfg, chosen_number)
