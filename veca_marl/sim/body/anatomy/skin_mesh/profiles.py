"""Cross-sections of the skin along the bones: the shape of a child of 0.78 m (`data/bones.csv`).

The numbers are our own design.
"""

from __future__ import annotations

# rings of each bone: place along the tube's axis, half width along the ring's first and second
# axis, shift of the centre along x (trunk) or z (foot); metres, in the frame of the bone
Ring = tuple[float, float, float, float]
TRUNK: dict[str, tuple[Ring, ...]] = {
    "pelvis": ((-0.035, 0.048, 0.064, 0.0), (0.005, 0.056, 0.078, -0.002), (0.05, 0.056, 0.072, 0)),
    "spine": ((0.042, 0.058, 0.070, 0.002), (0.085, 0.056, 0.071, 0.0)),
    "chest": ((0.045, 0.057, 0.080, 0.0), (0.1, 0.052, 0.074, 0.0), (0.138, 0.030, 0.036, 0.0)),
    "neck": ((0.036, 0.029, 0.030, 0.002),),
    "head": (
        (-0.004, 0.052, 0.047, 0.018),
        (0.030, 0.073, 0.060, 0.012),
        (0.065, 0.081, 0.064, 0.010),
        (0.100, 0.070, 0.055, 0.008),
        (0.124, 0.036, 0.030, 0.008),
    ),
}
ARM: dict[str, tuple[Ring, ...]] = {
    "l_upper_arm": (
        (0.010, 0.026, 0.024, 0.0),
        (-0.030, 0.029, 0.029, 0.0),
        (-0.075, 0.0285, 0.0285, 0.0),
        (-0.118, 0.0245, 0.0245, 0.0),
    ),
    "l_forearm": (
        (-0.030, 0.0245, 0.0240, 0.0),
        (-0.065, 0.0215, 0.0205, 0.0),
        (-0.095, 0.0185, 0.0145, 0.0),
    ),
    "l_hand": (
        (-0.012, 0.0210, 0.0115, 0.0),
        (-0.026, 0.0240, 0.0105, 0.0),
        (-0.040, 0.0250, 0.0100, 0.0),
        (-0.051, 0.0230, 0.0080, 0.0),
    ),
}
LEG: dict[str, tuple[Ring, ...]] = {
    "l_thigh": (
        (0.022, 0.045, 0.043, 0.0),
        (-0.040, 0.044, 0.0435, 0.0),
        (-0.100, 0.040, 0.040, 0.0),
        (-0.155, 0.0325, 0.0315, 0.0),
    ),
    "l_shank": (
        (-0.045, 0.0335, 0.0325, 0.0),
        (-0.090, 0.0265, 0.0260, 0.0),
        (-0.131, 0.0215, 0.0205, 0.0),
    ),
}
FOOT: tuple[Ring, ...] = (
    (-0.026, 0.0190, 0.0195, -0.0215),
    (0.000, 0.0225, 0.0255, -0.0165),
    (0.030, 0.0235, 0.0165, -0.0255),
    (0.060, 0.0255, 0.0115, -0.0305),
    (0.081, 0.0210, 0.0075, -0.0345),
)
FINGERS = {
    **dict.fromkeys(("index", "middle", "ring", "little"), ("proximal", "middle", "distal")),
    "thumb": ("metacarpal", "proximal", "distal"),
}
TRUNK_SECTORS, ARM_SECTORS, LEG_SECTORS, FOOT_SECTORS, FINGER_SECTORS = 12, 8, 10, 9, 6
