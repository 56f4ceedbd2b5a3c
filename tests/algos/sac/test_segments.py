"""Rows of the replay buffer: each observation once, and windows that stay inside an episode."""

import torch
from fake_env import FakeEnv
from timed_batches import SPEC, batch_of

from veca_marl.algos.sac.config import ReplayCfg
from veca_marl.algos.sac.replay import END, Replay, Span, StoredKeys, segment_rows, transitions
from veca_marl.algos.specs import ActionLayout, ArrayLayout, TeamSpec

GAMMA = 0.5
KEYS = StoredKeys.of("team", SPEC)


def rows_of(batch):
    return segment_rows(batch, KEYS)


def replay_of(*batches, capacity=200, steps=3):
    torch.manual_seed(0)
    replay = Replay(KEYS, ReplayCfg(capacity, warm_up_frames=0), Span(0, 1, steps))
    for batch in batches:
        replay.extend(batch)
    return replay


def sample_of(replay):
    """Return (first, last, returns, discount) of the windows of the first agent."""
    found = transitions(replay.sample(512), "team", GAMMA)
    arrays = (
        found.first["team", "observation", "time"],
        found.last["team", "observation", "time"],
        found.returns,
        found.discount,
    )
    counted = found.counted[:, 0]
    return {tuple(a[i, 0].item() for a in arrays) for i in counted.nonzero().flatten()}


def test_each_observation_is_stored_once_and_segments_end_with_the_following_one():
    rows = rows_of(batch_of(steps=4, done=[(0, 1)]))
    time = rows["team", "observation", "time"][:, 0].tolist()
    assert time == [0.0, 1.0, 1.5, 2.0, 3.0, 3.5, 1000.0, 1001.0, 1002.0, 1003.0, 1003.5]
    ends = [2, 5, 10]
    assert rows[END].nonzero().flatten().tolist() == ends
    assert rows["team", "action"][ends].abs().sum() == 0.0
    assert rows["team", "reward"][:, 0, 0].tolist() == [1, 2, 0, 3, 4, 0, 1, 2, 3, 4, 0]


def test_returns_of_a_window_inside_an_episode():
    # rewards 1, 2, 3 from step 0: 1 + 2 / 2 + 3 / 4
    assert (0.0, 3.0, 2.75, 0.125) in sample_of(replay_of(batch_of()))


def test_windows_end_at_a_truncation_and_take_the_value_of_the_true_last_observation():
    found = sample_of(replay_of(batch_of(worlds=1, done=[(0, 3)])))
    assert found == {
        (0.0, 3.0, 2.75, 0.125),
        (1.0, 3.5, 2.0 + 1.5 + 1.0, 0.125),
        (2.0, 3.5, 3.0 + 2.0, 0.25),
        (3.0, 3.5, 4.0, 0.5),
        (4.0, 5.5, 5.0 + 3.0, 0.25),
        (5.0, 5.5, 6.0, 0.5),
    }


def test_a_terminated_window_has_no_value_after_it():
    found = sample_of(replay_of(batch_of(worlds=1, steps=3, terminated=[(0, 1)])))
    assert found == {(0.0, 1.5, 2.0, 0.0), (1.0, 1.5, 2.0, 0.0), (2.0, 2.5, 3.0, 0.5)}


def test_an_agent_that_is_eliminated_ends_alone():
    replay = replay_of(batch_of(worlds=1, steps=4, eliminated=[(0, 1)]))
    found = transitions(replay.sample(512), "team", GAMMA)
    time = found.first["team", "observation", "time"][:, 0]
    start = (time == 0.0) & found.counted[:, 0]
    torch.testing.assert_close(found.discount[start][0], torch.tensor([0.125, 0.0]))
    torch.testing.assert_close(found.returns[start][0], torch.tensor([2.75, 2.0]))
    later = (time == 2.0) & found.counted[:, 0]
    assert later.any()
    assert not found.counted[later, 1].any()  # the mask of the first row


def test_windows_do_not_connect_worlds_batches_or_the_ends_of_the_ring():
    batches = [batch_of(start=10.0 * i) for i in range(12)]
    found = sample_of(replay_of(*batches, capacity=50))
    assert len(found) > 30
    for first, last, *_ in found:
        assert first // 10 == last // 10  # batches of a world begin at multiples of 10
        assert 0.0 < last - first <= 3.0


def test_a_terminated_flag_after_the_window_is_ignored():
    found = sample_of(replay_of(batch_of(worlds=1, steps=5, terminated=[(0, 3)])))
    assert (0.0, 3.0, 2.75, 0.125) in found


def test_truncation_of_an_environment_keeps_its_final_observation():
    torch.manual_seed(0)
    env = FakeEnv(1, 0, horizon=4, senses=("audio",))
    with torch.no_grad():
        batch = env.rollout(8, break_when_any_done=False)
    spec = TeamSpec(
        1,
        {"audio": ArrayLayout((2, 10), "float32", -8.0, 3.0)},
        {"action": ActionLayout(discrete=False, size=2)},
    )
    rows = segment_rows(batch, StoredKeys.of("agents", spec))
    final = rows["agents", "observation", "audio"][4]
    assert torch.equal(final, batch["next", "agents", "observation", "audio"][0, 3])
    assert rows[END].tolist() == [i % 5 == 4 for i in range(10)]
