"""Runs give the same bytes whatever number of processes collects and evaluates."""

import pytest
from commands import train

SMALL = (
    "task.max_seconds=0.6",
    "collect.groups=4",
    "collect.worlds=2",
    "collect.steps=16",
    "algo.minibatches=2",
    "eval.every_frames=256",
    "eval.episodes=4",
    "eval.worlds=4",
    "total_frames=512",
    "device=cpu",
    "log.progress_bar=false",
    "log.video=false",
    "log.logger=[csv]",
)
GAMES = {
    "memory": (
        "+task=KickTheBall",
        "playground=simple",
        "algo.network.memory=gru",
        "algo.sequence_steps=8",
    ),
    "team": ("+task=MultiAgentNav", "playground=two_rooms", "algo.network.critic=central"),
    "sampled": ("+task=ObjectNav", "playground=simple", "eval.exploration=stochastic"),
}


def numbers(folder):
    """Return the rows of both tables of a run, without times and memory."""
    tables = []
    for name in ("metrics.csv", "evaluations.csv"):
        rows = [line.split(",") for line in (folder / name).read_text().splitlines()]
        kept = [i for i, head in enumerate(rows[0]) if not head.endswith(("_s", "minutes", "_mb"))]
        assert len(kept) > 3
        tables.append([[row[i] for i in kept] for row in rows])
    return tables


@pytest.mark.slow  # twelve runs
@pytest.mark.parametrize("game", GAMES)
def test_a_run_is_the_same_with_any_number_of_processes(game, tmp_path):
    runs = {}
    for processes in (0, 1, 2, 4):
        own = (f"collect.processes={processes}", f"hydra.run.dir={tmp_path / str(processes)}")
        assert train(tmp_path, *GAMES[game], *SMALL, "threads=1", *own) == 0
        runs[processes] = numbers(tmp_path / str(processes))
    for processes in (1, 2, 4):
        assert runs[processes] == runs[0], processes


@pytest.mark.slow  # three runs
def test_a_run_may_be_continued_with_another_number_of_processes(tmp_path):
    whole, part = (f"hydra.run.dir={tmp_path / name}" for name in ("whole", "part"))
    words = (*GAMES["memory"], *SMALL, "threads=1")
    assert train(tmp_path, *words, "collect.processes=2", whole) == 0
    assert train(tmp_path, *words, "collect.processes=2", "total_frames=256", part) == 0
    more = ("total_frames=512", "collect.processes=0")
    assert train(tmp_path, f"resume={tmp_path / 'part'}", *more) == 0
    assert numbers(tmp_path / "part")[0] == numbers(tmp_path / "whole")[0]
