"""What adapters return for one player, compared with the rows of a rollout by TorchRL."""

import numpy as np

from veca_marl.envs.core.task import SOLVED


def by_player(step, group_map):
    return {
        name: step[team][index]
        for team, names in group_map.items()
        for index, name in enumerate(names)
    }


def check_observation(observation, row):
    assert set(observation) == set(row["observation"].keys())
    for sense, seen in observation.items():
        expected = row["observation", sense].numpy()
        np.testing.assert_array_equal(seen, expected, err_msg=sense)
        assert seen.dtype == expected.dtype, sense


def check_result(reward, terminated, truncated, info, row):
    assert np.float32(reward) == row["reward"].item()
    assert (terminated, truncated) == (row["terminated"].item(), row["truncated"].item())
    expected = {name: value.item() for name, value in row["info"].items()}
    assert info.get(SOLVED) is expected.pop(SOLVED, None)
    others = {name: value for name, value in info.items() if name not in ("terms", SOLVED)}
    found = info["terms"] | others
    assert {name: np.float32(value) for name, value in found.items()} == expected
