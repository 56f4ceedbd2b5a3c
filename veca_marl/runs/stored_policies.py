"""What a run has learnt, to be played again: its configuration and its policies."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from tensordict.nn import TensorDictModuleBase

from veca_marl.algos.checkpoints.stored import load_actor
from veca_marl.algos.selfplay.self_play import SelfPlayCfg
from veca_marl.algos.specs import TeamSpec
from veca_marl.config import Config, ConfigError, to_config
from veca_marl.config.stored import change
from veca_marl.runs.run_folder import open_run


def stored_configuration(checkpoint: Path, overrides: Sequence[str], asked_by: str) -> Config:
    """Return the configuration stored with a run, changed by overrides, for playing alone.

    Args:
        checkpoint: Folder of a run, or a checkpoint in it.
        overrides: Changes of the configuration.
        asked_by: The option that named it; error messages begin with it.

    Raises:
        ConfigError: If there is no run, or a change is impossible.
    """
    if checkpoint.is_file() and checkpoint.suffix != ".pt":
        raise ConfigError(f"{asked_by}{checkpoint} is no checkpoint; give a run, or a checkpoint")
    folder = open_run(checkpoint.parent.parent if checkpoint.is_file() else checkpoint, asked_by)
    node = folder.typed_config()
    # nothing is learnt here
    node.self_play, node.learner, node.init_from, node.init_encoders = SelfPlayCfg(), {}, {}, {}
    node.team_intrinsic = {}
    change(node, overrides)
    return to_config(node)


def stored_actors(
    cfg: Config, checkpoint: Path, specs: Mapping[str, TeamSpec]
) -> dict[str, TensorDictModuleBase]:
    """Return the policy of each team that is not scripted.

    Args:
        cfg: What `stored_configuration` returned; its `frozen` teams have policies of other runs.
        checkpoint: Folder of the run, or a checkpoint in it.
        specs: The arrays of the teams.

    Raises:
        CheckpointError: If a policy does not fit.
    """
    return {
        team: load_actor(cfg.frozen.get(team, checkpoint), team, spec)
        for team, spec in specs.items()
    }
