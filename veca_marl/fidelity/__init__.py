"""Laws of physics and of the senses, measured: ``python -m veca_marl.fidelity``."""
