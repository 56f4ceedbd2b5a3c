"""Experts of the developmental benchmarks: SelfTouch, HandRegard."""
