"""Two seconds of every task: walking and jointed bodies, teams, cars, doors, houses."""

import numpy as np
import pytest
from recorded import record
from scipy.spatial.transform import Rotation

from veca_marl.envs.adapters.torchrl.scripted import ExpertPolicy
from veca_marl.envs.core.task import TASKS
from veca_marl.runs.episode_page import read_page, write_page
from veca_marl.runs.episode_page.description import POSITION_UNIT_M, QUATERNION_UNIT

BYTES_PER_S = 10_000_000 / 20 / 2  # of a page, for each body
VIEWER_BYTES = 400_000


@pytest.mark.slow
@pytest.mark.parametrize("task", sorted(TASKS))
def test_a_page_holds_the_poses_of_every_frame(task, tmp_path):
    made = record(f"+task={task}", longest_s=2.0, policy=ExpertPolicy)
    path = tmp_path / "episode.html"
    write_page(path, made.episode)
    read = read_page(path)
    samples, frames = read.steps + 1, made.positions[0].shape[0]
    np.testing.assert_allclose(
        read.positions[:, :frames], made.positions[:samples], atol=0.51 * POSITION_UNIT_M
    )
    turns = Rotation.from_quat(read.quaternions[:, :frames].reshape(-1, 4)).as_matrix()
    stored = np.array(made.rotations[:samples]).reshape(-1, 3, 3)
    np.testing.assert_allclose(turns, stored, atol=4.0 * QUATERNION_UNIT)
    assert len(read.agents) == len(made.observations[0])
    assert path.stat().st_size < VIEWER_BYTES + 2.0 * len(read.agents) * BYTES_PER_S


@pytest.mark.slow
@pytest.mark.parametrize("playground", ["house", "random_house", "three_rooms"])
def test_doors_and_houses_are_recorded(playground, tmp_path):
    made = record("+task=MultiAgentNav", f"playground={playground}", longest_s=0.4)
    write_page(tmp_path / "house.html", made.episode)
    scene = read_page(tmp_path / "house.html").scene
    assert [name for name in scene.objects if "door" in name]
    assert len(scene.rooms) > 1
