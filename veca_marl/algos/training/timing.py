"""A table of the time that TorchRL's `timeit` has measured."""

from __future__ import annotations

from torchrl import timeit


def timing_table(elapsed_s: float, frames: int) -> str:
    """Return lines of seconds, share and milliseconds per frame of each part.

    Beyond `timeit.print`: shares of the whole, the time that no part accounts for, and the time
    per frame. A part of another one, such as ``evaluate/video``, has a line after the total: its
    time is counted in both.

    Args:
        elapsed_s: The whole time.
        frames: Frames learnt from in it.
    """
    # `timeit.erase` leaves the names of parts, with no time
    measured = {name: s for name, s in timeit.todict(percall=False).items() if s > 0.0}
    parts = {name: s for name, s in measured.items() if "/" not in name}
    within = [(name, s) for name, s in measured.items() if "/" in name]
    parts["other"] = max(0.0, elapsed_s - sum(parts.values()))
    lines = [f"{'part':<16}{'seconds':>10}{'share':>8}{'ms/frame':>10}"]
    for part, seconds in [*parts.items(), ("total", elapsed_s), *within]:
        share, each = seconds / elapsed_s, f"{1e3 * seconds / frames:.3f}" if frames else "-"
        lines.append(f"{part:<16}{seconds:>10.1f}{share:>8.1%}{each:>10}")
    return "\n".join(lines)
