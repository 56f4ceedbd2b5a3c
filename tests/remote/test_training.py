"""A run whose worlds are on a server learns the same as one on this machine, in every byte."""

import pytest
from commands import train
from composed import compose
from refusals import naming
from served import served

from veca_marl.config import ConfigError
from veca_marl.runs.served_worlds import ServedGames, game_text

GAME = ("+task=KickTheBall", "playground=simple", "senses/vision=blind", "task.max_seconds=0.8")
SHORT = (
    "collect.groups=1",
    "collect.worlds=2",
    "collect.steps=32",
    "algo.minibatches=1",
    "eval.episodes=2",
    "eval.worlds=2",
    "total_frames=128",
    "threads=1",
    "device=cpu",
    "log.progress_bar=false",
    "log.video=false",
    "log.logger=[csv]",
)


@pytest.fixture(scope="module")
def game():
    return compose(GAME).game


@pytest.fixture(scope="module")
def described(game):
    with served(game, 2, configuration=game_text(game)) as server:
        yield server


def metrics(folder):
    """Return the rows of a run without times."""
    rows = [line.split(",") for line in (folder / "metrics.csv").read_text().splitlines()]
    kept = [i for i, name in enumerate(rows[0]) if not name.endswith("_s")]
    assert len(kept) > 5
    return [[row[i] for i in kept] for row in rows]


@pytest.mark.slow  # two runs
def test_a_run_learns_the_same_on_a_server(described, tmp_path):
    chosen = {"here": [], "there": [f"collect.server={described.address}"]}
    for folder, words in chosen.items():
        run = f"hydra.run.dir={tmp_path / folder}"
        assert train(tmp_path, *GAME, *SHORT, *words, run) == 0
    assert metrics(tmp_path / "here") == metrics(tmp_path / "there")


def test_a_server_with_another_game_is_refused(described):
    other = compose([*GAME[:-1], "task.max_seconds=2.0"]).game
    with pytest.raises(ConfigError, match=naming("max_seconds: 0.8", "max_seconds: 2.0")):
        ServedGames(described.address).check(other, 2, 1)


def test_a_server_with_too_few_worlds_is_refused(described, game):
    ServedGames(described.address).check(game, 2, 1)
    with pytest.raises(ConfigError, match="worlds=3"):
        ServedGames(described.address).check(game, 3, 1)


def test_a_key_that_cannot_be_read_is_refused(game):
    with pytest.raises(ConfigError, match="nowhere"):
        ServedGames("tcp://127.0.0.1:9", "nowhere").check(game, 1, 1)
