"""Collection of experience, and the worker processes that collect it."""
