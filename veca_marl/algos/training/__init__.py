"""The training loop: collection, evaluation, checkpoints, metrics."""
