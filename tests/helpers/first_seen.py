"""A tiny policy with hidden state: it stores the first observation of an episode and repeats it.

The environment shows a number at the start of an episode only; the reward of every step is 1 for
the action that equals it. Only a policy that remembers gets more than half of the rewards.
"""

from dataclasses import dataclass

import torch
from fake_env import FakeEnv
from tensordict.nn import TensorDictModuleBase
from torch import nn
from torchrl.modules.tensordict_module.rnn import recurrent_mode

from veca_marl.algos.networks.factory import NetworkCfg, NetworkFactory, register_network
from veca_marl.algos.networks.memory import memory_primer


class ShowOnceEnv(FakeEnv):
    """`FakeEnv` with a state that stays for an episode, and is audible in its first step alone."""

    def _draw(self, i):
        if self.clock[i] == 0:
            super()._draw(i)

    def _senses(self):
        senses = super()._senses()
        later = torch.from_numpy(self.clock > 0)
        senses["audio"][later] = -3.0
        return senses


def make_show_once(worlds, seed, horizons=(3, 5, 4), **options):
    env = ShowOnceEnv(worlds, seed, discrete=True, senses=("audio",), **options)
    env.horizon = torch.tensor([horizons[w % len(horizons)] for w in range(worlds)]).numpy()
    return env


@dataclass
class FirstSeenCfg(NetworkCfg):
    name: str = "first_seen"

    @property
    def recurrent(self):
        return True


class Remember(TensorDictModuleBase):
    """Writes the audio of the first step of the episode as features, in every step."""

    def __init__(self, team, agents):
        super().__init__()
        self.team, self.agents = team, agents
        self.key = (team, "memory", "first")
        self.in_keys = [(team, "observation", "audio"), "is_init", self.key]
        self.out_keys = [(team, "features"), ("next", *self.key)]
        self.scale = nn.Parameter(torch.ones(()))

    def forward(self, td):
        heard = td[self.team, "observation", "audio"][..., 0, :1]
        begins = td["is_init"].unsqueeze(-1).expand_as(heard)
        first = torch.where(begins, heard, td[self.key])
        if recurrent_mode():  # only the state before the first step of a sequence is an input
            for t in range(1, heard.shape[1]):
                first[:, t] = torch.where(begins[:, t], heard[:, t], first[:, t - 1])
        td[self.team, "features"] = (first + 3.0) / 3.0 * self.scale
        td["next", *self.key] = first
        return td

    def make_tensordict_primer(self):
        return memory_primer(self.team, self.agents, {"first": (1,)})


class FirstSeen(NetworkFactory):
    features = 1

    def encoder(self):
        return Remember(self.team, self.spec.agents)


register_network("first_seen", FirstSeenCfg, FirstSeen)
