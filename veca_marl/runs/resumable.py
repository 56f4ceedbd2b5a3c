"""What may be changed when a run is continued: keys that do not touch its result."""

from __future__ import annotations

RESUMABLE = ("resume", "total_frames", "max_minutes", "device", "threads", "log")


def may_change(key: str) -> bool:
    """Return whether a key of the configuration, such as ``log.video``, may be changed."""
    return key.partition(".")[0] in RESUMABLE
