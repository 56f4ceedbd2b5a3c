"""Demonstrations in the formats of other libraries."""
