"""The window and the loudspeaker. They need the extra ``[play]`` (pygame-ce)."""
