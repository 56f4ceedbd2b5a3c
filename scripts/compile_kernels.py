"""Compile the kernels of the simulator, so that test processes find them in the cache.

Otherwise each of them compiles the same kernels at its start. ``make test`` runs this beside mypy,
which uses one core.
"""

from __future__ import annotations

from veca_marl.api import make

TASKS = (
    "KickTheBall",
    "TurnBaby",
    "PushOut2v2",
    "MultiAgentNav",
    "ObjectPhysNav",
    "BabyzumasRevenge",
    "ShapeSort",
)
"""They have walkers and joints, skin, furniture, several agents, a house with voices, verbs, doors,
and polyhedra for the eyes and the skin."""


def main() -> None:
    """Play two steps of each task."""
    for task in TASKS:
        env = make(task, seed=0)
        env.rollout(2)
        env.close()


if __name__ == "__main__":
    main()
