"""Tasks in which a way out of a room has to be found."""
