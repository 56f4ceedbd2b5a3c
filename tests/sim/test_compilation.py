"""One message per process, only when a kernel of this package is compiled."""

import gc
import re
import sys
from functools import cache
from types import ModuleType

from numba import njit
from numba.core.event import install_listener

from veca_marl.sim import compilation
from veca_marl.sim.compilation import CompilationNotice, announce_compilation, kernels_left


def compile_new_kernel(module):
    def kernel(x):
        return x + 1

    kernel.__module__ = module
    compiled = njit(kernel)
    assert compiled(1) + compiled(2) == 5


def test_one_line_for_any_number_of_kernels():
    told = []
    with install_listener("numba:compile", CompilationNotice(told.append)):
        compile_new_kernel("veca_marl.sim.one")
        compile_new_kernel("veca_marl.sim.two")
    assert len(told) == 1
    assert "kernels" in told[0]


def test_progress_says_how_many_are_done_and_left():
    told = []
    with install_listener("numba:compile", CompilationNotice(told.append, every_s=0.0)):
        compile_new_kernel("veca_marl.sim.one")
        compile_new_kernel("veca_marl.sim.two")
    assert len(told) == 3
    first, second = (re.findall(r"\d+", line) for line in told[1:])
    assert (first[0], second[0]) == ("1", "2")


def test_no_garbage_is_collected_meanwhile():
    collecting = []
    notice = CompilationNotice([].append)
    notice.begin = lambda: collecting.append(gc.isenabled())
    with install_listener("numba:compile", notice):
        compile_new_kernel("veca_marl.sim.one")
    assert collecting == [False]
    assert gc.isenabled()


def test_kernels_that_are_compiled_are_not_left(monkeypatch):
    def kernel(x):
        return x + 1

    module = ModuleType("veca_marl.made_up")
    monkeypatch.setitem(sys.modules, module.__name__, module)
    before = kernels_left()
    module.kernel = njit(kernel)
    assert kernels_left() == before + 1
    module.kernel(1)
    assert kernels_left() == before
    module.inlined = njit(inline="always")(kernel)
    assert kernels_left() == before


def test_kernels_of_other_packages_are_not_announced():
    told = []
    with install_listener("numba:compile", CompilationNotice(told.append)):
        compile_new_kernel("somewhere.else")
    assert told == []


def test_announcing_twice_installs_one_notice(monkeypatch):
    registered = []
    monkeypatch.setattr(compilation, "register", lambda *what: registered.append(what))
    monkeypatch.setattr(compilation, "_installed", cache(compilation._installed.__wrapped__))
    announce_compilation()
    announce_compilation()
    [(kind, notice)] = registered
    assert kind == "numba:compile"
    assert isinstance(notice, CompilationNotice)


def test_what_is_to_begin_begins_with_the_first_kernel_once():
    begun = []
    notice = CompilationNotice([].append)
    notice.begin = lambda: begun.append("now")
    with install_listener("numba:compile", notice):
        compile_new_kernel("somewhere.else")
        assert not begun
        compile_new_kernel("veca_marl.sim.one")
        compile_new_kernel("veca_marl.sim.two")
    assert begun == ["now"]
