"""Worker processes that end too early, and the end of the process that started them."""

import itertools
import multiprocessing
import multiprocessing.process
import os
import signal
import subprocess
import sys
import threading
import time
from functools import partial

import pytest
from fake_env import FakeEnv, make_fake_env
from paths import HELPERS, ROOT
from refusals import naming

from veca_marl.algos.collection.experience import CollectCfg, Experience, start_method
from veca_marl.processes.supervision import WorkerError

KILLED = naming("worker process 1 ", "SIGKILL")
STEPS = 4


class BrokenEnv(FakeEnv):
    """Raises an error at its third step."""

    def _step(self, td):
        if (self.clock == 2).any():
            raise ValueError("the ball has left the room")
        return super()._step(td)


def make_broken_env(worlds, seed):
    return BrokenEnv(worlds=worlds, seed=seed)


class UnbuildableEnv(FakeEnv):
    def __init__(self, worlds, seed):
        raise ValueError("no world without a floor")


@pytest.fixture
def start(make_ppo):
    made = []

    def start(make_env=make_fake_env, steps=STEPS, **numbers):
        policy = make_ppo(senses=("audio",)).policy.copy()
        cfg = CollectCfg(2, worlds=1, steps=steps, **numbers, processes=2)
        made.append(Experience(make_env, policy.collect, cfg))
        return made[-1]

    yield start
    for experience in made:
        experience.close()


only_audio = partial(make_fake_env, senses=("audio",))


def pids(experience):
    return [process.pid for process in experience._collector.procs]


def end(experience, index=1, number=signal.SIGKILL):
    os.kill(pids(experience)[index], number)


def check_that_none_is_left(processes):
    for pid in processes:
        with pytest.raises(ProcessLookupError):
            os.kill(pid, 0)


def test_a_worker_killed_while_it_collects_is_named_at_once(start):
    experience = start(only_audio, steps=100_000)
    experience.restart(0)
    processes = pids(experience)
    threading.Timer(0.2, end, [experience]).start()
    begin = time.monotonic()
    with pytest.raises(WorkerError, match=KILLED):
        experience.collect()
    experience.close()
    assert time.monotonic() - begin < 3.0
    check_that_none_is_left(processes)


def test_a_worker_killed_during_other_work_interrupts_it(start):
    experience = start(only_audio)
    begin = time.monotonic()
    end(experience)
    with pytest.raises(WorkerError, match=KILLED):
        time.sleep(10.0)  # in place of learning or an evaluation
    assert time.monotonic() - begin < 3.0


@pytest.mark.slow
@pytest.mark.parametrize("use", ["update_policy", "restart", "collect"])
def test_without_the_signal_every_call_raises_an_error(start, use):
    """In threads other than the main one Python calls no signal handlers."""
    experience = start(only_audio)
    signal.signal(signal.SIGCHLD, signal.SIG_DFL)  # `close` restores that of before
    end(experience)
    with pytest.raises(WorkerError, match=KILLED):
        getattr(experience, use)(*([3] if use == "restart" else []))


HANGS = naming("process 1 ", " 2 s ", "collect.answer_limit_s")


@pytest.mark.slow
@pytest.mark.parametrize("use", ["update_policy", "restart", "collect"])
def test_a_worker_that_hangs_is_named_and_killed(start, use):
    """SIGSTOP stops a process without ending it."""
    experience = start(only_audio, answer_limit_s=2.0)
    experience.restart(0)
    processes = pids(experience)
    end(experience, number=signal.SIGSTOP)
    begin = time.monotonic()
    with pytest.raises(WorkerError, match=HANGS):
        getattr(experience, use)(*([3] if use == "restart" else []))
    experience.close()
    assert time.monotonic() - begin < 12.0
    check_that_none_is_left(processes)


class UnreadyEnv(FakeEnv):
    """Is never ready in the second worker process."""

    def __init__(self, worlds, seed):
        if multiprocessing.current_process().name.endswith("2"):
            time.sleep(600.0)
        super().__init__(worlds, seed, senses=("audio",))


@pytest.fixture
def in_a_new_count(monkeypatch):
    """Number the processes from 1, as in a program of its own."""
    monkeypatch.setattr(multiprocessing.process, "_process_counter", itertools.count(1))


@pytest.mark.slow
@pytest.mark.usefixtures("in_a_new_count")
def test_a_worker_that_hangs_while_it_starts_is_named_and_killed(start):
    """TorchRL waits for the first answer without limit."""
    begin = time.monotonic()
    with pytest.raises(WorkerError, match=HANGS):
        start(UnreadyEnv, answer_limit_s=2.0)
    assert time.monotonic() - begin < 12.0
    assert not multiprocessing.active_children()


def test_the_time_limit_must_be_positive():
    with pytest.raises(ValueError, match=naming("collect.answer_limit_s", "0")):
        CollectCfg(answer_limit_s=0.0)


def test_the_message_of_an_exception_in_a_worker_arrives(start):
    experience = start(partial(make_broken_env))
    experience.restart(0)
    with pytest.raises(WorkerError, match="1: ValueError: the ball has left the room"):
        experience.collect()


def test_the_message_arrives_when_no_world_can_be_made(start):
    with pytest.raises(WorkerError, match="ValueError: no world without a floor"):
        start(UnbuildableEnv)


pause_after_fork_s = [0.0]
if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_parent=lambda: time.sleep(pause_after_fork_s[0]))


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="other systems never fork")
def test_a_worker_that_ends_before_its_fork_has_returned_is_reported(start):
    """An exception that a signal handler raises within a fork is printed and dropped."""
    pause_after_fork_s[0] = 1.0
    try:
        with pytest.raises(WorkerError, match="ValueError: no world without a floor"):
            start(UnbuildableEnv)
    finally:
        pause_after_fork_s[0] = 0.0


def test_the_signal_handler_is_restored(start):
    before = signal.getsignal(signal.SIGCHLD)
    experience = start(only_audio)
    assert signal.getsignal(signal.SIGCHLD) != before
    experience.close()
    assert signal.getsignal(signal.SIGCHLD) == before


def start_script(folder, text):
    script = folder / "main_process.py"
    script.write_text(text)
    paths = os.pathsep.join([str(ROOT), str(HELPERS)])
    return subprocess.Popen(
        [sys.executable, str(script)],
        env={**os.environ, "PYTHONPATH": paths},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


@pytest.mark.slow
def test_workers_end_when_the_main_process_is_killed(tmp_path):
    main = start_script(tmp_path, MAIN_PROCESS)
    processes = [int(word) for word in main.stdout.readline().split()]
    assert len(processes) == 2
    main.kill()
    main.communicate()
    deadline = time.monotonic() + 3.0
    while any(is_running(pid) for pid in processes) and time.monotonic() < deadline:
        time.sleep(0.02)
    assert not any(is_running(pid) for pid in processes)


@pytest.fixture
def starting(tmp_path):
    """A process that starts two workers with worlds that are never built, and their ids."""
    main = start_script(tmp_path, STARTING_PROCESS)
    workers = [int(main.stdout.readline()) for _ in range(2)]
    time.sleep(0.5)  # until the main process waits for them
    yield main, workers
    main.kill()
    main.communicate()


@pytest.mark.slow
def test_a_worker_killed_while_it_starts_ends_the_program(starting):
    """TorchRL's transfer of parameters waited forever for a thread when Python ended."""
    main, workers = starting
    os.kill(workers[1], signal.SIGKILL)
    _, errors = main.communicate(timeout=20)
    assert main.returncode == 1
    assert "SIGKILL" in errors.splitlines()[-1]
    assert not any(is_running(pid) for pid in workers)


@pytest.mark.slow
@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_an_interrupt_while_workers_start_ends_the_program(starting, number, code):
    main, workers = starting
    os.kill(workers[0], signal.SIGINT)  # a terminal sends it to all processes of a command
    main.send_signal(number)
    main.communicate(timeout=20)
    assert main.returncode == code
    assert not any(is_running(pid) for pid in workers)


@pytest.mark.slow
def test_a_program_that_closes_its_workers_before_any_update_ends(tmp_path):
    """TorchRL's transfer of parameters tried to start a thread when Python ended, and waited."""
    main = start_script(tmp_path, CLOSING_PROCESS)
    try:
        _, errors = main.communicate(timeout=20)
    finally:
        main.kill()
    assert main.returncode == 0, errors


@pytest.mark.slow
def test_workers_of_several_threads_collect_beside_a_learner_of_several(tmp_path):
    """A forked worker waited forever for the threads of its parent, which a fork does not copy."""
    main = start_script(tmp_path, SEVERAL_THREADS)
    try:
        printed, errors = main.communicate(timeout=120)
    finally:
        main.kill()
    assert printed.split() == ["2", "4"], errors


@pytest.mark.skipif(sys.platform != "linux", reason="other systems never fork")
def test_workers_are_forked_only_with_one_thread():
    assert [start_method(threads) for threads in (1, 2)] == ["fork", "spawn"]


def is_running(pid):
    """Return whether a process runs; one that has ended may wait for its new parent to read it."""
    try:
        with open(f"/proc/{pid}/stat") as file:
            return file.read().rpartition(")")[2].split()[0] != "Z"
    except FileNotFoundError:
        return False


MAIN_PROCESS = """
from fake_env import make_fake_env
from torchrl.envs.utils import RandomPolicy

from veca_marl.algos.collection.experience import CollectCfg, Experience

policy = RandomPolicy(make_fake_env(1, 0).action_spec)
experience = Experience(make_fake_env, policy, CollectCfg(2, worlds=1, steps=100_000, processes=2))
print(*(process.pid for process in experience._collector.procs), flush=True)
experience.collect()
"""


STARTING_PROCESS = """
import os
import signal
import sys
import time

import torch
from fake_env import FakeEnv, make_fake_env

from veca_marl.algos.collection.experience import CollectCfg, Experience
from veca_marl.algos.ppo.ppo import PPOCfg
from veca_marl.algos.specs import team_specs
from veca_marl.algos.training.learners import TeamLearners

main = os.getpid()


def make_env(worlds, seed):
    if os.getpid() != main:
        os.write(1, f"{os.getpid()}\\n".encode())
        time.sleep(600.0)
    return make_fake_env(worlds, seed, senses=("audio",))


def end(number, frame):
    raise SystemExit(128 + number)


signal.signal(signal.SIGINT, end)
signal.signal(signal.SIGTERM, end)
specs = team_specs(FakeEnv(1, senses=("audio",)))
policy = TeamLearners(specs, PPOCfg(), torch.device("cpu")).policy.copy()
Experience(make_env, policy.collect, CollectCfg(2, worlds=1, processes=2))
"""

CLOSING_PROCESS = """
import torch
from fake_env import FakeEnv, make_fake_env

from veca_marl.algos.collection.experience import CollectCfg, Experience
from veca_marl.algos.ppo.ppo import PPOCfg
from veca_marl.algos.specs import team_specs
from veca_marl.algos.training.learners import TeamLearners



def main():
    policy = TeamLearners(team_specs(FakeEnv(1)), PPOCfg(), torch.device("cpu")).policy.copy()
    experience = Experience(make_fake_env, policy.collect, CollectCfg(2, worlds=1, processes=2))
    experience.restart(0)
    experience.close()


main()
"""


SEVERAL_THREADS = """
import torch
from fake_env import make_fake_env
from torchrl.envs.utils import RandomPolicy

from veca_marl.algos.collection.experience import CollectCfg, Experience


def compute_in_parallel():
    torch.ones(1_000_000).exp()


def make_env(worlds, seed):
    compute_in_parallel()
    return make_fake_env(worlds, seed)


if __name__ == "__main__":
    torch.set_num_threads(2)
    compute_in_parallel()
    policy = RandomPolicy(make_fake_env(2, 0).action_spec)
    cfg = CollectCfg(1, worlds=2, steps=4, threads=2, processes=1)
    experience = Experience(make_env, policy, cfg)
    print(*experience.collect().batch_size)
    experience.close()
"""
