"""Evaluations in several processes give what one process gives."""

import multiprocessing
import os
import re
import signal
import threading
import time
from contextlib import closing
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
import torch
from fake_env import FakeEnv, make_fake_env
from refusals import naming

from veca_marl.algos.evaluation.evaluate import Exploration
from veca_marl.algos.evaluation.evaluators import Players, Request, make_evaluator
from veca_marl.processes.supervision import Limit, WorkerError

SEVEN = Request("policy", 7, 5, Exploration.deterministic)
LIMIT = Limit(60.0, "collect.answer_limit_s")


@pytest.fixture
def policy(make_ppo):
    """A policy with actions, and returns, that differ between starts."""
    for seed in range(20):
        policy = make_ppo(seed).policy.copy()
        with torch.no_grad():
            for parameter in policy.parameters():
                parameter.mul_(3.0)
        if len(set(returns(0, policy, SEVEN)[0])) > 1:
            return policy
    raise AssertionError("20 policies with the same action in each state")


def returns(processes, policy, *requests, make_env=make_fake_env):
    players = Players(policy, ("agents",))
    with closing(make_evaluator(make_env, players, 2, processes, 4, LIMIT)) as evaluator:
        return [evaluator.play(request)["agents"].returns for request in requests]


def test_several_processes_play_the_same_episodes_in_the_same_order(policy):
    random = Request("random", 7, 5, Exploration.deterministic)
    sampled = replace(SEVEN, exploration=Exploration.stochastic)
    scores = [returns(processes, policy, SEVEN, random, sampled) for processes in (0, 1, 2)]
    np.testing.assert_array_equal(scores[0], scores[1])
    np.testing.assert_array_equal(scores[0], scores[2])
    alone, by_chance, _ = scores[0]
    assert len(set(alone)) > 1
    assert (by_chance != alone).any()


def test_new_parameters_reach_the_processes(policy):
    players = Players(policy, ("agents",))
    with closing(make_evaluator(make_fake_env, players, 2, 2, 4, LIMIT)) as evaluator:
        before = evaluator.play(SEVEN)["agents"].returns
        with torch.no_grad():
            for parameter in policy.parameters():
                parameter.zero_()
        after = evaluator.play(SEVEN)["agents"].returns
    assert (before != after).any()
    np.testing.assert_array_equal(after, returns(0, policy, SEVEN)[0])


def test_a_process_that_is_killed_is_noticed_at_once(policy):
    def wait():
        for _ in range(100):
            time.sleep(0.1)

    players = Players(policy, ("agents",))
    with closing(make_evaluator(make_fake_env, players, 2, 2, 4, LIMIT)) as evaluator:
        evaluator.play(SEVEN)
        multiprocessing.active_children()[0].kill()
        with pytest.raises(WorkerError, match=r"evaluation process [01] .*SIGKILL"):
            wait()
    assert not multiprocessing.active_children()


class Waiting(FakeEnv):
    """Begins episodes only after an event."""

    def __init__(self, worlds, seed, event):
        self.event = event
        super().__init__(worlds, seed)

    def _reset(self, td=None, **options):
        if not self.event.wait(20.0):
            raise TimeoutError("the event has not occurred")
        return super()._reset(td, **options)


@pytest.mark.parametrize("processes", [0, 2])
def test_other_work_is_done_while_processes_play_and_before_this_one_does(policy, processes):
    event = multiprocessing.Event()
    players = Players(policy, ("agents",))
    make_env = partial(Waiting, event=event)
    with closing(make_evaluator(make_env, players, 2, processes, 4, LIMIT)) as evaluator:
        assert len(evaluator.play(SEVEN, event.set)["agents"].returns) == 7


class Failing(FakeEnv):
    def _step(self, td):
        raise ArithmeticError("a force is not finite")


def make_failing(worlds, seed):
    return Failing(worlds, seed)


class Killed(FakeEnv):
    def _step(self, td):
        os.kill(os.getpid(), signal.SIGKILL)


def make_killed(worlds, seed):
    return Killed(worlds, seed)


@pytest.mark.parametrize(
    ("make_env", "message"),
    [
        (make_failing, "evaluation process [01] .*: ArithmeticError: a force is not finite"),
        (make_killed, "evaluation process [01] .*SIGKILL"),
    ],
)
def test_a_process_that_fails_ends_the_evaluation(policy, make_env, message):
    with pytest.raises(WorkerError, match=message):
        returns(2, policy, SEVEN, make_env=make_env)


def stop_one():
    """Stop a process without ending it."""
    processes = sorted(multiprocessing.active_children(), key=lambda process: process.pid)
    os.kill(processes[1].pid, signal.SIGSTOP)


def check_that_it_ends(action, seconds):
    """Check that the time of an action is limited; a thread would be left behind if it is not."""
    thread = threading.Thread(target=action, daemon=True)
    thread.start()
    thread.join(seconds)
    assert not thread.is_alive()


HANGS = naming("evaluation process 1 ", " 2 s ", "collect.answer_limit_s")


@pytest.mark.slow
def test_a_process_that_hangs_is_named_and_killed(policy):
    players = Players(policy, ("agents",))
    raised = []

    def play():
        try:
            evaluator.play(SEVEN)
        except WorkerError as error:
            raised.append(str(error))

    with closing(
        make_evaluator(make_fake_env, players, 2, 2, 4, replace(LIMIT, seconds=2.0))
    ) as evaluator:
        evaluator.play(SEVEN)
        stop_one()
        check_that_it_ends(play, 12.0)
    assert re.match(HANGS, *raised)
    assert not multiprocessing.active_children()


@pytest.mark.slow
def test_an_evaluator_with_a_process_that_hangs_can_be_closed(policy):
    evaluator = make_evaluator(make_fake_env, Players(policy, ("agents",)), 2, 2, 4, LIMIT)
    evaluator.play(SEVEN)
    stop_one()
    check_that_it_ends(evaluator.close, 12.0)
    assert not multiprocessing.active_children()


class Slow(FakeEnv):
    """Takes longer for an episode than the time limit, but not for a step."""

    def _step(self, td):
        time.sleep(0.5)
        return super()._step(td)


def make_slow(worlds, seed):
    return Slow(worlds=worlds, seed=seed)


@pytest.mark.slow
def test_an_evaluation_that_takes_longer_than_the_limit_is_not_ended(policy):
    with closing(
        make_evaluator(
            make_slow, Players(policy, ("agents",)), 2, 2, 4, replace(LIMIT, seconds=2.0)
        )
    ) as evaluator:
        begin = time.monotonic()
        assert len(evaluator.play(SEVEN)["agents"].returns) == 7
        assert time.monotonic() - begin > 4.0
