"""The same game for other libraries: TorchRL, Gymnasium, PettingZoo."""
