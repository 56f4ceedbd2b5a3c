"""Which policy plays: the keyboard, the expert, the random policy, or that of a run."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from tensordict import TensorDictBase
from torch import nn

from veca_marl.algos.checkpoints.stored import load_actor
from veca_marl.algos.evaluation.evaluate import Exploration, RandomTeams
from veca_marl.config import Config, ConfigError, compose, one_line
from veca_marl.envs.adapters.torchrl.scripted import ExpertPolicy
from veca_marl.envs.core.expert import find_expert
from veca_marl.play.session import PolicyMaker
from veca_marl.runs.assembly import read_specs
from veca_marl.runs.stored_policies import stored_actors, stored_configuration

KEYBOARD, EXPERT, RANDOM = "keyboard", "expert", "random"


@dataclass(frozen=True)
class Choice:
    """What is played by which policy.

    Attributes:
        cfg: The configuration.
        make_policy: Returns the policy for an environment of its game.
        exploration: That of the run's evaluations; deterministic without a run.
    """

    cfg: Config
    make_policy: PolicyMaker
    exploration: Exploration


class InTurn(nn.Module):
    """Policies that write one after another; a later one overwrites the actions of its teams."""

    def __init__(self, policies: Sequence[nn.Module]) -> None:
        super().__init__()
        self.policies = nn.ModuleList(policies)

    def forward(self, tensordict: TensorDictBase) -> TensorDictBase:
        """Write the actions of all teams."""
        for policy in self.policies:
            tensordict = policy(tensordict)
        return tensordict


def choose(policy: str, overrides: Sequence[str], keyboard: PolicyMaker | None = None) -> Choice:
    """Return what a policy plays.

    Args:
        policy: ``keyboard``, ``expert``, ``random``, the folder of a run, or a checkpoint in it.
        overrides: The configuration, such as ``+task=KickTheBall``; of a run, changes of its own.
        keyboard: Returns the policy that is called ``keyboard``; None if there are no keys.

    Raises:
        ConfigError: If there is no such policy, or the configuration is impossible.
        CheckpointError: If a stored policy does not fit.
    """
    if policy == EXPERT:
        cfg = compose(overrides)
        _require_expert(cfg)
        return _with_opponents(cfg, ExpertPolicy)
    if policy == KEYBOARD and keyboard is not None:
        return _with_opponents(compose(overrides), keyboard)
    if policy == RANDOM:
        cfg = compose(overrides)
        return _with_opponents(cfg, lambda env: RandomTeams(env, list(env.group_map)))
    if not Path(policy).exists():
        names = [EXPERT, RANDOM] if keyboard is None else [KEYBOARD, EXPERT, RANDOM]
        raise ConfigError(f"policy={policy}: choices: {', '.join(names)}, a run, a checkpoint")
    return _stored(Path(policy), overrides)


def _require_expert(cfg: Config) -> None:
    try:
        find_expert(cfg.task.name)
    except ValueError as error:
        raise ConfigError(f"policy={EXPERT}: {one_line(error)}") from error


def _stored(path: Path, overrides: Sequence[str]) -> Choice:
    cfg = stored_configuration(path, overrides, "policy=")
    actors = stored_actors(cfg, path, read_specs(cfg.game))
    return Choice(cfg, lambda env: InTurn(list(actors.values())), cfg.eval.exploration)


def _with_opponents(cfg: Config, make: PolicyMaker) -> Choice:
    """Return a choice in which `opponent.TEAM=RUN` play their own policies."""
    specs = read_specs(cfg.game) if cfg.frozen else {}
    actors = {team: load_actor(path, team, specs[team]) for team, path in cfg.frozen.items()}
    return Choice(cfg, lambda env: InTurn([make(env), *actors.values()]), Exploration.deterministic)
