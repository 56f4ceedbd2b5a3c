"""What experts estimate from observations: the position of a caller."""
