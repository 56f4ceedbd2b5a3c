"""The simulator: numpy, PyBullet and numba. It knows neither torch nor Hydra nor Gymnasium."""
