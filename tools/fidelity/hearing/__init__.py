"""Laws of hearing: moving sources, rooms, heads."""
