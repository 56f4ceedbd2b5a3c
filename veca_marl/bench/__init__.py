"""How fast it is, and where the time goes: ``python -m veca_marl.bench --task KickTheBall``."""

from veca_marl.bench.command import main

__all__ = ["main"]
