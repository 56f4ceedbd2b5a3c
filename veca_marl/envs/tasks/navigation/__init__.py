"""Tasks of finding objects: ObjectNav, ObjectPhysNav, MazeNav, MultiAgentNav."""
