"""Laws of physics and of the senses, measured: ``python -m tools.fidelity``."""
