"""Bodies: what moves in a world by its own will."""
