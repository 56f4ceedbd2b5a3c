import torch
from tensordict import TensorDict

from veca_marl.algos.ppo.ppo import minibatches


def rows(*shape):
    numbers = torch.arange(shape[0])
    image = numbers.reshape(-1, *[1] * len(shape)).expand(*shape, 3).to(torch.uint8)
    return TensorDict({"team": {"image": image, "number": image[..., 0].long()}}, shape)


def test_each_row_is_in_one_part_and_rows_that_are_left_over_in_none():
    parts = list(minibatches(rows(11), 3))
    assert [part.batch_size for part in parts] == [(3,)] * 3
    drawn = torch.cat([part["team", "number"] for part in parts])
    assert len(set(drawn.tolist())) == 9
    for part in parts:
        assert (part["team", "image"] == part["team", "number"].unsqueeze(-1)).all()


def test_sequences_stay_whole():
    for part in minibatches(rows(6, 4), 2):
        assert part.batch_size == (3, 4)
        assert (part["team", "number"] == part["team", "number"][:, :1]).all()


def test_the_order_is_drawn_anew_each_time_from_the_global_seed():
    def order(seed):
        torch.manual_seed(seed)
        return [torch.cat([p["team", "number"] for p in minibatches(rows(64), 4)]) for _ in "ab"]

    first, second = order(0)
    assert not torch.equal(first, second)
    assert torch.equal(first, order(0)[0])
    assert not torch.equal(first, order(1)[0])
