"""Networks: an encoder per sense, actors and critics."""
