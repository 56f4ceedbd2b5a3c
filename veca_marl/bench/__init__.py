"""Speed of the environments: ``python -m veca_marl.bench +task=KickTheBall``."""

from veca_marl.bench.command import main

__all__ = ["main"]
