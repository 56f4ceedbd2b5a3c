"""Propagation of sound from sources to listeners."""

from veca_marl.sim.sound.propagation.receiver import Receiver

__all__ = ["Receiver"]
