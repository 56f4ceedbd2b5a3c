"""Moves every seed of a process: what a test claims has to hold for any seed.

With an offset K, ``numpy.random.default_rng`` and ``torch.manual_seed`` get other integers than the
caller named. Sequences of integers, from which an environment derives the generator of an episode,
move too. Equal seeds stay equal and different ones different, so that laws of determinism hold.

`move_seeds` moves those of this process. Child processes inherit the two variables that it sets:
Python imports ``sitecustomize`` of this folder at their start, which moves theirs.
"""

import importlib.abc
import importlib.util
import os
import sys
from pathlib import Path

VARIABLE = "VECA_TEST_SEED_OFFSET"
STRIDE = 1000
"""Distance between the seeds of consecutive offsets: more than tests use side by side."""


def move_seeds(offset):
    """Move the seeds of this process and of those that it starts; 0 moves none.

    A process that was started with the variables has moved its seeds before.
    """
    if offset == 0 or os.environ.get(VARIABLE) == str(offset):
        return
    os.environ[VARIABLE] = str(offset)
    paths = [str(Path(__file__).parent), *filter(None, [os.environ.get("PYTHONPATH")])]
    os.environ["PYTHONPATH"] = os.pathsep.join(paths)
    move_own_seeds(offset)


def move_own_seeds(offset):
    """Move the seeds of this process only; torch's as soon as torch is imported."""
    _move_numpy(offset)
    if "torch" in sys.modules:
        _move_torch(sys.modules["torch"], offset)
    else:
        sys.meta_path.insert(0, _AfterTorch(offset))


def _moved(seed, offset):
    if isinstance(seed, (list, tuple)):
        return [*seed, offset]
    is_integer = hasattr(seed, "__index__") and not isinstance(seed, bool)
    return int(seed) + STRIDE * offset if is_integer else seed


def _move_numpy(offset):
    import numpy as np

    make = np.random.default_rng

    def default_rng(seed=None):
        return make(_moved(seed, offset))

    np.random.default_rng = default_rng


def _move_torch(torch, offset):
    seed_all = torch.manual_seed

    def manual_seed(seed):
        return seed_all(_moved(seed, offset))

    torch.manual_seed = torch.random.manual_seed = manual_seed


class _AfterTorch(importlib.abc.MetaPathFinder):
    """Finds torch as the other finders do, and moves its seeds after its import."""

    def __init__(self, offset):
        self._offset = offset

    def find_spec(self, name, path=None, target=None):
        if name != "torch":
            return None
        sys.meta_path.remove(self)
        spec = importlib.util.find_spec(name)
        execute = spec.loader.exec_module

        def exec_and_move(module):
            execute(module)
            _move_torch(module, self._offset)

        spec.loader.exec_module = exec_and_move
        return spec
