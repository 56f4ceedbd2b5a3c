"""The commands called in this process: starting another one and importing torch takes seconds."""

import logging
import signal
import sys
from contextlib import contextmanager

import pytest
import torch

from veca_marl.train import main


@contextmanager
def settings_of_the_process():
    """Restore what a command changes in its process."""
    threads, level = torch.get_num_threads(), logging.getLogger("torchrl").level
    terminate = signal.getsignal(signal.SIGTERM)
    try:
        yield
    finally:
        torch.set_num_threads(threads)
        logging.getLogger("torchrl").setLevel(level)
        signal.signal(signal.SIGTERM, terminate)


def train(folder, *arguments):
    """Do what ``python -m veca_marl.train *arguments`` does in a folder; return the exit status."""
    with pytest.MonkeyPatch.context() as patch, settings_of_the_process():
        patch.chdir(folder)
        patch.setenv("HYDRA_FULL_ERROR", "1")  # `main` sets it
        patch.setattr(sys, "argv", ["veca_marl.train", *arguments])
        try:
            main()
        except SystemExit as end:
            return end.code
    return 0
