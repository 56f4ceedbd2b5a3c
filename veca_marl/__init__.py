"""Human-like agents that see, hear and feel in one world, and learn."""
