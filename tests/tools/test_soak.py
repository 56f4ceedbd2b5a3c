"""What counts as growth in a soak."""

import pytest

import veca_marl
from tools.soak_page import FLAT, Actions, Configurations, Parsers, Sample, Soak, page


def soak(*memory_mb, step=3.0, files=20, problems=()):
    samples = [Sample(float(k), mb, files, 1, 0.0, step, 100 * k) for k, mb in enumerate(memory_mb)]
    return Soak(
        "one", samples, list(problems), Parsers(20, "8 passed", []), Configurations(), Actions(7), 0
    )


def test_the_first_round_fills_caches():
    assert not soak(100.0, 500.0, 500.0, 500.0, 510.0).faults


def test_the_first_training_of_every_task_is_no_growth():
    tasks = len(veca_marl.list_tasks())
    assert not soak(*[100.0] * (tasks - 1), *[500.0] * 4).faults
    (fault,) = soak(*[100.0] * (tasks + 2), *[500.0] * 4).faults
    assert "memory" in fault


@pytest.mark.parametrize("last", [600.0, 1000.0])
def test_growth_of_memory_is_a_fault(last):
    (fault,) = soak(500.0, 500.0, 500.0, 500.0, last).faults
    assert "memory" in fault


def test_problems_are_faults_and_on_the_page():
    found = soak(1.0, 1.0, 1.0, problems=["round 2, TurnBaby, step 3: not finite"])
    assert found.faults == ["round 2, TurnBaby, step 3: not finite"]
    assert found.faults[0] in page(found)


def test_actions_of_both_processes_are_counted():
    assert f"{200 + 7} |" in page(soak(1.0, 1.0, 1.0))


def test_every_quantity_is_a_field_of_a_sample():
    (one, *_) = soak(1.0).samples
    assert all(hasattr(one, quantity.key) for quantity in FLAT)
