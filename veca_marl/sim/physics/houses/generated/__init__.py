"""Houses that are generated from a seed: rooms, doors, leaves and furniture."""
