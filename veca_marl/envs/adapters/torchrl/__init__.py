"""A task as a batched TorchRL environment."""
