"""Create `veca_marl/data/kemar.npz` from the SOFA file of the KEMAR measurement.

Run: ``python -m tools.make_kemar MIT_KEMAR_normal_pinna.sofa``. The file is part of libmysofa
(in Debian: the package libmysofa1, /usr/share/libmysofa/MIT_KEMAR_normal_pinna.sofa).
"""

from __future__ import annotations

import argparse
from pathlib import Path

from veca_marl.sim.hearing import condition, read_sofa

LICENCE = (
    "HRTF measurements of a KEMAR dummy-head microphone. Copyright 1994 MIT Media Laboratory "
    "(Bill Gardner, Keith Martin). Provided free with no restrictions on use, provided the authors "
    "are cited when the data is used in any research or commercial application. Modified: "
    "resampled to 22050 Hz, diffuse-field equalised, low frequencies completed by a rigid sphere, "
    "minimum phase with separate arrival times, half precision."
)


def main() -> None:
    """Read the arguments, condition the measurement, write the file."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("sofa", type=Path, help="MIT_KEMAR_normal_pinna.sofa")
    parser.add_argument("--output", type=Path, default=Path("veca_marl/data/kemar.npz"))
    arguments = parser.parse_args()
    head = condition(read_sofa(arguments.sofa), sample_rate_hz=22_050, n_taps=128, licence=LICENCE)
    head.save(arguments.output)
    print(
        f"{arguments.output}: {len(head.directions)} directions, head radius "
        f"{head.head_radius_m * 100:.2f} cm, {arguments.output.stat().st_size / 1000:.0f} kB"
    )


if __name__ == "__main__":
    main()
