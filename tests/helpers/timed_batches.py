"""Batches whose observations are times, to recognise which rows a replay buffer returns."""

import torch
from tensordict import TensorDict

from veca_marl.algos.specs import ActionLayout, ArrayLayout, TeamSpec

SPEC = TeamSpec(
    agents=2,
    observations={"time": ArrayLayout((), "float32", 0.0, 1e6)},
    actions={"action": ActionLayout(discrete=False, size=1)},
    masked=True,
)


def batch_of(worlds=2, steps=6, done=(), terminated=(), eliminated=(), start=0.0):
    """Return a batch in which an observation is 1000 x world + time, and a reward 1 + time.

    `done` and `terminated` name (world, step) of all agents, `eliminated` (world, step) after
    which the second agent is eliminated until the episode ends.
    """
    lead = (worlds, steps, 2)
    clock = torch.arange(steps).float() + start
    time = (1000.0 * torch.arange(worlds)[:, None] + clock).unsqueeze(-1).expand(lead)
    flags = {
        "done": torch.zeros(worlds, steps, 1, dtype=torch.bool),
        "terminated": torch.zeros(*lead, 1, dtype=torch.bool),
    }
    mask = torch.ones(worlds, steps + 1, 2, dtype=torch.bool)
    for world, step in (*done, *terminated):
        flags["done"][world, step] = True
    for world, step in terminated:
        flags["terminated"][world, step] = True
    for world, step in eliminated:
        flags["terminated"][world, step:, 1] = True
        mask[world, step + 1 :, 1] = False
    return TensorDict(
        {
            "team": {
                "observation": {"time": time},
                "action": time.unsqueeze(-1) / 1e4,
                "mask": mask[:, :-1],
            },
            "next": {
                "done": flags["done"],
                "team": {
                    "observation": {"time": time + 0.5},
                    "mask": mask[:, 1:],
                    "reward": (1.0 + clock)[None, :, None, None].expand(*lead, 1),
                    "terminated": flags["terminated"],
                },
            },
        },
        (worlds, steps),
    )
