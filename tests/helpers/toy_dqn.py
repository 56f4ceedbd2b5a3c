"""A minimal off-policy algorithm: what an algorithm with a replay buffer needs of the interface.

Q-learning (Mnih et al. 2015) with a small multilayer perceptron on the audio of `FakeEnv`, for an
action without named parts that is one of n choices.
"""

from dataclasses import dataclass

import torch
from tensordict import TensorDict
from tensordict.nn import TensorDictModule, TensorDictSequential
from torch import nn
from torchrl.data import Categorical, LazyTensorStorage, TensorDictReplayBuffer
from torchrl.modules import EGreedyModule

from veca_marl.algos.algorithm import Algorithm, AlgorithmCfg, register_algorithm
from veca_marl.algos.policy import UniformWarmUp
from veca_marl.algos.specs import PLAIN


@dataclass
class ToyDQNCfg(AlgorithmCfg):
    name: str = "toy_dqn"
    capacity: int = 4096
    batch: int = 32
    updates: int = 8
    learning_rate: float = 1e-2
    warm_up_frames: int = 128
    epsilon: float = 0.1

    def check_batch(self, worlds, steps):
        if worlds * steps < 4:
            raise ValueError(f"toy_dqn needs batches of at least 4 frames, got {worlds * steps}")


class ToyDQN(Algorithm):
    """Keeps its replay buffer in the checkpoint, and therefore resumes exactly."""

    exact_resume = True

    def __init__(self, team, spec, cfg, device):
        self.team, self.cfg, self.device = team, cfg, device
        self.frames = 0
        choices = spec.actions[PLAIN].size
        width = spec.observations["audio"].shape
        values = nn.Sequential(
            nn.Flatten(-len(width)),
            nn.Linear(width[0] * width[1], 32),
            nn.ReLU(),
            nn.Linear(32, choices),
        ).to(device)
        key = (team, "action_value")
        self.values = TensorDictModule(
            values, in_keys=[(team, "observation", "audio")], out_keys=[key]
        )
        greedy = TensorDictModule(
            lambda q: q.argmax(-1), in_keys=[key], out_keys=[(team, "action")]
        )
        self._actor = TensorDictSequential(self.values, greedy)
        noise = EGreedyModule(
            Categorical(choices, shape=()), cfg.epsilon, cfg.epsilon, action_key=(team, "action")
        )
        self.warm_up = UniformWarmUp(team, spec)
        self._explorer = TensorDictSequential(self._actor, noise, self.warm_up).to(device)
        self.optimizer = torch.optim.Adam(values.parameters(), cfg.learning_rate)
        self.buffer = self._new_buffer()

    def _new_buffer(self):
        return TensorDictReplayBuffer(
            storage=LazyTensorStorage(self.cfg.capacity), batch_size=self.cfg.batch
        )

    @property
    def actor(self):
        return self._actor

    @property
    def explorer(self):
        return self._explorer

    @property
    def measures(self):
        return ["td_error", "replay_size"]

    def learn(self, batch):
        team = self.team
        keys = [(team, "observation"), (team, "action"), ("next", team, "reward")]
        keys += [("next", team, "observation"), ("next", team, "terminated")]
        self.buffer.extend(batch.select(*keys).reshape(-1))
        self.frames += batch.numel()
        self.warm_up.active.fill_(self.frames < self.cfg.warm_up_frames)
        errors = [self._update(self.buffer.sample()) for _ in range(self.cfg.updates)]
        return {"td_error": sum(errors) / len(errors), "replay_size": float(len(self.buffer))}

    def _update(self, rows):
        team = self.team
        q = self.values(rows.clone(False))[team, "action_value"]
        with torch.no_grad():
            following = self.values(rows["next"].clone(False))[team, "action_value"].amax(-1)
            going_on = ~rows["next", team, "terminated"].squeeze(-1)
            target = rows["next", team, "reward"].squeeze(-1) + 0.5 * following * going_on
        chosen = q.gather(-1, rows[team, "action"].unsqueeze(-1)).squeeze(-1)
        loss = (chosen - target).square().mean()
        self.optimizer.zero_grad()
        loss.backward()
        self.optimizer.step()
        return float(loss.detach())

    def state_dict(self):
        return {
            "explorer": self._explorer.state_dict(),
            "optimizer": self.optimizer.state_dict(),
            "frames": self.frames,
            "replay": self.buffer[:].to_dict() if len(self.buffer) else None,
        }

    def load_state_dict(self, state):
        self._explorer.load_state_dict(state["explorer"])
        self.optimizer.load_state_dict(state["optimizer"])
        self.frames = state["frames"]
        self._load_replay(state["replay"])

    def _load_replay(self, replay):
        self.buffer = self._new_buffer()
        if replay is not None:
            self.buffer.extend(TensorDict(replay, [len(replay["index"])]))


@dataclass
class ForgetfulDQNCfg(ToyDQNCfg):
    name: str = "forgetful_dqn"


class ForgetfulDQN(ToyDQN):
    """Leaves its replay buffer out of the checkpoint: small files, no exact continuation."""

    exact_resume = False

    def state_dict(self):
        return super().state_dict() | {"replay": None}


def register():
    """Make both known; twice is the same as once."""
    register_algorithm("toy_dqn", ToyDQNCfg, ToyDQN)
    register_algorithm("forgetful_dqn", ForgetfulDQNCfg, ForgetfulDQN)
