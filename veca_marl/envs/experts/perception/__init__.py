"""What experts infer from observations."""
