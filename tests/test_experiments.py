"""The experiments of this repository: their declarations, and the pages about them."""

from pathlib import Path

import pytest
import yaml

from veca_marl.plugins import conf_dir
from veca_marl.reports.arms import compose_arms
from veca_marl.reports.gather import read_rows
from veca_marl.reports.scores import runs_of, team_of

EXPERIMENTS = Path(__file__).resolve().parent.parent / "experiments"
DECLARED = {
    path.stem: declared
    for path in sorted((conf_dir() / "experiment").glob("*.yaml"))
    if (declared := yaml.safe_load(path.read_text()).get("experiment"))
}


@pytest.mark.parametrize("name", DECLARED)
def test_an_experiment_has_its_name_seeds_claims_and_a_page_with_its_commands(name):
    declared = DECLARED[name]
    assert declared["name"] == name
    assert len(declared["seeds"]) >= 3
    assert declared["claim"]
    assert declared["claims"]
    page = (EXPERIMENTS / name / "README.md").read_text()
    assert f"python -m veca_marl.train -m +experiment={name}\n" in page
    assert f"python -m veca_marl.report +experiment={name} " in page


@pytest.mark.slow  # every arm is composed; the claims are checked with every experiment
@pytest.mark.parametrize("name", DECLARED)
def test_every_arm_of_an_experiment_can_be_chosen(name):
    arms = compose_arms([f"+experiment={name}"])
    assert {arm.cfg.experiment.arm for arm in arms} >= set(DECLARED[name]["arms"])


@pytest.mark.slow
@pytest.mark.parametrize(
    "path", sorted(EXPERIMENTS.glob("*/report.md")), ids=lambda p: p.parent.name
)
def test_a_report_belongs_to_its_table_of_results(path):
    rows = read_rows(path.with_name("results.csv"))
    declared = DECLARED[path.parent.name]
    budgets = {arm.name: arm.budget for arm in compose_arms([f"+experiment={path.parent.name}"])}
    team = team_of(rows, declared.get("team"))
    runs = runs_of(rows, declared.get("metric", "return"), team, budgets)
    text = path.read_text()
    for run in runs:
        ended = "yes" if run.ended else "no"
        cells = f"| {run.arm} | {run.seed} | {ended} | {run.final.frames} | {run.final.score:.2f} |"
        assert cells in text
