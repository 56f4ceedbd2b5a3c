"""Worker processes compile the kernels of a game while it is played for the first time."""

import json
import os
import pickle
import subprocess
import sys

import numba
import pytest
from composed import compose

from veca_marl.envs.core import compile_ahead
from veca_marl.envs.core.compile_ahead import CompileWorkers, play_in_another_order
from veca_marl.envs.core.game import Game
from veca_marl.sim.kernel_cache import take_lock


class Started:
    """In place of the function that starts a worker; each holds its lock until `end`."""

    def __init__(self):
        self.messages, self._locks = [], []

    def __call__(self, packed, lock):
        self.messages.append(pickle.loads(packed))
        self._locks.append(os.dup(lock))

    def end(self):
        for lock in self._locks:
            os.close(lock)
        self._locks.clear()


@pytest.fixture
def started(monkeypatch, tmp_path):
    made = Started()
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path))
    monkeypatch.setattr(compile_ahead, "_start", made)
    yield made
    made.end()


def game(*overrides):
    return compose(["+task=MazeNav", *overrides]).game


@pytest.mark.parametrize(("cores", "count"), [(1, 0), (2, 1), (3, 2), (64, 3)])
def test_one_worker_for_each_further_core_and_no_more_than_there_are_kinds_of_senses(
    started, monkeypatch, cores, count
):
    monkeypatch.setattr(compile_ahead, "usable_cores", lambda: cores)
    cfg = game()
    CompileWorkers(cfg)()
    assert started.messages == [(number, cfg) for number in range(count)]


def test_where_others_are_at_work_no_worker_is_started(started, monkeypatch):
    monkeypatch.setattr(compile_ahead, "usable_cores", lambda: 4)
    CompileWorkers(game())()
    CompileWorkers(game())()
    assert len(started.messages) == 3
    started.end()
    CompileWorkers(game())()
    assert len(started.messages) == 6


def test_a_lock_is_held_until_all_copies_are_closed(monkeypatch, tmp_path):
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path))
    lock = take_lock("somewhere")
    copy = os.dup(lock)
    os.close(lock)
    assert take_lock("somewhere") is None
    os.close(copy)
    again = take_lock("somewhere")
    assert again is not None
    os.close(again)


def test_without_a_cache_no_worker_is_started(started, monkeypatch):
    monkeypatch.setattr(numba.config, "CACHE_DIR", os.devnull)
    monkeypatch.setattr(compile_ahead, "usable_cores", lambda: 4)
    CompileWorkers(game())()
    assert not started.messages


def test_what_cannot_be_packed_is_left_to_this_process(started, monkeypatch, caplog):
    class Local:
        pass

    monkeypatch.setattr(compile_ahead, "usable_cores", lambda: 2)
    CompileWorkers(Local())()
    assert not started.messages
    assert "Local" in caplog.text


@pytest.mark.parametrize("number", range(3))
def test_every_sense_is_read_once_and_another_one_is_first(monkeypatch, number):
    read, observe = [], Game.observe

    def note(self, player, names=None):
        read.extend(names)
        return observe(self, player, names)

    monkeypatch.setattr(Game, "observe", note)
    cfg = compose(["+task=KickTheBall"]).game
    play_in_another_order(cfg, number)
    plain = read[-number:] + read[:-number] if number else read
    game = Game(cfg)
    assert plain == list(reversed(game.senses[game.players[0].name]))
    game.close()


PROGRAM = """
import json, sys
import veca_marl
from veca_marl.sim.vision.renderer import render_views
from veca_marl.sim.sound.signal_paths import read_moving
veca_marl.make("KickTheBall").rollout(1)
kernels = (render_views, read_moving)
json.dump([sum(k.stats.cache_misses.values()) for k in kernels], sys.stdout)
"""


@pytest.mark.slow
def test_a_worker_compiles_what_this_one_needs_last(tmp_path):
    """Eyes are read first here and last there; what is heard is the other way round."""
    cache = {"NUMBA_CACHE_DIR": str(tmp_path), "VECA_MARL_CORES": "2"}
    words = [sys.executable, "-c", PROGRAM]
    done = subprocess.run(words, env=os.environ | cache, capture_output=True, text=True, check=True)
    eyes, ears = json.loads(done.stdout)
    assert eyes == 1
    assert ears == 0
