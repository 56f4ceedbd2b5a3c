"""Write the example pages of episodes in ``docs/episodes``; the results are committed.

Run it with ``python -m tools.make_episodes``. ``docs/images/episode.png`` is a screenshot of
``push_out.html#t=2.6`` in a headless Chromium of 1280 x 857 pixels.
"""

from __future__ import annotations

from pathlib import Path

import veca_marl

FOLDER = Path(__file__).resolve().parent.parent / "docs" / "episodes"
EPISODES = {
    "kick_the_ball": ("KickTheBall", 10.0),
    "grab_object": ("GrabObject", 6.0),
    "push_out": ("PushOut1v1", 10.0),
}
"""Task and seconds of each page: a walker that hears, hands that feel, two bodies that wrestle."""


def main() -> None:
    """Write all pages."""
    for name, (task, seconds) in EPISODES.items():
        path = veca_marl.save_episode(FOLDER / f"{name}.html", task, seed=1, longest_s=seconds)
        print(f"{path}: {path.stat().st_size / 1e6:.1f} MB")


if __name__ == "__main__":
    main()
