"""What the bench found, for people and for programs."""

from __future__ import annotations

import json
import os
import platform
from dataclasses import asdict
from importlib.metadata import version

from veca_marl.bench.references import References
from veca_marl.bench.rollouts import Rollouts


def rollouts_table(run: Rollouts) -> str:
    """Return the cost of a game as a table, dearest part first."""
    total = sum(run.ms_per_part.values())
    lines = [
        f"{run.task} in {run.playground}: {run.worlds} x world, {run.agents} x agent",
        f"  {run.agent_steps_per_s:,.0f} agent-steps/s "
        f"(on the wall clock {run.wall_agent_steps_per_s:,.0f}); "
        f"one more world is built in {run.build_s:.2f} s",
        f"  {'part':<16}{'ms/agent-step':>14}{'share':>8}",
    ]
    for part, ms in sorted(run.ms_per_part.items(), key=lambda item: -item[1]):
        lines.append(f"  {part:<16}{ms:>14.3f}{ms / total:>8.0%}")
    lines.append(f"  {'all, timed':<16}{total:>14.3f}{1:>8.0%}")
    lines.append(f"  neither physics nor senses: {run.other_share:.0%}")
    return "\n".join(lines)


def references_table(references: References) -> str:
    """Return the costs beside references."""
    eye, skin = references.eye, references.skin
    touch = ", ".join(f"{ms:.3f} ms with {things}" for things, ms in skin.touch_ms.items())
    return (
        f"one eye view 84x84, {eye.primitives} primitives: {eye.ours_ms:.3f} ms; "
        f"TinyRenderer {eye.tiny_ms:.2f} ms: {eye.times_as_fast:.1f} times as fast\n"
        f"ears, 1 listener and 1 source, HRTF: {references.ears_ms:.3f} ms per step\n"
        f"touch, one reading of 9888 taxels by the things on the skin: {touch}\n"
        f"skinning: {skin.skinning_ms:.3f} ms"
    )


def as_json(first_world_s: float, runs: list[Rollouts], references: References | None) -> str:
    """Return all numbers for programs."""
    content = {
        "machine": machine(),
        "first_world_s": first_world_s,
        "rollouts": [asdict(run) for run in runs],
        "references": None if references is None else asdict(references),
    }
    return json.dumps(content, indent=2) + "\n"


def machine() -> dict[str, str | int | None]:
    """Return on what it was measured."""
    packages = {name: version(name) for name in ("numpy", "numba", "torch", "torchrl", "pybullet")}
    return {
        "python": platform.python_version(),
        "machine": platform.machine(),
        "cores": os.cpu_count(),
        **packages,
    }
