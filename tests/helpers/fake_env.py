"""A toy with the keys of VecaEnv: each world shows one of two states; act with its sign.

The state is visible (a dark or bright image) and audible (a low or high spectrum). The reward is 1
for the right sign and -1 for the wrong one; a new state is drawn after every step. The return of a
policy that uses an observation is `horizon`, that of any other 0 on average.

`hybrid` gives the action two parts, a vector `move` and a choice `voice`; the reward is the mean
over both. `global_state` adds the key "state": the states of all agents.
"""

import numpy as np
import torch
from tensordict import TensorDict
from torchrl.data import Bounded, Categorical, Composite, Unbounded
from torchrl.envs import EnvBase

SENSES = ("vision", "audio")


class FakeEnv(EnvBase):
    def __init__(
        self,
        worlds=4,
        seed=0,
        horizon=8,
        agents=1,
        discrete=False,
        hybrid=False,
        senses=SENSES,
        teams=("agents",),
        image=16,
        global_state=False,
    ):
        super().__init__(batch_size=torch.Size([worlds]))
        self.first_world = 0
        self.horizon, self.senses, self.image = horizon, senses, image
        self.discrete, self.hybrid = discrete, hybrid
        self.group_map = {t: [f"{t}_{i}" for i in range(agents)] for t in teams}
        self.agents = agents
        lead = (worlds, agents)
        leaves = {
            "vision": Bounded(0, 255, shape=(*lead, 2, 3, image, image), dtype=torch.uint8),
            "audio": Bounded(-8.0, 3.0, shape=(*lead, 2, 10), dtype=torch.float32),
        }
        observation = Composite({s: leaves[s] for s in senses}, shape=lead)
        choice = Categorical(2, shape=lead)
        vector = Bounded(-1.0, 1.0, shape=(*lead, 2), dtype=torch.float32)
        action = choice if discrete else vector
        if hybrid:
            action = Composite({"move": vector, "voice": choice}, shape=lead)

        def per_team(leaf):
            return Composite({t: Composite(leaf, shape=lead) for t in teams}, shape=(worlds,))

        def flags(shape):
            return {
                k: Categorical(2, shape=(*shape, 1), dtype=torch.bool)
                for k in ("done", "terminated", "truncated")
            }

        self.observation_spec = per_team({"observation": observation})
        for t in teams:
            self.observation_spec[t, "info"] = Composite(
                {"right": Unbounded(shape=(*lead, 1))}, shape=lead
            )
        if global_state:
            self.observation_spec["state"] = Unbounded(shape=(worlds, agents))
        self.action_spec = per_team({"action": action})
        self.reward_spec = per_team({"reward": Unbounded(shape=(*lead, 1))})
        done = per_team(flags(lead))
        done.update(flags((worlds,)))
        self.done_spec = done
        self.set_seed(seed)

    def _set_seed(self, seed):
        seed = 0 if seed is None else seed
        self.seed_of_episodes = seed
        self.rngs = [None] * self.batch_size[0]
        self.episodes = np.full(self.batch_size[0], -1)
        self.state = np.zeros((self.batch_size[0], self.agents), dtype=np.int64)
        self.clock = np.zeros(self.batch_size[0], dtype=np.int64)

    def _draw(self, i):
        self.state[i] = self.rngs[i].integers(0, 2, self.agents)

    def _senses(self):
        state = torch.from_numpy(self.state.copy())
        lead = tuple(state.shape)
        arrays = {
            "vision": (state * 200 + 20)
            .to(torch.uint8)[..., None, None, None, None]
            .expand(*lead, 2, 3, self.image, self.image)
            .clone(),
            "audio": (state * 6.0 - 6.0)[..., None, None].expand(*lead, 2, 10).float().clone(),
        }
        return {s: arrays[s] for s in self.senses}

    def _team(self, right):
        return TensorDict(
            {"observation": self._senses(), "info": {"right": right.clone()}}, right.shape[:2]
        )

    def _reset(self, tensordict=None, **kwargs):
        mask = None if tensordict is None else tensordict.get("_reset", None)
        rows = range(self.batch_size[0]) if mask is None else np.flatnonzero(mask.numpy())
        for i in rows:
            self.clock[i] = 0
            self.episodes[i] += 1  # an episode depends on (seed, world, episode) alone
            self.rngs[i] = np.random.default_rng(
                [self.seed_of_episodes, self.first_world + i, self.episodes[i]]
            )
            self._draw(i)
        zero = torch.zeros(self.batch_size[0], self.agents, 1)
        teams = {t: self._team(zero) for t in self.group_map}
        return TensorDict({**teams, **self._global_state()}, self.batch_size)

    def _global_state(self):
        if "state" not in self.observation_spec.keys():  # noqa: SIM118  a spec
            return {}
        return {"state": torch.from_numpy(self.state.copy()).float()}

    def _sign(self, action):
        """Return the sign of the action; with two parts the mean of theirs."""
        if self.hybrid:
            return (action["move"][..., 0].sign() + action["voice"] * 2.0 - 1.0) / 2.0
        return action * 2.0 - 1.0 if self.discrete else action[..., 0].sign()

    def _step(self, td):
        wanted = torch.from_numpy(self.state * 2.0 - 1.0)
        rights = {}
        for t in self.group_map:
            rights[t] = (self._sign(td[t, "action"]) * wanted).float().unsqueeze(-1)
        self.clock += 1
        for i in range(self.batch_size[0]):
            self._draw(i)
        truncated = torch.from_numpy(self.clock >= self.horizon).unsqueeze(-1)
        terminated = torch.zeros_like(truncated)
        out = TensorDict({t: self._team(r) for t, r in rights.items()}, self.batch_size)
        out.update(self._global_state())
        out.update({"done": truncated, "truncated": truncated.clone(), "terminated": terminated})
        for t, right in rights.items():
            flag = truncated.unsqueeze(1).expand(-1, self.agents, -1)
            out[t].update(
                {
                    "reward": right,
                    "done": flag.clone(),
                    "truncated": flag.clone(),
                    "terminated": torch.zeros_like(flag),
                }
            )
        return out


def make_fake_env(worlds, seed, **kwargs):
    return FakeEnv(worlds=worlds, seed=seed, **kwargs)
