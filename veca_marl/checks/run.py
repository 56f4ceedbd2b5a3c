"""All checks of one game, in an order in which the quick ones come first."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import closing
from dataclasses import dataclass

from torchrl.envs import check_env_specs

from veca_marl.checks.episodes import (
    RANDOM_PLAY_NAMES,
    RETURN_NAMES,
    check_random_play,
    check_returns,
)
from veca_marl.checks.findings import Finding, Status, TaskReport, finding, guarded
from veca_marl.checks.starts import SEEDING_NAMES, START_NAMES, check_seeding, check_starts
from veca_marl.envs.adapters.torchrl.env import VecaEnv
from veca_marl.envs.core.game import Game
from veca_marl.envs.core.game_cfg import GameCfg

_TORCHRL = ("TorchRL specs",)


@dataclass(frozen=True)
class CheckCfg:
    """How much is played.

    Attributes:
        starts: Episodes of which the start is checked.
        steps: Steps of random actions for specifications, changes and cost.
        seeding_steps: Steps of each rollout that is compared with another.
        episodes: Whole episodes of each policy, at least 2.
        seed: Seed of everything.
    """

    starts: int = 50
    steps: int = 100
    seeding_steps: int = 20
    episodes: int = 5
    seed: int = 0

    def __post_init__(self) -> None:
        for name, least in (("starts", 1), ("steps", 1), ("seeding_steps", 1), ("episodes", 2)):
            if getattr(self, name) < least:
                raise ValueError(f"{name}={getattr(self, name)} must be at least {least}")
        if self.seed < 0:
            raise ValueError(f"seed={self.seed} must be 0 or more")


def check_game(cfg: GameCfg, checks: CheckCfg) -> TaskReport:
    """Make all checks of a game.

    Args:
        cfg: The game.
        checks: How much is played.

    Returns:
        The results. An exception of the task is a failed result with its type, message and place.
    """
    found = guarded(("build",), lambda: _build(cfg))
    for names, check in _checks(cfg, checks):
        if found[0].status is Status.failed:
            found += [Finding(name, Status.skipped, "the game cannot be built") for name in names]
        else:
            found += guarded(names, check)
    return TaskReport(cfg.task.name, tuple(found))


def _checks(
    cfg: GameCfg, checks: CheckCfg
) -> list[tuple[tuple[str, ...], Callable[[], Iterator[Finding]]]]:
    """Return the names and functions of the checks after ``build``; each builds its own games."""
    return [
        (_TORCHRL, lambda: _torchrl(cfg, checks.seed)),
        (SEEDING_NAMES, lambda: _seeding(cfg, checks)),
        (START_NAMES, lambda: _starts(cfg, checks)),
        (RANDOM_PLAY_NAMES, lambda: _random_play(cfg, checks)),
        (RETURN_NAMES, lambda: _returns(cfg, checks)),
    ]


def _build(cfg: GameCfg) -> Iterator[Finding]:
    with closing(Game(cfg)) as game:
        names = ", ".join(player.name for player in game.players)
        yield finding("build", [], f"players {names}; {len(game.world.props)} props")


def _torchrl(cfg: GameCfg, seed: int) -> Iterator[Finding]:
    with closing(VecaEnv(cfg, seed=seed)) as env:
        check_env_specs(env, break_when_any_done="both")
        yield finding(_TORCHRL[0], [], "check_env_specs passes")


def _seeding(cfg: GameCfg, checks: CheckCfg) -> Iterator[Finding]:
    with closing(Game(cfg)) as used, closing(Game(cfg)) as new:
        yield from check_seeding(used, new, checks.seeding_steps, checks.seed)


def _starts(cfg: GameCfg, checks: CheckCfg) -> Iterator[Finding]:
    with closing(Game(cfg)) as game:
        yield from check_starts(game, checks.starts, checks.seed)


def _random_play(cfg: GameCfg, checks: CheckCfg) -> Iterator[Finding]:
    with closing(Game(cfg)) as game:
        yield from check_random_play(game, checks.steps, checks.seed)


def _returns(cfg: GameCfg, checks: CheckCfg) -> Iterator[Finding]:
    with closing(Game(cfg)) as game:
        yield from check_returns(game, checks.episodes, checks.seed)
