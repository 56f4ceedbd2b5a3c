"""How arrays that are mapped from files are read."""

from __future__ import annotations

import ctypes
import mmap

from torch import Tensor


def expect_scattered_reads(array: Tensor) -> None:
    """Let the system read of a mapped file what is asked for, and nothing ahead of it.

    What it reads ahead of random rows is rarely used, and displaces other rows from memory: files
    that are larger than the memory would be read many times over. This is advice: a system that
    does not take it reads the same values.

    Args:
        array: All rows of a file that is mapped into memory from its beginning on.
    """
    if not hasattr(mmap, "MADV_RANDOM"):
        return
    address, size = ctypes.c_void_p(array.data_ptr()), ctypes.c_size_t(array.nbytes)
    ctypes.CDLL(None).madvise(address, size, ctypes.c_int(mmap.MADV_RANDOM))
