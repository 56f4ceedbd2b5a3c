"""The overrides of an arm of an experiment, and those of the command line beside them."""

from __future__ import annotations

from collections.abc import Sequence

from veca_marl.config.errors import ConfigError
from veca_marl.config.experiment import ExperimentCfg
from veca_marl.config.overrides import with_integers


def check_arm(experiment: ExperimentCfg, overrides: Sequence[str]) -> None:
    """Check that a run that belongs to an arm has the overrides of the arm.

    Args:
        experiment: The experiment, with the arm of the run; an arm that it has not is not checked.
        overrides: All overrides of the run.

    Raises:
        ConfigError: If some are missing: ``experiment.arm`` alone changes nothing.
    """
    arm, given = experiment.arm, with_integers(overrides)
    if arm is None or arm not in experiment.arms:
        return
    missing = [text for text in with_integers(experiment.arms[arm]) if text not in given]
    if missing:
        raise ConfigError(
            f"experiment.arm={arm} is a run without {', '.join(missing)}: "
            f"python -m veca_marl.train -m +experiment={experiment.name} experiment.arm={arm} "
            "adds the overrides of an arm"
        )


def check_contradictions(arm: str, own: Sequence[str], overrides: Sequence[str]) -> None:
    """Check that no override of a command is also set by an arm, which would replace it.

    Args:
        arm: Name of the arm.
        own: Overrides of the arm.
        overrides: Overrides of the command.

    Raises:
        ConfigError: If there is one.
    """
    by_key = {_key(text): text for text in own}
    for text in overrides:
        other = by_key.get(_key(text))
        if other is not None and other != text:
            raise ConfigError(
                f"{text}: arm {arm} sets {other}; give experiment.arms.{arm}=[...] instead"
            )


def _key(override: str) -> str:
    return override.lstrip("+~").partition("=")[0]
