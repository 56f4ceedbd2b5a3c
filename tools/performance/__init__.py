"""The page of rates and costs: ``python -m tools.performance to=docs/performance.md``."""
