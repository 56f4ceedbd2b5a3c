"""Batches of random arrays with the keys and types of a team, without a world."""

import torch
from tensordict import TensorDict

from veca_marl.algos.specs import action_key


def random_batch(specs, worlds=2, steps=8):
    """Return experience ``(worlds, steps)`` of teams; an episode is truncated in each world.

    Args:
        specs: Team to its `TeamSpec`.
        worlds: Number of worlds.
        steps: Steps of each world.
    """
    batch = TensorDict({}, (worlds, steps))
    done = torch.zeros(worlds, steps, 1, dtype=torch.bool)
    done[:, steps // 2] = True
    batch["next", "done"] = done
    for team, spec in specs.items():
        lead = (worlds, steps, spec.agents)
        for name, layout in spec.observations.items():
            for key in ((team, "observation", name), ("next", team, "observation", name)):
                batch[key] = _observation(layout, lead)
        for part, layout in spec.actions.items():
            batch[action_key(team, part)] = _action(layout, lead)
        if spec.masked:
            batch[team, "mask"] = batch["next", team, "mask"] = torch.ones(lead, dtype=torch.bool)
        batch["next", team, "reward"] = torch.rand(*lead, 1)
        batch["next", team, "done"] = done.unsqueeze(2).expand(*lead, 1)
        batch["next", team, "terminated"] = torch.zeros(*lead, 1, dtype=torch.bool)
    return batch


def _observation(layout, lead):
    if layout.dtype == "uint8":
        return torch.randint(0, 256, (*lead, *layout.shape), dtype=torch.uint8)
    return torch.rand(*lead, *layout.shape)


def _action(layout, lead):
    if layout.discrete:
        return torch.randint(layout.size, lead)
    return torch.rand(*lead, layout.size) * 2.0 - 1.0
