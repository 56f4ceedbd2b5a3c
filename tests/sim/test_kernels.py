"""Kernels without reference counts: what they return and call, and that no array is left over."""

import importlib
import pkgutil
from contextlib import closing

import numpy as np
import pytest
from numba import njit
from numba.core.dispatcher import Dispatcher
from numba.core.errors import NumbaError
from numba.core.runtime import _nrt_python, rtsys

import veca_marl.sim
from veca_marl import make
from veca_marl.sim.geometry import Floats
from veca_marl.sim.kernels import kernel


def all_modules():
    walked = pkgutil.walk_packages(veca_marl.sim.__path__, "veca_marl.sim.")
    return [importlib.import_module(found.name) for found in walked]


def compiled_by(module):
    """Return the compiled functions that a module defines."""
    return [
        found
        for found in vars(module).values()
        if isinstance(found, Dispatcher) and found.py_func.__module__ == module.__name__
    ]


def counts_references(function):
    return function.targetoptions.get("_nrt", True)


def is_inlined(function):
    return function.targetoptions.get("inline") == "always"


def test_what_kernels_call_counts_no_references_either():
    """What counts them would be compiled without, or leave the arrays that it returns to nobody."""
    kernels = [f for module in all_modules() for f in compiled_by(module) if not is_inlined(f)]
    kernels = [function for function in kernels if not counts_references(function)]
    assert kernels
    for function in kernels:
        names = function.py_func.__globals__
        called = [names.get(name) for name in function.py_func.__code__.co_names]
        wrong = [
            other.py_func.__name__
            for other in called
            if isinstance(other, Dispatcher) and counts_references(other) and not is_inlined(other)
        ]
        assert not wrong, f"{function.py_func.__name__} calls {wrong}"


@kernel
def next_number(n: int) -> int:
    return n + 1


@kernel
def count_up(steps: int) -> int:
    count = next_number(0)
    for _ in range(steps):
        count = next_number(count)
    return count


def test_what_kernels_call_is_compiled_once_for_all_values():
    assert count_up(4) == next_number(4) == 5
    assert len(next_number.signatures) == 1


def returns_an_array(x: Floats) -> Floats:
    return x


def returns_arrays(x: Floats) -> tuple[float, Floats]:
    return x[0], x


def allocates(x: Floats) -> float:
    return float(np.empty(len(x))[0])


def returns_numbers(x: Floats, out: Floats) -> tuple[int, float]:
    out[0] = x[0]
    return len(x), x[1]


@pytest.mark.parametrize("function", [returns_an_array, returns_arrays])
def test_kernels_that_return_arrays_are_refused(function):
    with pytest.raises(TypeError, match=function.__name__):
        kernel(function)


def test_kernels_that_allocate_are_not_compiled():
    njit(allocates)(np.ones(3))
    with pytest.raises(NumbaError):
        kernel(allocates)(np.ones(3))


def test_a_kernel_computes_what_the_function_does():
    x, out = np.array([1.0, 2.0, 3.0]), np.zeros(1)
    assert kernel(returns_numbers)(x, out) == (3, 2.0)
    assert out[0] == 1.0


@pytest.mark.parametrize("task", ["KickTheBall", "MultiAgentNav", "TurnBaby", "GrabObject"])
def test_no_step_leaves_arrays_over(task):
    """Numba frees all arrays that kernels make, whatever of them counts references."""
    with closing(make(task, worlds=1)) as env:
        env.set_seed(0)
        env.rollout(3)
        _nrt_python.memsys_enable_stats()
        left = []
        for _ in range(2):
            env.rollout(10)
            stats = rtsys.get_allocation_stats()
            left.append(stats.mi_alloc - stats.mi_free)
    assert left[1] <= left[0] + 5  # Python holds a few, that may come and go
