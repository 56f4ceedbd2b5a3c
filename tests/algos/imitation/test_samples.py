"""Samples of demonstrations: every step equally often, and sequences within one episode."""

import pytest
import torch
from demonstrated import demonstrations_of_toy
from fake_env import FakeEnv
from training import SMALL

from veca_marl.algos.imitation.samples import COUNTED, Samples, SequenceCfg
from veca_marl.algos.networks.factory import make_network
from veca_marl.algos.networks.multisense import Memory, MultisenseCfg
from veca_marl.algos.specs import team_specs

GRU = MultisenseCfg(**{**vars(SMALL), "memory": Memory.gru})
STEPS, EPISODES = 8, 3


def samples(folder, network=SMALL, sequence=SequenceCfg(2, 3)):  # noqa: B008  frozen
    spec = team_specs(FakeEnv())["agents"]
    actor = make_network("agents", spec, network).actor
    found = demonstrations_of_toy(folder, EPISODES)
    # the number of each row, where the actions were
    found.rows["agents", "action"][:] = torch.arange(len(found.rows)).view(-1, 1, 1)
    return found, Samples(found, "agents", spec, actor, sequence, range(EPISODES))


def numbers(drawn):
    return drawn["agents", "action"][..., 0, 0].long()


def test_single_steps_are_drawn_equally_often_and_never_ends_of_episodes(tmp_path):
    torch.manual_seed(0)
    found, source = samples(tmp_path)
    drawn = source.draw(4800)
    counts = torch.bincount(numbers(drawn), minlength=len(found.rows))
    assert drawn[COUNTED].all()
    assert not counts[found.rows["end"]].any()
    # 200 each on average, with a standard deviation of 14
    assert counts[~found.rows["end"]].min() > 100
    assert counts.max() < 300
    assert source.steps == found.steps == STEPS * EPISODES


def test_what_is_counted_of_sequences_is_drawn_equally_often(tmp_path):
    torch.manual_seed(0)
    found, source = samples(tmp_path, GRU)
    drawn = source.draw(9000)
    counted = drawn[COUNTED][..., 0]
    counts = torch.bincount(numbers(drawn)[counted], minlength=len(found.rows))
    assert not counts[found.rows["end"]].any()
    # 3000 parts of 9 kinds: 333 each, with a standard deviation of 18
    assert counts[~found.rows["end"]].min() > 230
    assert counts.max() < 440


def test_sequences_stay_in_their_episode_and_begin_without_memory(tmp_path):
    _, source = samples(tmp_path, GRU)
    drawn = source.draw(300)
    rows, begins = numbers(drawn), drawn["is_init"][..., 0]
    assert not drawn["agents", "memory", "hidden"].any()
    for sequence, start, counted in zip(rows, begins, drawn[COUNTED][..., 0], strict=True):
        first = int(start.long().cumsum(0).argmax())  # the last row that begins
        real = sequence[first:][counted[first:] | (torch.arange(len(sequence))[first:] < 2)]
        assert (real.diff() == 1).all()
        assert len({int(row) // (STEPS + 1) for row in real}) == 1


def test_a_sample_has_at_least_one_sequence(tmp_path):
    _, source = samples(tmp_path, GRU)
    assert source.draw(1).shape == (1, 5)


@pytest.mark.parametrize("length", [1, 4, 8, 20])
def test_all_steps_belong_to_a_part(tmp_path, length):
    _, source = samples(tmp_path, GRU, SequenceCfg(0, length))
    assert source.steps == STEPS * EPISODES
