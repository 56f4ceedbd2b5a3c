"""The cores of a run, and the warning where other programs use them."""

import logging
import os
import re

import pytest
import torch
from refusals import naming

from veca_marl.algos.collection.experience import CollectCfg
from veca_marl.datasets.command import main as datasets
from veca_marl.processes import cores as process_cores
from veca_marl.processes.cores import CORES, usable_cores
from veca_marl.runs import cores, training
from veca_marl.runs.cores import contention_warning, idle_cores_hint


@pytest.mark.parametrize(
    ("threads", "available", "others"),
    [(1, 2, 9.0), (2, 2, 0.9), (4, 16, 8.0)],
    ids=["one thread", "quiet", "cores for all"],
)
def test_no_warning_where_threads_do_not_wait(threads, available, others):
    assert not contention_warning(threads, available, others)


def test_a_warning_names_load_threads_and_remedy():
    warning = contention_warning(2, 2, 3.25)
    assert "load of 3.2" in warning
    assert "2 threads learn on 2 cores" in warning
    assert "threads=1 is faster" in warning


def test_a_run_that_finds_its_cores_in_use_logs_it(monkeypatch, caplog):
    monkeypatch.setattr(training, "load", lambda: 100.0)
    monkeypatch.setattr(torch, "get_num_threads", lambda: usable_cores() + 1)
    with caplog.at_level(logging.WARNING):
        training._warn_of_contention()
    assert "the machine had a load of 100.0" in caplog.text


def test_the_load_is_the_mean_of_the_last_minute_if_the_system_has_it(monkeypatch):
    monkeypatch.setattr(os, "getloadavg", lambda: (3.25, 1.0, 0.5), raising=False)
    assert cores.load() == 3.25
    monkeypatch.delattr(os, "getloadavg")
    assert cores.load() == 0.0


@pytest.mark.parametrize(
    ("processes", "worlds", "available", "others"),
    [(2, 16, 3, 0.0), (2, 16, 16, 12.2), (16, 2, 16, 0.0), (2, 1, 16, 0.0)],
    ids=["three cores", "others use them", "all in use", "two worlds"],
)
def test_no_hint_without_cores_or_worlds_for_twice_the_processes(
    processes, worlds, available, others
):
    assert not idle_cores_hint(processes, worlds, available, others)


@pytest.mark.parametrize(
    ("available", "others", "remedy"),
    [
        (16, 0.0, "collect.groups=16 collect.worlds=2"),
        (16, 3.2, "collect.groups=8 collect.worlds=4"),
        (6, 0.0, "collect.groups=4 collect.worlds=8"),
        (64, 0.0, "collect.groups=32 collect.worlds=1"),
    ],
)
def test_a_hint_names_processes_and_worlds_of_batches_of_the_same_size(available, others, remedy):
    hint = idle_cores_hint(2, 16, available, others)
    assert f"2 worker processes step 32 worlds on {available} cores" in hint
    assert remedy in hint


def test_a_run_with_cores_for_more_processes_logs_it(monkeypatch, caplog):
    monkeypatch.setattr(training, "usable_cores", lambda: 8)
    monkeypatch.setattr(training, "load", lambda: 0.0)
    with caplog.at_level(logging.INFO, logger="veca_marl"):
        training._log_idle_cores(CollectCfg(processes=2))  # on purpose
        assert not caplog.text
        training._log_idle_cores(CollectCfg())
    assert "collect.groups=8 collect.worlds=1" in caplog.text


def test_cores_are_no_more_than_a_container_or_the_user_allows(monkeypatch, tmp_path):
    monkeypatch.setattr("os.sched_getaffinity", lambda _: set(range(8)), raising=False)
    monkeypatch.delenv(CORES, raising=False)
    quota = tmp_path / "cpu.max"
    monkeypatch.setattr(process_cores, "_QUOTA", quota)
    assert usable_cores() == 8
    for text, number in (("max 100000", 8), ("250000 100000", 3), ("50000 100000", 1)):
        quota.write_text(text)
        assert usable_cores() == number
    quota.write_text("max 100000")
    monkeypatch.setenv(CORES, "2")
    assert usable_cores() == 2
    for wrong in ("0", "two", "-1", ""):
        monkeypatch.setenv(CORES, wrong)
        with pytest.raises(ValueError, match=naming(CORES, wrong)):
            usable_cores()


def test_a_wrong_number_of_cores_ends_in_one_line(monkeypatch, capsys, tmp_path):
    monkeypatch.setenv(CORES, "two")
    words = ["make", "+dataset=sound_localisation", "n=2", f"out={tmp_path / 'data'}"]
    assert datasets(words) == 2
    assert re.search(naming(CORES, "two"), capsys.readouterr().err.strip())
