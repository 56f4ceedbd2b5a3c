"""Games in worlds, as TorchRL environments."""
