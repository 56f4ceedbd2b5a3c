"""Images of what an agent senses and of its rewards, as pure functions of arrays."""
