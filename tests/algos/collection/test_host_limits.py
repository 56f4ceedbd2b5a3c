"""Where shared memory or open files are too few for worker processes, one process plays."""

import pytest
from composed import compose

from veca_marl.algos.collection import host_limits
from veca_marl.algos.collection.experience import CollectCfg
from veca_marl.algos.collection.host_limits import (
    allow_files,
    open_files,
    shared_bytes,
    that_fits,
)
from veca_marl.runs.assembly import make_trainer, read_specs

CFG = CollectCfg(2, worlds=16, steps=32, processes=2)


@pytest.fixture(scope="module")
def specs():
    return read_specs(compose(["+task=KickTheBall"]).game)


@pytest.fixture
def host(monkeypatch):
    def set_limits(shared=None, files=None):
        monkeypatch.setattr(host_limits, "available_shared_memory", lambda: shared)
        monkeypatch.setattr(host_limits, "allow_files", lambda _: files)

    return set_limits


def test_a_host_without_limits_plays_as_configured(specs, host):
    host()
    assert that_fits(CFG, specs) == (CFG, "")
    host(shared_bytes(CFG, specs), open_files(CFG, specs))
    assert that_fits(CFG, specs) == (CFG, "")


@pytest.mark.parametrize(
    ("limits", "named"),
    [
        ({"shared": 64_000_000}, ("64 MB", "shared memory")),
        ({"files": 64}, ("64", "open files")),
        ({"shared": 1000, "files": 10}, ("shared memory", "open files")),
    ],
)
def test_with_too_little_all_worlds_are_stepped_in_one_process(specs, host, limits, named):
    host(**limits)
    cfg, changed = that_fits(CFG, specs)
    assert (cfg.processes, cfg.all_worlds, cfg.frames) == (0, CFG.all_worlds, CFG.frames)
    assert all(part in changed for part in ("collect.processes=2", *named)), changed
    assert that_fits(cfg, specs) == (cfg, "")


def test_the_need_covers_what_was_measured(specs):
    """94 MB of shared memory and 110 files with the default, in a run of KickTheBall."""
    assert 94e6 < shared_bytes(CFG, specs) < 128e6
    assert 110 <= open_files(CFG, specs) < 200


def test_the_limit_of_files_is_raised_to_what_is_needed_and_not_above_the_hard_one():
    resource = pytest.importorskip("resource")
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    try:
        resource.setrlimit(resource.RLIMIT_NOFILE, (soft - 10, hard))
        assert allow_files(soft - 20) == soft - 10
        assert allow_files(soft) == soft
        if hard != resource.RLIM_INFINITY:
            assert allow_files(hard + 1) == soft
    finally:
        resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))


def test_a_trainer_collects_with_what_fits(host, caplog):
    host(shared=1000)
    trainer = make_trainer(compose(["+task=KickTheBall", "log=silent", "device=cpu"]))
    assert trainer.collect.processes == 0
    assert trainer.collect.all_worlds == CFG.all_worlds
    assert any("shared memory" in record.getMessage() for record in caplog.records)
