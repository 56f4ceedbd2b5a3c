"""The simulator: numpy, PyBullet and numba. It depends neither on torch nor Hydra nor Gymnasium."""

from pathlib import Path

from veca_marl.sim.kernel_cache import configure_kernel_cache

configure_kernel_cache(Path(__file__).parent.parent)
