"""The expert as a baseline of a report."""

import pytest

from veca_marl.reports.arms import compose_arms
from veca_marl.reports.scores import expert_rows

SHORT = ["+experiment=audio_ablation", "task.max_seconds=0.2"]
DEAF = "experiment.arms.hrtf=['senses/audio=deaf']"


@pytest.mark.slow
def test_the_expert_plays_in_the_first_arm_in_which_it_can():
    arms = [arm for arm in compose_arms([*SHORT, DEAF]) if arm.name in ("hrtf", "mono")]
    (row,) = expert_rows(arms, 1)
    assert (row["arm"], row["player"]) == ("mono", "expert")


@pytest.mark.slow
def test_without_the_sense_that_it_needs_in_any_arm_there_are_no_rows():
    (arm, *_) = compose_arms([*SHORT, DEAF])
    assert expert_rows([arm], 1) == []
