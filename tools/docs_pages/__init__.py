"""Generators of the pages of ``docs/`` that follow from code and data."""
