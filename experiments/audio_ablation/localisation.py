"""Error of localisation of each quality of hearing, over the number of scenes learnt from.

python -m experiments.audio_ablation.localisation
"""

from __future__ import annotations

from pathlib import Path

from tools.fidelity.hearing.localisation import ARMS, localisation

TRAIN = (2_500, 10_000, 40_000)
TEST = 2_000
QUALITIES = ("hrtf", "stereo", "mono")


def main() -> None:
    """Measure, print and write `localisation.csv`."""
    lines = ["quality,scenes,azimuth_deg,lateral_deg,confused_percent"]
    for quality in QUALITIES:
        for train in TRAIN:
            found = localisation(ARMS[quality], train, TEST)
            numbers = (found.azimuth_deg, found.lateral_deg, 100.0 * found.confused)
            lines.append(f"{quality},{train}," + ",".join(f"{number:.1f}" for number in numbers))
            print(lines[-1], flush=True)
    (Path(__file__).parent / "localisation.csv").write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
