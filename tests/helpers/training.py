"""Shared by tests of training: a small network, an interruption, rows of a CSV file."""

import csv

from veca_marl.algos.networks.encoders import Precision
from veca_marl.algos.networks.multisense import MultisenseCfg
from veca_marl.algos.reporting import Reporter

# float32: tests compare losses with formulas
SMALL = MultisenseCfg(
    channels=[4, 8, 8], vector_features=16, trunk_features=32, precision=Precision.float32
)
FRAMES = 64  # of a batch


class Interrupt(Reporter):
    """A reporter that raises KeyboardInterrupt in the middle of a stage."""

    def __init__(self, frames):
        self.frames = frames

    def write(self, kind, frames, row):
        if kind == "metrics" and frames == self.frames:
            raise KeyboardInterrupt

    def sync(self):
        pass

    def close(self):
        pass


TIMES = ("frames_per_s", "between_s", "processor_s")


def read(path):
    """Return the rows of a CSV file without those columns that depend on the clock."""
    with path.open() as file:
        rows = list(csv.DictReader(file))
    return [{k: v for k, v in row.items() if k not in TIMES} for row in rows]


def rewards_until(enough, learn, batches):
    """Learn from one batch after another, until the reward is high enough or all are used.

    Args:
        enough: Mean reward that ends learning.
        learn: Plays and learns from a batch; returns its mean reward.
        batches: How many batches there are at most.

    Returns:
        The mean reward of each batch.
    """
    rewards = []
    while len(rewards) < batches and not (rewards and rewards[-1] > enough):
        rewards.append(learn())
    return rewards
