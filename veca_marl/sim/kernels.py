"""Decorators for functions that numba compiles; all have the same options."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from types import NoneType
from typing import Any, TypeVar, get_args, get_origin, get_type_hints

import numpy as np
from numba import njit
from numba.core.types import Type, unliteral

Function = TypeVar("Function", bound=Callable[..., object])

# arguments of `njit`; some of them are missing in its type stubs
_OPTIONS: dict[str, Any] = {
    "cache": True,
    "error_model": "numpy",  # divisions by zero give infinite numbers; loops can be vectorised
    "no_cfunc_wrapper": True,  # C code calls none of them: a seventh of the time of compilation
}


def compiled(function: Function) -> Function:
    """Compile a function, a decorator. Where it creates no array, `kernel` is faster."""
    made: Function = _for_all_values(njit(**_OPTIONS)(function))
    return made


def inlined(function: Function) -> Function:
    """Compile a small function into the functions that call it, a decorator.

    These may be decorated by `compiled` or by `kernel`.
    """
    made: Function = njit(**_OPTIONS, inline="always")(function)
    return made


def kernel(function: Function) -> Function:
    """Compile a function that creates no array and returns none, a decorator.

    All arrays that it needs are arguments, those that it overwrites too. Numba counts the
    references to each array that a function takes out of a tuple, by atomic operations: up to half
    of the processor time where arguments are named tuples. Where no array is created, nothing has
    to be counted. Numba refuses to compile a function that allocates. What a kernel calls must be a
    kernel too, or return no array, which nobody would free.

    Raises:
        TypeError: If what it returns may be an array.
    """
    returned = get_type_hints(function)["return"]
    if not _is_plain(returned):
        raise TypeError(f"kernel {function.__name__} returns {returned}, not numbers")
    made: Function = _for_all_values(njit(**(_OPTIONS | {"_nrt": False}))(function))
    return made


def _for_all_values(dispatcher: Any) -> Any:
    """Let calls from other kernels compile a function once for all values of an argument.

    Where an argument is a constant, or a variable that has only been set to one yet, numba would
    compile the function for that constant too: a tenth of the time of the first use.
    """
    of_types = dispatcher.get_call_template

    def get_call_template(args: Sequence[Type], kws: Mapping[str, Type]) -> Any:
        return of_types(list(map(unliteral, args)), {k: unliteral(v) for k, v in kws.items()})

    dispatcher.get_call_template = get_call_template
    return dispatcher


def _is_plain(returned: Any) -> bool:
    """Return whether a type consists of numbers alone, also in tuples."""
    if get_origin(returned) is tuple:
        return all(map(_is_plain, get_args(returned)))
    return isinstance(returned, type) and issubclass(
        returned, (bool, int, float, np.generic, NoneType)
    )
