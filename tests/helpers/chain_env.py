"""A chain of cells: a step forward costs a little, and only its end is rewarded."""

import numpy as np
import torch
from fake_env import FakeEnv

CELLS = 20


class ChainEnv(FakeEnv):
    """The position is audible (one-hot); the two choices are a cell back and a cell forward."""

    def __init__(self, worlds=16, seed=0, horizon=32):
        super().__init__(worlds, seed, horizon, discrete=True, senses=("audio",))

    def _draw(self, i):
        self.state[i] = 0

    def _senses(self):
        cells = torch.nn.functional.one_hot(torch.from_numpy(self.state.copy()), CELLS)
        return {"audio": cells.float().unflatten(-1, (2, 10))}

    def _step(self, td):
        moved = self.state + 2 * td["agents", "action"].numpy() - 1
        position = np.clip(moved, 0, CELLS - 1)
        step = super()._step(td)  # flags and layout; it sets the state to the start of the chain
        self.state[:] = position
        reward = np.where(position == CELLS - 1, 1.0, -0.01 * td["agents", "action"].numpy())
        reward = torch.from_numpy(reward).float().unsqueeze(-1)
        step["agents"].update(self._team(reward))
        return step.set(("agents", "reward"), reward)


def make_chain(worlds, seed):
    return ChainEnv(worlds, seed)
