"""Networks: encoders per sense, actors, critics, and the registry of factories."""
