"""Ray's actors collect what worker processes collect, and end with one line if one of them fails.

Four actors on this machine. Each test waits some seconds for them to start.
"""

import os
import signal
import subprocess
import sys
import threading
import time
from functools import partial
from importlib.util import find_spec
from pathlib import Path

import pytest
import torch
from fake_env import FakeEnv, make_fake_env
from paths import HELPERS, ROOT
from refusals import naming

from veca_marl.algos.collection import experience as collection
from veca_marl.algos.collection.experience import CollectCfg, Engine, Experience, check_engine
from veca_marl.processes.supervision import WorkerError

ACTORS = 4
with_ray = pytest.mark.skipif(find_spec("ray") is None, reason="Ray is not installed: [ray]")
only_audio = partial(make_fake_env, senses=("audio",))


class SlowEnv(FakeEnv):
    """In the first actor that makes one, each step takes 0.05 s longer."""

    def __init__(self, marker, worlds, seed):
        super().__init__(worlds, seed, senses=("audio",))
        try:
            marker.touch(exist_ok=False)
            self.delay_s = 0.05
        except FileExistsError:
            self.delay_s = 0.0

    def _step(self, td):
        time.sleep(self.delay_s)
        return super()._step(td)


class BrokenEnv(FakeEnv):
    def _step(self, td):
        if (self.clock == 2).any():
            raise ValueError("the ball has left the room")
        return super()._step(td)


class UnbuildableEnv(FakeEnv):
    def __init__(self, worlds, seed):
        raise ValueError("no world without a floor")


@pytest.fixture(scope="module")
def cluster():
    """Ray on this machine, whose processes find the modules of the tests."""
    import ray

    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PYTHONPATH", os.pathsep.join([str(ROOT), str(HELPERS), *sys.path]))
        patch.setenv("RAY_USAGE_STATS_ENABLED", "0")
        patch.setenv("RAY_worker_niceness", "0")  # as in a run, see `actors`
        before = signal.getsignal(signal.SIGTERM)
        ray.init(
            "local",
            num_cpus=ACTORS,
            include_dashboard=False,
            log_to_driver=False,
        )
        signal.signal(signal.SIGTERM, before)
        yield
        ray.shutdown()


@pytest.fixture
def start(make_ppo):
    made = []

    def start(make_env=only_audio, engine=Engine.ray, steps=8, **numbers):
        policy = make_ppo(senses=("audio",)).policy.copy()
        cfg = CollectCfg(ACTORS, 1, steps, processes=ACTORS, engine=engine, **numbers)
        made.append(Experience(make_env, policy.collect, cfg))
        made[-1].policy = policy
        return made[-1]

    yield start
    for experience in made:
        experience.close()


def batches(experience):
    """Return batches before and after the parameters have changed."""
    experience.restart(3)
    experience.collect()
    first = experience.collect().clone()
    with torch.no_grad():
        for parameter in experience.policy.parameters():
            parameter.mul_(1.25)
    experience.update_policy()
    return first, experience.collect().clone()


@with_ray
@pytest.mark.slow
@pytest.mark.usefixtures("cluster")
def test_actors_collect_the_bytes_of_worker_processes_one_being_slow(start, tmp_path):
    slow = partial(SlowEnv, tmp_path / "slow")
    from_actors = batches(start(slow, Engine.ray))
    assert (tmp_path / "slow").exists()
    from_processes = batches(start(only_audio, Engine.processes))
    for ours, theirs in zip(from_actors, from_processes, strict=True):
        assert ours.batch_size == theirs.batch_size == (ACTORS, 8)
        keys = {key for key in theirs.keys(True, True) if key[0] != "collector"}
        assert keys
        assert all(torch.equal(ours[key], theirs[key]) for key in keys)


@with_ray
@pytest.mark.slow
@pytest.mark.usefixtures("cluster")
def test_an_actor_killed_while_it_collects_is_named(start):
    experience = start(steps=100_000)
    experience.restart(0)
    processes = [pid for _, pid in experience._collector.where]
    threading.Timer(0.5, os.kill, [processes[1], signal.SIGKILL]).start()
    begin = time.monotonic()
    with pytest.raises(WorkerError, match=naming("Ray actor 1 ", str(processes[1]))) as raised:
        experience.collect()
    assert "\n" not in str(raised.value)
    assert time.monotonic() - begin < 20.0
    check_that_none_is_left(processes)


@with_ray
@pytest.mark.slow
@pytest.mark.usefixtures("cluster")
@pytest.mark.parametrize("use", ["update_policy", "restart", "collect"])
def test_an_actor_that_hangs_is_named_and_killed(start, use):
    experience = start()
    experience.restart(0)
    experience._collector._limit = CollectCfg(answer_limit_s=2.0).limit  # not for its start
    processes = [pid for _, pid in experience._collector.where]
    os.kill(processes[1], signal.SIGSTOP)
    with pytest.raises(WorkerError, match=naming("actor 1 ", " 2 s ", "collect.answer_limit_s")):
        getattr(experience, use)(*([3] if use == "restart" else []))
    check_that_none_is_left(processes)


@with_ray
@pytest.mark.slow
@pytest.mark.usefixtures("cluster")
def test_the_message_of_an_exception_in_an_actor_arrives(start):
    experience = start(BrokenEnv)
    experience.restart(0)
    with pytest.raises(WorkerError, match=r"ValueError: the ball has left the room$"):
        experience.collect()
    with pytest.raises(WorkerError, match=r"ValueError: no world without a floor$"):
        start(UnbuildableEnv)


@with_ray
@pytest.mark.slow
@pytest.mark.usefixtures("cluster")
def test_a_cluster_with_too_few_cores_is_refused(start):
    with pytest.raises(WorkerError, match=naming("8 cores", "has 4")):
        start(threads=2)


def check_that_none_is_left(processes):
    deadline = time.monotonic() + 20.0
    while any(Path(f"/proc/{pid}").exists() for pid in processes):
        assert time.monotonic() < deadline
        time.sleep(0.1)


TRAIN = [
    *("-m", "veca_marl.train", "+task=KickTheBall", "collect=ray", f"collect.groups={ACTORS}"),
    *("collect.worlds=1", "collect.steps=16", "log=csv", "log.video=false", "eval.worlds=1"),
    *("eval.episodes=1", "eval.every_frames=6400", "total_frames=64000", "threads=1"),
]


@pytest.fixture
def run(tmp_path):
    """The process of a run with actors that has collected its first batches."""
    process = subprocess.Popen(
        [sys.executable, *TRAIN, f"hydra.run.dir={tmp_path / 'run'}"],
        env={**os.environ, "PYTHONPATH": str(ROOT), "RAY_ADDRESS": "local"},
        stderr=subprocess.PIPE,
        text=True,
    )
    metrics = tmp_path / "run" / "metrics.csv"
    deadline = time.monotonic() + 300.0
    while not (metrics.exists() and len(metrics.read_text().splitlines()) > 2):
        assert process.poll() is None, process.stderr.read()
        assert time.monotonic() < deadline
        time.sleep(0.2)
    yield process
    process.kill()
    process.communicate()


def actors_of(process):
    """Return the actors among the descendants of a process."""
    parents, names = {}, {}
    for folder in Path("/proc").iterdir():
        if folder.name.isdigit():
            try:
                _, _, rest = (folder / "stat").read_text().rpartition(")")
                names[int(folder.name)] = (folder / "cmdline").read_text()
            except (FileNotFoundError, ProcessLookupError):
                continue
            parents[int(folder.name)] = int(rest.split()[1])

    def descends(pid):
        return pid == process.pid or (pid in parents and descends(parents[pid]))

    return [pid for pid, name in names.items() if "ray::Actor" in name and descends(pid)]


@with_ray
@pytest.mark.slow
def test_a_run_with_a_killed_actor_ends_with_one_line(run):
    actors = actors_of(run)
    assert len(actors) == ACTORS
    os.kill(actors[0], signal.SIGKILL)
    _, errors = run.communicate(timeout=60)
    assert run.returncode == 1
    last = errors.splitlines()[-1]
    assert last.startswith("error: Ray actor "), errors
    assert str(actors[0]) in last
    assert "resume=" in last
    check_that_none_is_left(actors)


@with_ray
@pytest.mark.slow
@pytest.mark.parametrize(("number", "code"), [(signal.SIGTERM, 130), (signal.SIGKILL, -9)])
def test_no_actor_outlives_its_run(run, number, code):
    actors = actors_of(run)
    assert len(actors) == ACTORS
    run.send_signal(number)
    run.communicate(timeout=60)
    assert run.returncode == code
    check_that_none_is_left(actors)


def test_without_ray_the_extra_is_named(monkeypatch):
    monkeypatch.setattr(collection, "find_spec", lambda _: None)
    check_engine(Engine.processes)
    with pytest.raises(ValueError, match=naming("collect.engine=ray", "veca_marl[ray]")):
        check_engine(Engine.ray)


def test_actors_are_at_least_one():
    with pytest.raises(ValueError, match=naming("collect.engine=ray", "collect.processes=0")):
        CollectCfg(processes=0, engine=Engine.ray)
