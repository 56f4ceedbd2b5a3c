import multiprocessing
import threading

import pytest
import torch
from fake_env import make_fake_env
from refusals import naming

from veca_marl.algos.collection.experience import CollectCfg, Experience


@pytest.fixture(params=[0, 2], ids=["in_process", "two_processes"])
def experience(request, make_ppo):
    ppo = make_ppo()
    player = ppo.policy.copy()
    worlds = 4 if request.param else 8
    played = Experience(make_fake_env, player.collect, CollectCfg(request.param, worlds, steps=16))
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
    experience = Experience(make_fake_env, make_ppo().policy.copy().collect, CollectCfg(1, 2, 4))
    experience.close()
    assert multiprocessing.get_start_method() == before
    assert torch.get_num_threads() == threads


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
    played = Experience(make_fake_env, policy.collect, CollectCfg(2, worlds=1, steps=4))
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
            make_fake_env, make_ppo().policy.copy().collect, CollectCfg(1, 2, 8)
        )
        experience.restart(5)
        batches.append(experience.collect()["agents", "action"].clone())
        experience.close()
    assert torch.equal(*batches)


@pytest.mark.parametrize("wrong", [{"processes": -1}, {"worlds": 0}, {"steps": 0}, {"threads": 0}])
def test_invalid_numbers_raise_an_error_with_their_name(wrong):
    ((name, number),) = wrong.items()
    with pytest.raises(ValueError, match=naming(f"collect.{name}", number)):
        CollectCfg(**wrong)
