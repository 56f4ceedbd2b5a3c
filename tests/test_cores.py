"""The cores of a run, and the warning where other programs use them."""

import logging
import os

import pytest
import torch

from veca_marl.runs import cores, training
from veca_marl.runs.cores import contention_warning, usable_cores


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
