"""Return of the scripted expert of KickTheBall, which reads `audio` alone, by quality of hearing.

python experiments/audio_ablation/expert.py
"""

from __future__ import annotations

from pathlib import Path

import veca_marl
from veca_marl.envs.adapters.torchrl.scripted import ExpertPolicy

EPISODES, STEPS = 32, 500
QUALITIES = ("hrtf", "stereo", "mono")


def main() -> None:
    """Measure, print and write `expert.csv`."""
    lines = ["quality,episodes,return,standard_error"]
    for quality in QUALITIES:
        senses = {"audio": quality, "vision": "blind"}
        env = veca_marl.make("KickTheBall", worlds=EPISODES, senses=senses, seed=0)
        rollout = env.rollout(STEPS, policy=ExpertPolicy(env), break_when_any_done=False)
        returns = rollout["next", "agents", "reward"].sum(1).flatten()
        error = float(returns.std()) / EPISODES**0.5
        lines.append(f"{quality},{EPISODES},{float(returns.mean()):.2f},{error:.2f}")
        print(lines[-1], flush=True)
        env.close()
    (Path(__file__).parent / "expert.csv").write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
