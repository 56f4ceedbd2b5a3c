import multiprocessing
import threading

import pytest
import torch
from fake_env import make_fake_env
from refusals import naming
from torchrl.envs.utils import RandomPolicy

from veca_marl.algos.collection.experience import CollectCfg, Experience


@pytest.fixture(params=[0, 2], ids=["in_process", "two_processes"])
def experience(request, make_ppo):
    ppo = make_ppo()
    player = ppo.policy.copy()
    cfg = CollectCfg(2, 4, steps=16, processes=request.param)
    played = Experience(make_fake_env, player.collect, cfg)
    played.ppo, played.player = ppo, player
    yield played
    played.close()


def test_a_batch_has_the_shape_worlds_by_steps(experience):
    experience.restart(3)
    batch = experience.collect()
    assert batch.batch_size == (8, 16)
    assert batch["agents", "observation", "vision"].dtype == torch.uint8
    # rows are worlds, not pieces of worlds: each holds the same whole episodes
    assert torch.equal(batch["next", "done"].squeeze(-1).sum(-1), torch.full((8,), 2))
    images = batch["agents", "observation", "vision"].flatten(2).float().mean(-1)
    assert len({tuple(row.tolist()) for row in images}) == 8, "two worlds play the same game"


def test_restart_is_determined_by_the_seed(experience):
    batches = {}
    for name, seed in (("first", 3), ("other", 4), ("again", 3)):
        experience.restart(seed)
        experience.collect()
        batches[name] = experience.collect().clone()
    for key in (("agents", "action"), ("agents", "observation", "audio"), ("next", "done")):
        assert torch.equal(batches["first"][key], batches["again"][key])
    assert not torch.equal(
        batches["first"]["agents", "action"], batches["other"]["agents", "action"]
    )


def test_worlds_use_the_parameters_that_were_transferred(experience):
    def logits():
        experience.restart(0)
        return experience.collect()["agents", "loc"].clone()

    before = logits()
    with torch.no_grad():
        for p in experience.ppo.policy.parameters():
            p.add_(0.1)
    assert torch.equal(logits(), before), "learning leaked into the worlds"
    experience.player.take_over(experience.ppo.policy)
    experience.update_policy()
    assert not torch.equal(logits(), before)


def test_collection_restores_process_settings(make_ppo):
    before, threads = multiprocessing.get_start_method(), torch.get_num_threads()
    experience = Experience(
        make_fake_env, make_ppo().policy.copy().collect, CollectCfg(1, 2, 4, processes=1)
    )
    experience.close()
    assert multiprocessing.get_start_method() == before
    assert torch.get_num_threads() == threads


def test_processes_change_no_byte_of_what_is_collected(make_ppo):
    """Random actions, observations and what the policy writes, of 4 groups."""
    batches = []
    for processes in (0, 1, 2, 4):
        cfg = CollectCfg(4, worlds=2, steps=8, processes=processes)
        experience = Experience(make_fake_env, make_ppo().policy.copy().collect, cfg)
        experience.restart(5)
        experience.collect()
        torch.rand(processes)  # learning draws random numbers in this process
        batches.append(experience.collect().clone())
        experience.close()
    keys = {key for key in batches[0].keys(True, True) if "traj_ids" not in key}
    for batch in batches[1:]:
        assert {key for key in batch.keys(True, True) if "traj_ids" not in key} == keys
        for key in keys:
            assert torch.equal(batch[key], batches[0][key]), key
    actions = batches[0]["agents", "action"]
    assert len({tuple(row.flatten().tolist()) for row in actions}) == 8, "two worlds act alike"


def test_a_policy_without_keys_acts_for_groups():
    batches = []
    for processes in (0, 2):
        policy = RandomPolicy(make_fake_env(2, 0).action_spec)
        cfg = CollectCfg(4, worlds=2, steps=8, processes=processes)
        experience = Experience(make_fake_env, policy, cfg)
        experience.restart(5)
        batches.append(experience.collect().clone())
        experience.close()
    actions = [batch["agents", "action"] for batch in batches]
    assert torch.equal(*actions)
    assert len(actions[0].flatten().unique()) > 8, "actions of earlier steps are repeated"


def test_random_numbers_of_this_process_are_those_without_collection(make_ppo):
    cfg = CollectCfg(2, worlds=2, steps=8, processes=0)
    experience = Experience(make_fake_env, make_ppo().policy.copy().collect, cfg)
    drawn = []
    for collects in (True, False):
        experience.restart(5)
        if collects:
            experience.collect()
        drawn.append(torch.rand(3))
    experience.close()
    assert torch.equal(*drawn)


def test_groups_are_spread_evenly_over_the_cores():
    cores = (1, 2, 3, 4, 5, 6, 11, 12, 100)
    assert [CollectCfg(12).processes_on(n) for n in cores] == [1, 2, 3, 4, 4, 6, 6, 12, 12]
    assert CollectCfg(12, processes=2).processes_on(100) == 2
    assert CollectCfg(12, processes=0).processes_on(100) == 0
    assert CollectCfg(12, server="tcp://far:5555").processes_on(1) == 12


@pytest.mark.slow
def test_no_other_thread_copies_the_policy(make_ppo, monkeypatch):
    """A thread that copied its parameters kept a team of OpenMP threads.

    Gradient steps on two cores then took 36 ms instead of 23.
    """
    threads = []
    share = torch.UntypedStorage._share_fd_cpu_

    def recording(storage, *args, **options):
        if not storage.is_shared():
            threads.append(threading.current_thread())
        return share(storage, *args, **options)

    monkeypatch.setattr(torch.UntypedStorage, "_share_fd_cpu_", recording)
    policy = make_ppo().policy.copy()
    played = Experience(
        make_fake_env, policy.collect, CollectCfg(2, worlds=1, steps=4, processes=2)
    )
    played.restart(0)
    played.close()
    assert threads, "the parameters are shared by other means than this test knows"
    assert {*threads} == {threading.main_thread()}


@pytest.mark.slow
def test_spawned_and_forked_workers_collect_the_same(make_ppo, monkeypatch):
    batches = []
    for method in ("fork", "spawn"):
        monkeypatch.setattr(
            "veca_marl.algos.collection.experience.start_method", lambda _, m=method: m
        )
        experience = Experience(
            make_fake_env, make_ppo().policy.copy().collect, CollectCfg(1, 2, 8, processes=1)
        )
        experience.restart(5)
        batches.append(experience.collect()["agents", "action"].clone())
        experience.close()
    assert torch.equal(*batches)


@pytest.mark.parametrize(
    "wrong",
    [
        {"processes": -1},
        {"processes": 3},
        {"groups": 0},
        {"worlds": 0},
        {"steps": 0},
        {"threads": 0},
    ],
)
def test_invalid_numbers_raise_an_error_with_their_name(wrong):
    ((name, number),) = wrong.items()
    with pytest.raises(ValueError, match=naming(f"collect.{name}", number)):
        CollectCfg(**wrong)
