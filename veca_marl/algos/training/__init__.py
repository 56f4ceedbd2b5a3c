"""The training loop: evaluation, checkpoints, metrics."""
