"""The replay buffer of one team: stored segments, sampled windows, memory-mapped files."""
