"""The tables of the page about the body: ages, proprioception, bones and joints."""

from __future__ import annotations

import re

import numpy as np

from tools.docs_pages.tables import table
from veca_marl.sim.body.anatomy import (
    REFERENCE,
    Growth,
    growth_at,
    limit_sources,
    load_skeleton,
)
from veca_marl.sim.body.proprioception import ProprioceptionQuality, observed_parts, part_slices
from veca_marl.sim.body.sense_organs import MOUNTS_M
from veca_marl.sim.body.walker import WalkerCfg
from veca_marl.sim.touch import taxels_of
from veca_marl.sim.vision.image_filters import acuity_cpd

AGES_MONTHS = (1, 4, 8, 12, 18, 24, 36)

PARTS = {
    "bone_orientations": ("", "forward and up axis of each bone in the heading frame"),
    "joint_angles": ("rad", "angle of each joint"),
    "joint_velocities": ("rad/s", "angular velocity of each joint"),
    "joint_torques": ("", "motor torque as a fraction of the joint's strength, [-1, 1]"),
    "head_acceleration": ("m/s²", "mean acceleration in the head frame minus gravity"),
    "head_turning": ("rad/s", "angular velocity in the head frame"),
}


def body_page(page: str) -> str:
    """Return the page about the body with its tables as the data have them."""
    tables = {
        "ages": age_table,
        "proprioception": proprioception_table,
        "bones": bone_table,
        "joints": joint_table,
    }
    for name, make_table in tables.items():
        region = re.compile(f"(?<=<!-- {name} -->\n).*(?=<!-- /{name} -->)", re.DOTALL)
        page = region.sub("\n".join(["", *make_table(), "", ""]), page)
    return page


def proprioception_table() -> list[str]:
    """Return where each part of proprioception is in its vector, and which qualities have it."""
    skeleton = load_skeleton()
    rows = []
    for part, where in part_slices(len(skeleton.bones), len(skeleton.joints)).items():
        having = [f"`{q.name}`" for q in ProprioceptionQuality if part in observed_parts(q)]
        unit, meaning = PARTS[part]
        place = f"{where.start} to {where.stop - 1}"
        rows.append((place, f"`{part}`", unit, meaning, ", ".join(having)))
    return table(("index", "part", "unit", "content", "qualities that have it"), rows)


def age_table() -> list[str]:
    """Return sizes by age, with the present body in the first row."""
    rows = [_size_row("default", REFERENCE, "an adult's")]
    for age in AGES_MONTHS:
        acuity = f"{acuity_cpd(age):.1f}"
        rows.append(_size_row(f"{age} months", growth_at(float(age)), acuity))
    columns = (
        *("size", "height, m", "mass, kg", "head", "eyes: height, distance", "leg"),
        *("walking, m/s", "knee, N m", "voice", "acuity, cycles/degree"),
    )
    return table(columns, rows)


def _size_row(name: str, growth: Growth, acuity: str) -> tuple[str, ...]:
    skeleton = load_skeleton(growth)
    top, eye = skeleton.bones[skeleton.bone("head")].tip[2], MOUNTS_M["eye_left"]
    eyes_m = growth.height_m - top + eye[2] * growth.head_size
    knee = skeleton.joints[skeleton.joint("l_shank", "flexion")]
    return (
        name,
        f"{growth.height_m:.2f}",
        f"{skeleton.mass_kg:.1f}",
        f"{growth.head_size:.2f}",
        f"{eyes_m:.2f} m, {2000.0 * eye[1] * growth.head_size:.0f} mm",
        f"{growth.leg:.2f}",
        f"{WalkerCfg().walk_speed_mps * growth.speed:.2f}",
        f"{knee.torque_nm:.1f}",
        f"{growth.pitch:.2f}",
        acuity,
    )


def bone_table() -> list[str]:
    """Return the bones, left and right in one row."""
    skeleton = load_skeleton()
    index = {bone.name: i for i, bone in enumerate(skeleton.bones)}
    rows = []
    for bone in skeleton.bones:
        if bone.name.startswith("r_"):
            continue
        sides = both_sides(bone.name)
        slices = [taxels_of(side) for side in sides]
        rows.append(
            (
                f"`{bone.name}`",
                " / ".join(str(index[side]) for side in sides),
                skeleton.bones[bone.parent].name if bone.parent >= 0 else "",
                f"{1000 * bone.mass_kg:g} g",
                f"{1000 * bone.skin_thickness_m:g} mm, {bone.skin_force_n:g} N",
                " / ".join(f"{s.start}:{s.stop}" for s in slices),
            )
        )
    return table(("`body.bone_names`", "index", "parent", "mass", "skin", "taxels"), rows)


def joint_table() -> list[str]:
    """Return the joints, left and right in one row."""
    joints = load_skeleton().joints
    names = [f"{joint.bone}.{joint.label}" for joint in joints]
    rows = []
    for name, joint, sources in zip(names, joints, limit_sources(), strict=True):
        if name.startswith("r_"):
            continue
        low, high = np.degrees([joint.low_rad, joint.high_rad])
        rows.append(
            (
                f"`{name}`",
                " / ".join(str(names.index(side)) for side in both_sides(name)),
                f"{low:.0f}° to {high:.0f}°",
                f"{joint.torque_nm:.3g} N m",
                " / ".join(dict.fromkeys(sources)),
            )
        )
    return table(("`body.joint_names`", "index", "range", "torque", "source of the range"), rows)


def both_sides(name: str) -> list[str]:
    """Return the names on the left and on the right, or the one in the middle."""
    return [name, f"r_{name[2:]}"] if name.startswith("l_") else [name]
