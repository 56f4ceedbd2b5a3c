"""Freed memory: large arrays are made from memory that the process keeps."""

import ctypes
import resource

import pytest
import torch

from veca_marl.runs import assembly
from veca_marl.runs.assembly import keep_freed_memory


def test_a_large_array_is_made_again_without_page_faults():
    if not keep_freed_memory():
        pytest.skip("glibc alone")
    elements = 16 * 2**20  # 64 MB of float32

    def faults():
        before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
        torch.ones(elements)
        return resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before

    faults()
    assert min(faults() for _ in range(3)) < 64 * 2**20 / 4096 / 100


def test_other_allocators_are_left_alone(monkeypatch):
    monkeypatch.setattr(assembly.platform, "libc_ver", lambda: ("", ""))
    monkeypatch.setattr(ctypes, "CDLL", lambda *_: pytest.fail("no library may be opened"))
    assert keep_freed_memory() is False
