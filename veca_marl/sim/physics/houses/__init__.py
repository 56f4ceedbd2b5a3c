"""Houses: walls from rooms and doors, furniture, and houses that are generated from a seed."""
