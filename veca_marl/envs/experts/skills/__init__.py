"""Skills that experts combine from controllers: carrying, searching, sitting up, shooting."""
