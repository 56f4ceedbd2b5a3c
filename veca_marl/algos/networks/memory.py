"""Policies with hidden state: what an environment must carry for them from step to step.

A module with hidden state has a method ``make_tensordict_primer`` (as TorchRL's `LSTMModule` and
`GRUModule` have): a `TensorDictPrimer` with the spec of the state. It reads the state, writes the
new one under ``"next"``, and the environment carries it on. At the start of an episode the primer
writes the initial state, in those worlds alone that start anew.
"""

from __future__ import annotations

from torch import nn
from torchrl.envs import Compose, EnvBase, InitTracker, TransformedEnv
from torchrl.modules.utils import get_primers_from_module


def with_memory(env: EnvBase, policy: object) -> EnvBase:
    """Return `env` with what `policy` needs to remember; `env` itself if it has no hidden state.

    Args:
        env: The environment.
        policy: A module; any other callable has no hidden state.
    """
    primers = get_primers_from_module(policy, warn=False) if isinstance(policy, nn.Module) else None
    if primers is None:
        return env
    return TransformedEnv(env, Compose(InitTracker(), primers))
