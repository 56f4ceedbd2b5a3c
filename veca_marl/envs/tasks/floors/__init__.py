"""The floors of a playground, for all tasks: plans, paths, random positions, checks."""
