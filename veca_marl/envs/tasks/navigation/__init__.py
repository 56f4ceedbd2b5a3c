"""Tasks of finding objects: ObjectNav, ObjectPhysNav, MultiAgentNav."""
