"""Connections that break, servers and processes that die: it goes on, or ends with one line."""

import os
import signal
import threading
import time
from contextlib import closing

import numpy as np
import pytest
import torch
from batches import leaves
from breakable import relayed
from refusals import naming
from rollouts import digest, play
from served import gym_env, served, torchrl_env

from veca_marl.envs.adapters.torchrl.env import VecaEnv
from veca_marl.remote.channel import RemoteError
from veca_marl.remote.client import RemoteWorlds
from veca_marl.remote.games import RemoteHost
from veca_marl.remote.messages import decode

NO_ACTION = np.zeros(2, np.float32)


def processes(server):
    return [session.process for session in server._sessions.values()]


def wait_until(condition, seconds=30.0):
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.05)


def test_a_connection_that_breaks_and_comes_back_changes_no_byte(cfg, server):
    with relayed(server.address) as (relay, address):
        with closing(torchrl_env(server, 2, address=address)) as env:
            stop = threading.Event()

            def break_often():
                while not stop.wait(0.3):
                    relay.break_all()

            breaking = threading.Thread(target=break_often)
            breaking.start()
            try:
                found = digest(play(env, 30, seed=2))
            finally:
                stop.set()
                breaking.join()
        with closing(VecaEnv(cfg, 2)) as here:
            assert found == digest(play(here, 30, seed=2))


@pytest.mark.parametrize("part", [0, 1])
def test_parts_of_a_result_that_are_lost_are_sent_again(cfg, server, monkeypatch, part):
    send, lost = server._send, set()

    def lose_once(client, frames):
        answer = decode(frames, 1_000_000)
        if answer.fields.get("part") == part and answer.number not in lost:
            lost.add(answer.number)
            return True
        return send(client, frames)

    monkeypatch.setattr(server, "_send", lose_once)
    with closing(torchrl_env(server, 3)) as env:
        found = digest(play(env, 2, seed=2))
    assert len(lost) >= 3
    with closing(VecaEnv(cfg, 3)) as here:
        assert found == digest(play(here, 2, seed=2))


def test_a_client_that_was_interrupted_between_parts_goes_on(cfg, server, monkeypatch):
    with closing(torchrl_env(server, 3, seed=3)) as there, closing(VecaEnv(cfg, 3, 3)) as here:
        state = there.rand_action(there.reset())
        here.reset()
        with monkeypatch.context() as patch:
            patch.setattr(there, "_score", interrupted)
            with pytest.raises(KeyboardInterrupt):
                there.step(state)
        ours, theirs = leaves(there.reset()), leaves(here.reset())
        assert all(torch.equal(value, theirs[key]) for key, value in ours.items())


def interrupted(*_):
    raise KeyboardInterrupt


@pytest.mark.slow
def test_worlds_whose_client_does_not_come_back_are_ended(cfg):
    with served(cfg, 1, clients=1, reconnect_s=0.5) as server:
        env = torchrl_env(server, 1)
        (process,) = processes(server)
        with pytest.raises(RemoteError, match=naming("clients=1")):
            torchrl_env(server, 1)
        env._host._worlds._channel._socket.close(linger=0)  # as if its process had been killed
        wait_until(lambda: not server._sessions)
        process.join(10.0)
        assert process.exitcode is not None
        with closing(torchrl_env(server, 1)) as other:
            other.reset()


def test_a_process_that_is_killed_ends_its_client_with_one_line_and_no_other(server):
    with closing(torchrl_env(server, 1)) as other:
        others = processes(server)
        env = gym_env(server)
        env.reset()
        (own,) = [process for process in processes(server) if process not in others]
        os.kill(own.pid, signal.SIGKILL)
        for _ in range(2):
            with pytest.raises(RemoteError, match=naming("SIGKILL", server.address)):
                env.step(NO_ACTION)
        env.close()
        other.rollout(3)


def test_a_request_that_takes_too_long_ends_its_client_with_one_line(cfg):
    with served(cfg, 1, limit_s=20.0) as server:
        env = gym_env(server)
        env.reset()
        (process,) = processes(server)
        os.kill(process.pid, signal.SIGSTOP)
        object.__setattr__(server._cfg, "limit_s", 0.5)
        with pytest.raises(RemoteError, match=naming("limit_s")):
            env.step(NO_ACTION)
        env.close()


def test_a_server_that_is_stopped_says_so(cfg):
    with served(cfg, 1) as server:
        env = gym_env(server, timeout_s=2.0)
        env.reset()
    with pytest.raises(RemoteError, match=naming("stopped")):
        env.step(NO_ACTION)
    env.close()


def test_a_server_that_dies_is_given_up_after_the_time(cfg, server):
    with relayed(server.address) as (relay, address):
        env = gym_env(server, address=address, timeout_s=2.0)
        env.reset()
        relay.close()
        begin = time.monotonic()
        with pytest.raises(RemoteError, match=naming("2 s", "timeout_s", address)):
            env.step(NO_ACTION)
        assert time.monotonic() - begin < 10.0
        env.close()


def test_a_server_that_was_started_again_has_no_worlds_of_before(cfg):
    with served(cfg, 1) as server:
        address = server.address
        env = gym_env(server)
        env.reset()
        server._end = lambda *_: None  # it dies and says nothing
    for session in server._sessions.values():
        session.process.kill()
        session.line.close()
    gone = naming("gone", "started again")
    with served(cfg, 1, address=address), pytest.raises(RemoteError, match=gone):
        env.step(NO_ACTION)
    env.close()


def test_nobody_answers():
    with pytest.raises(RemoteError, match=naming("tcp://127.0.0.1:9", "0.5 s")):
        RemoteWorlds("tcp://127.0.0.1:9", timeout_s=0.5)


def test_more_worlds_than_there_are_is_an_error_with_the_number(server):
    with pytest.raises(ValueError, match=naming("worlds=4", "3")):
        torchrl_env(server, 4)


def test_games_that_changed_between_greeting_and_opening_are_refused(server):
    there = RemoteWorlds(server.address)
    there.cfg.specs.weights["kick"] = 17.0
    with pytest.raises(RemoteError, match="connect again"):
        VecaEnv(there.cfg, 1, host=RemoteHost(there))
