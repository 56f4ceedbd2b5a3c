"""Paths of bodies over the floor: steering, detours round furniture, recovery from walls."""
