"""Learning from demonstrations: what is stored, samples of it, and the loss."""
