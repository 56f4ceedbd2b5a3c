"""Runs in a child process that is killed, and the comparison of what two runs have stored."""

import os
import signal
from functools import partial
from multiprocessing import get_context

import torch
from fake_env import make_fake_env
from training import FRAMES, SMALL, read

from veca_marl.algos.checkpoints import Checkpoints, Identity
from veca_marl.algos.collection.experience import CollectCfg
from veca_marl.algos.evaluation.evaluate import EvalCfg
from veca_marl.algos.ppo import PPOCfg
from veca_marl.algos.reporting import CsvReporter
from veca_marl.algos.specs import team_specs
from veca_marl.algos.training.learners import TeamLearners
from veca_marl.algos.training.loop import Trainer
from veca_marl.algos.training.schedule import Budget

BATCHES = 6
make_env = partial(make_fake_env, senses=("audio",))


def make_trainer(folder, processes=0):
    """Return what trains, or continues, in `folder`."""
    torch.manual_seed(0)
    specs = team_specs(make_env(1, 0))
    checkpoints = Checkpoints(folder / "checkpoints", Identity("Toy", specs), {}, keep_last=2)
    trainer = Trainer(
        make_env=make_env,
        learners=TeamLearners(specs, PPOCfg(network=SMALL, epochs=1), torch.device("cpu")),
        collect=CollectCfg(2, worlds=2, processes=processes, steps=FRAMES // 4),
        evaluation=EvalCfg(every_frames=2 * FRAMES, episodes=2, worlds=2),
        budget=Budget(BATCHES * FRAMES),
        checkpoints=checkpoints,
        reporters=[],
        seed=0,
        progress_bar=False,
    )
    if not checkpoints.empty:
        trainer.resume(checkpoints.latest())
    trainer.reporters = [CsvReporter(folder, trainer.progress.frames)]
    return trainer


class Child:
    """A run in a forked process.

    Args:
        folder: Folder of the run.
        prepare: Called in the child before it trains.
        processes: Worker processes of the run.
    """

    def __init__(self, folder, prepare=None, processes=0):
        folder.mkdir(exist_ok=True)
        target = partial(_prepared, prepare, folder, processes)
        self._process = get_context("fork").Process(target=target)
        self._process.start()

    def kill_after(self, seconds):
        """Kill the run after some time; return whether it had not ended by then."""
        self._process.join(seconds)
        running = self._process.is_alive()
        self._process.kill()
        self._process.join()
        return running

    def wait(self):
        """Return the exit code; that of a signal is negative."""
        self._process.join(120.0)
        return self._process.exitcode


def _prepared(prepare, folder, processes):
    # a fork of a process that has computed in parallel waits for ever for threads it does not have
    torch.set_num_threads(1)
    if prepare is not None:
        prepare()
    make_trainer(folder, processes).run()


def die():
    """End this process as if it were killed from outside."""
    os.kill(os.getpid(), signal.SIGKILL)


def stored(folder):
    """Return everything that a run has stored: rows of its tables, content of its checkpoints."""
    tables = {path.name: read(path) for path in folder.glob("*.csv")}
    checkpoints = {
        path.name: torch.load(path, weights_only=True) for path in folder.glob("checkpoints/*")
    }
    return tables | checkpoints


def assert_equal(one, other, name=""):
    """Compare nested dictionaries, lists and tensors, bit by bit."""
    assert type(one) is type(other), name
    if isinstance(one, dict):
        assert one.keys() == other.keys(), name
        for key in one:
            assert_equal(one[key], other[key], f"{name}.{key}")
    elif isinstance(one, list | tuple):
        assert len(one) == len(other), name
        for index, entry in enumerate(one):
            assert_equal(entry, other[index], f"{name}[{index}]")
    elif isinstance(one, torch.Tensor):
        assert torch.equal(one, other), name
    else:
        assert one == other, name
