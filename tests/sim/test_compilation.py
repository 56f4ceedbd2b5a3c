"""Users are told once, and only when something of ours is compiled."""

from numba import njit
from numba.core.event import install_listener

from veca_marl.sim import compilation
from veca_marl.sim.compilation import CompilationNotice, announce_compilation


def compile_new_kernel(module):
    def kernel(x):
        return x + 1

    kernel.__module__ = module
    compiled = njit(kernel)
    assert compiled(1) + compiled(2) == 5


def test_one_line_for_any_number_of_our_kernels():
    told = []
    with install_listener("numba:compile", CompilationNotice(told.append)):
        compile_new_kernel("veca_marl.sim.one")
        compile_new_kernel("veca_marl.sim.two")
    assert len(told) == 1
    assert "compiling kernels" in told[0]


def test_kernels_of_others_are_their_own_affair():
    told = []
    with install_listener("numba:compile", CompilationNotice(told.append)):
        compile_new_kernel("somewhere.else")
    assert told == []


def test_announcing_twice_tells_once(monkeypatch):
    registered = []
    monkeypatch.setattr(compilation, "register", lambda *what: registered.append(what))
    announce_compilation.cache_clear()
    announce_compilation()
    announce_compilation()
    [(kind, notice)] = registered
    assert kind == "numba:compile"
    assert isinstance(notice, CompilationNotice)
