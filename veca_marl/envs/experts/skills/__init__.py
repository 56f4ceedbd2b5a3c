"""Skills built from controllers: lifting, carrying, sitting up, soccer."""
