"""The simulator: numpy, PyBullet and numba. It knows neither torch nor Hydra nor Gymnasium."""

from pathlib import Path

from veca_marl.sim.stale_kernels import forget_stale_kernels

forget_stale_kernels(Path(__file__).parent)
