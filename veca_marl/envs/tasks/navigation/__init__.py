"""Tasks of finding objects in houses: MultiAgentNav."""
