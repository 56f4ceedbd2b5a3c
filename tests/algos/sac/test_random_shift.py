"""Images of a window are shifted alike, so that disparity and motion stay."""

import pytest
import torch
from tensordict import TensorDict

from veca_marl.algos.sac.readers import RandomShift, shift
from veca_marl.algos.specs import ActionLayout, ArrayLayout, TeamSpec

PIXELS = 3
SPEC = TeamSpec(
    agents=1,
    observations={
        "audio": ArrayLayout((2, 10), "float32", -8.0, 3.0),
        "vision": ArrayLayout((2, 3, 20, 24), "uint8", 0.0, 255.0),
    },
    actions={"action": ActionLayout(discrete=False, size=2)},
)


def rows_with_a_dot(windows=16, right=0):
    """Return rows whose left eye sees a dot at column 10, and the right eye at column 7."""
    vision = torch.zeros(windows, 1, 2, 3, 20, 24, dtype=torch.uint8)
    for eye, column in enumerate((10, 7)):
        vision[:, :, eye, :, 9, column + right] = 255
    senses = {"vision": vision, "audio": torch.rand(windows, 1, 2, 10)}
    return TensorDict({"team": {"observation": senses}}, (windows,))


def places(rows):
    """Return row and column of the dot in each eye, ``(windows, eyes, 2)``."""
    seen = rows["team", "observation", "vision"][:, 0, :, 0]
    found = seen.flatten(2).argmax(-1)
    return torch.stack([found // 24, found % 24], -1)


@pytest.fixture
def shifted():
    torch.manual_seed(0)
    first, last = rows_with_a_dot(), rows_with_a_dot(right=2)
    audio = first["team", "observation", "audio"].clone()
    RandomShift("team", SPEC, PIXELS)(first, last)
    assert torch.equal(first["team", "observation", "audio"], audio)
    return places(first), places(last)


def test_the_disparity_between_the_eyes_is_unchanged(shifted):
    for found in shifted:
        assert (found[:, 0] - found[:, 1]).tolist() == [[0, 3]] * 16


def test_the_motion_between_first_and_last_picture_is_unchanged(shifted):
    first, last = shifted
    assert (last - first).flatten(0, 1).tolist() == [[0, 2]] * 32


def test_windows_are_shifted_differently_in_both_directions(shifted):
    moved = shifted[0][:, 0] - torch.tensor([9, 10])
    for direction in moved.unbind(-1):
        assert direction.min() < 0 < direction.max()
        assert direction.abs().max() <= PIXELS


def test_pixels_at_the_border_are_repeated():
    image = torch.arange(12, dtype=torch.uint8).reshape(1, 1, 3, 4)
    moved = shift(image, torch.tensor([[0, 2]]), 1)  # content moves down and left
    assert moved[0, 0].tolist() == [[1, 2, 3, 3], [1, 2, 3, 3], [5, 6, 7, 7]]
    assert torch.equal(shift(image, torch.tensor([[1, 1]]), 1), image)


def test_no_pixels_change_nothing_and_draw_nothing():
    rows = rows_with_a_dot()
    state = torch.get_rng_state()
    before = places(rows)
    RandomShift("team", SPEC, 0)(rows)
    assert torch.equal(places(rows), before)
    assert torch.equal(torch.get_rng_state(), state)
