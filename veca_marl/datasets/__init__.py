"""Supervised data sets of what the senses perceive, their storage, and baselines that learn them.

``python -m veca_marl.datasets make +dataset=object_recognition`` makes one, as `make` does in a
notebook; `load` reads it.
"""

from veca_marl.datasets.api import make
from veca_marl.datasets.storage import DatasetError, StoredDataset, load, replay_buffer

__all__ = ["DatasetError", "StoredDataset", "load", "make", "replay_buffer"]
