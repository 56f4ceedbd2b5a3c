"""Houses: walls from rooms and doors, leaves of doors, furniture; generated houses."""
