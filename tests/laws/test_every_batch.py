"""A batch of worlds equals single worlds, for every task."""

import pytest
from batches import batch_and_singles, play_and_compare
from rollouts import game_cfg


@pytest.fixture(scope="module")
def envs(task, kind):
    envs = batch_and_singles(game_cfg(task, kind, "task.max_seconds=0.4"), worlds=2, seed=7)
    yield envs
    for env in envs:
        env.close()


def test_a_batch_equals_single_worlds_with_masks_and_partial_resets(envs):
    play_and_compare(*envs, steps=12)  # an episode has 10
