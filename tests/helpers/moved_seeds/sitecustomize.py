"""Imported by Python at the start of a child process of tests with ``--seed-offset``."""

import os

from seed_offset import VARIABLE, move_own_seeds

move_own_seeds(int(os.environ[VARIABLE]))
