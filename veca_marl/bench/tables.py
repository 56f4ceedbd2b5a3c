"""Results of the benchmark as tables, one for each question, and as JSON."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict

from veca_marl.bench.learning import Learning
from veca_marl.bench.references import DISTANT, References
from veca_marl.bench.rollouts import Rollouts


def throughput_table(runs: Sequence[Rollouts]) -> str:
    """Return the answer to: how many agent steps per second?"""
    header = ["task", "playground", "worlds", "agents", "agent steps/s", "elapsed"]
    header += ["per reference", "views"]
    rows = [
        [
            run.task,
            run.playground,
            str(run.worlds),
            str(run.agents),
            f"{run.agent_steps_per_s:,.0f}",
            f"{run.wall_agent_steps_per_s:,.0f}",
            f"{run.agent_steps_per_reference:.2f}",
            f"{run.views_per_agent_step:.2f}",
        ]
        for run in runs
    ]
    note = (
        "agent steps per second of processor time, per second of elapsed time, and in the time of\n"
        "the reference workload; cost of an agent step in TinyRenderer views of 84x84; the last\n"
        "two are comparable between machines:"
    )
    return f"{note}\n{_table([*[header], *rows])}"


def task_table(runs: Sequence[Rollouts]) -> str:
    """Return a Markdown table with one row per task, playground and number of worlds."""
    header = ["task", "playground", "worlds", "agents", "agent steps/s", "per reference"]
    header += ["view, ms", "views", "goal"]
    rows = [
        (
            run.task,
            f"`{run.playground}`",
            str(run.worlds),
            str(run.agents),
            f"{run.agent_steps_per_s:,.0f}",
            f"{run.agent_steps_per_reference:.2f}",
            f"{run.view_ms:.2f}",
            f"{run.views_per_agent_step:.2f}",
            _goal(run),
        )
        for run in runs
    ]
    lines = [header, ["---"] * len(header), *rows]
    return "\n".join(f"| {' | '.join(cells)} |" for cells in lines)


def _goal(run: Rollouts) -> str:
    """Return the greatest number of views and whether it holds; nothing without a goal."""
    most = run.most_views_per_agent_step
    if most is None:
        return ""
    return f"{most:.1f}: {'met' if run.views_per_agent_step <= most else 'missed'}"


def parts_table(runs: Sequence[Rollouts]) -> str:
    """Return the answer to: which part of a step takes how long?"""
    columns = [f"{run.worlds} x {run.agents}" for run in runs]
    parts = sorted(
        {part for run in runs for part in run.ms_per_part},
        key=lambda part: -max(run.ms_per_part.get(part, 0.0) for run in runs),
    )
    rows = [["worlds x agents", *columns]]
    rows += [[part, *(_milliseconds(run.ms_per_part, part) for run in runs)] for part in parts]
    rows.append(["total", *(f"{sum(run.ms_per_part.values()):.3f}" for run in runs)])
    rows.append(["overhead", *(f"{run.overhead:.0%}" for run in runs)])
    rows.append(["build a world (s)", *(f"{run.build_s:.2f}" for run in runs)])
    note = "processor time per agent step (ms); overhead is what is neither physics nor senses:"
    return f"{note}\n{_table(rows)}"


def references_table(references: References) -> str:
    """Return the answer to: what do single senses cost?"""
    eye, skin, body = references.eye, references.skin, references.body
    rows = [
        ["part", "ms"],
        [f"eye, one view of 84x84 with {eye.primitives} primitives", f"{eye.ours_ms:.3f}"],
        ["the same view by TinyRenderer", f"{eye.tiny_ms:.3f}"],
        ["ratio TinyRenderer / eye", f"{eye.speed_ratio:.1f}"],
        ["ears, one listener and one source, HRTF", f"{references.ears_ms:.3f}"],
        *(
            [f"touch, 9888 taxels, {contacts} contacts", f"{ms:.3f}"]
            for contacts, ms in skin.touch_ms.items()
        ),
        [f"touch, 9888 taxels, 3 contacts, {DISTANT} distant balls", f"{skin.distant_ms:.3f}"],
        ["skinning of one body", f"{skin.skinning_ms:.3f}"],
        ["view of 84x84 of the skin of one body", f"{body.skin_ms:.3f}"],
        ["the same view of its bones", f"{body.bones_ms:.3f}"],
        ["from its own eye, most triangles out of view", f"{body.own_ms:.3f}"],
    ]
    return f"processor time of single parts:\n{_table(rows)}"


def learning_table(learning: Learning) -> str:
    """Return the answer to: how fast is learning, beside the simulator on all cores?"""
    rows = [
        ["algorithm", learning.algorithm],
        ["rollout, one core, frames/s", f"{learning.rollout_per_s:,.0f}"],
        ["cores", str(learning.cores)],
        ["rollouts on all cores at once, frames/s", f"{learning.rollouts_per_s:,.0f}"],
        ["learning with its evaluations, frames/s", f"{learning.frames_per_s:,.0f}"],
        ["learning / (cores x rollout)", f"{learning.ratio:.2f}"],
        ["learning / rollouts on all cores at once", f"{learning.ratio_at_once:.2f}"],
        ["processor time of a frame, rollout / learning", f"{learning.processor_ratio:.2f}"],
        *([f"seconds in {part}", f"{s:.1f}"] for part, s in learning.seconds.items()),
    ]
    return f"speed of learning:\n{_table(rows)}"


def as_json(
    machine: Mapping[str, object],
    first_world_s: float,
    runs: Sequence[Rollouts],
    references: References | None,
) -> str:
    """Return all results as JSON."""
    content = {
        "machine": dict(machine),
        "first_world_s": first_world_s,
        "rollouts": [asdict(run) for run in runs],
        "references": None if references is None else asdict(references),
    }
    return json.dumps(content, indent=2) + "\n"


def _milliseconds(ms_per_part: Mapping[str, float], part: str) -> str:
    return f"{ms_per_part[part]:.3f}" if part in ms_per_part else "-"


def _table(rows: Sequence[Sequence[str]]) -> str:
    """Return rows as aligned text: the first column to the left, the others to the right."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return "\n".join(
        "  " + "  ".join([row[0].ljust(widths[0]), *map(str.rjust, row[1:], widths[1:])]).rstrip()
        for row in rows
    )
