"""What a run returns to a sweeper that optimises."""

import csv
import sys
from importlib import import_module
from typing import ClassVar

import pytest
from hydra.core.config_store import ConfigStore
from hydra.core.plugins import Plugins
from hydra.plugins.sweeper import Sweeper
from hydra.types import HydraContext
from refusals import naming

from veca_marl.sweeps.run_state import final_score

TRAIN = import_module("veca_marl.train")
ROWS = [
    {"frames": 0, "player": "random", "team": "red", "return": 9.0, "kick": 1.0},
    {"frames": 1, "player": "policy", "team": "red", "return": 1.0, "kick": 0.0},
    {"frames": 2, "player": "policy", "team": "red", "return": "2.5", "kick": 3.0},
]
WITH_BLUE = [*ROWS, {"frames": 2, "player": "policy", "team": "blue", "return": 4.0, "kick": ""}]


@pytest.mark.parametrize(
    ("rows", "metric", "team", "score"),
    [
        (ROWS, "return", None, 2.5),
        (ROWS, "kick", "red", 3.0),
        (WITH_BLUE, "return", "red", 2.5),
        (WITH_BLUE, "return", "blue", 4.0),
    ],
)
def test_the_score_is_that_of_the_last_evaluation_of_the_policy(rows, metric, team, score):
    assert final_score(rows, {"metric": metric, "team": team}) == score


@pytest.mark.parametrize(
    ("rows", "metric", "team", "named"),
    [
        (ROWS[:1], "return", None, "csv"),
        (WITH_BLUE, "return", None, "red"),
        (ROWS, "return", "green", "green"),
        (ROWS, "falls", None, "falls"),
        (ROWS, "player", None, "kick"),
        (WITH_BLUE, "kick", "blue", "kick"),
    ],
)
def test_a_score_that_is_not_there_is_refused(rows, metric, team, named):
    with pytest.raises(ValueError, match=naming(named)):
        final_score(rows, {"metric": metric, "team": team})


class Climber(Sweeper):
    """Launches one batch of two runs and keeps what they return, as sweepers that optimise do."""

    returned: ClassVar[list] = []

    def setup(self, *, hydra_context: HydraContext, task_function, config):
        """See `Sweeper`."""
        self.launcher = Plugins.instance().instantiate_launcher(
            hydra_context=hydra_context, task_function=task_function, config=config
        )

    def sweep(self, arguments):
        """See `Sweeper`."""
        batch = [[*arguments, f"algo.gamma={gamma}"] for gamma in (0.9, 0.95)]
        self.returned[:] = [done.return_value for done in self.launcher.launch(batch, 0)]


@pytest.fixture
def climb(tmp_path, monkeypatch):
    """Sweep with `Climber`; instead of training, evaluations of a team are written."""
    monkeypatch.chdir(tmp_path)
    Plugins.instance().register(Climber)
    node = {"_target_": f"{__name__}.Climber"}
    ConfigStore.instance().store(group="hydra/sweeper", name="climber", node=node)
    monkeypatch.setattr(Plugins.instance(), "is_in_toplevel_plugins_module", lambda *_: True)

    def write(jobs, *_):
        for number, job in enumerate(jobs):
            job.folder.mkdir(parents=True)
            (job.folder / "config.yaml").write_text("seed: 0\n")
            with (job.folder / "evaluations.csv").open("w", newline="") as file:
                writer = csv.DictWriter(file, ROWS[0])
                writer.writeheader()
                writer.writerows([{**row, "kick": number} for row in ROWS])

    def call(*words):
        monkeypatch.setattr(sys.modules["hydra_plugins.veca_marl_sweeps"], "run_sweep", write)
        monkeypatch.setattr(
            sys, "argv", ["train", "-m", "hydra/sweeper=climber", "+task=KickTheBall", *words]
        )
        TRAIN.main()
        return Climber.returned

    return call


def test_a_sweeper_gets_the_scores_of_runs_in_processes_of_their_own(climb):
    assert climb("experiment.metric=kick") == [0.0, 1.0]


def test_a_run_without_score_ends_the_sweep_with_one_line(climb, capsys):
    with pytest.raises(SystemExit):
        climb("experiment.team=blue")
    (line,) = capsys.readouterr().err.strip().splitlines()
    assert "experiment.team=blue" in line
