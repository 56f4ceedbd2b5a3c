"""What demonstrations of a game have in common with runs that learn from them."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from pathlib import Path

from veca_marl.algos.demonstration_files import DemonstrationsError, TeamForm
from veca_marl.algos.demonstrations import Demonstrations
from veca_marl.algos.specs import TeamSpec
from veca_marl.algos.training.learners import TeamLearners
from veca_marl.config import Config, ConfigError, one_line
from veca_marl.envs.adapters.torchrl.labelled import LabelledEnv
from veca_marl.envs.core.benchmark import parameters
from veca_marl.envs.core.game_cfg import GameCfg
from veca_marl.envs.core.task import find_task
from veca_marl.runs.run_folder import RunFolder


def team_forms(game: GameCfg, specs: Mapping[str, TeamSpec]) -> dict[str, TeamForm]:
    """Return the form of each team of a game.

    Args:
        game: The game.
        specs: The arrays of its teams.
    """
    task = find_task(game.task.name)
    names = {t.name: task.senses if t.senses is None else t.senses for t in game.teams}
    forms = {}
    for team, spec in specs.items():
        body, senses = game.body_of(team), game.senses_of(team)
        forms[team] = TeamForm(
            spec,
            {"kind": type(body).__name__, **parameters(body)},
            {name: parameters(senses.of(name)) for name in names[team] if senses.of(name).present},
        )
    return forms


def give_demonstrations(
    cfg: Config,
    folder: RunFolder | None,
    specs: Mapping[str, TeamSpec],
    learners: TeamLearners,
) -> None:
    """Let the algorithms of all teams learn from the demonstrations, if there are any.

    Raises:
        ConfigError: If there are none where they are needed, an algorithm cannot learn from them,
            they cannot be read, do not fit, or are not those that a resumed run began with.
    """
    for team, algorithm in learners.algorithms.items():
        name = learners.cfgs[team].name
        if algorithm.needs_demonstrations and cfg.demonstrations is None:
            raise ConfigError(
                f"algo={name} learns from demonstrations: record some with python -m "
                "veca_marl.demonstrations, and add demonstrations=FOLDER"
            )
        if not algorithm.needs_experience and team in learners.bonuses:
            raise ConfigError(
                f"algo={name} collects no experience that intrinsic rewards could be added to"
            )
        if algorithm.needs_labels:
            _require_expert(cfg, name, team)
    if cfg.demonstrations is None:
        return
    found = open_demonstrations(cfg.demonstrations, cfg.game, specs, list(learners.algorithms))
    if cfg.resume is not None and folder is not None:
        _check_same_demonstrations(found, folder)
    try:
        for algorithm in learners.algorithms.values():
            algorithm.take_demonstrations(found)
    except ValueError as error:
        raise ConfigError(f"demonstrations={cfg.demonstrations}: {one_line(error)}") from error


def _check_same_demonstrations(found: Demonstrations, folder: RunFolder) -> None:
    """Raise `ConfigError` if a run began with other demonstrations than those in their folder."""
    before = folder.demonstrations
    if before not in (None, found.card.checksum):
        raise ConfigError(
            f"demonstrations={found.folder}: the {len(found)} episodes there are not those that "
            f"{folder.path} began with (extended, or recorded anew); begin a new run with them"
        )


def _require_expert(cfg: Config, algo: str, team: str) -> None:
    """Raise `ConfigError` if the expert of the task cannot label what a team observes."""
    try:
        LabelledEnv(cfg.game, 1, 0, teams=[team]).close()
    except ValueError as error:
        raise ConfigError(f"algo={algo}: {one_line(error)}") from error


def open_demonstrations(
    path: str, game: GameCfg, specs: Mapping[str, TeamSpec], teams: Collection[str]
) -> Demonstrations:
    """Return demonstrations from which teams of a run can learn.

    Task parameters, playground and opponents may differ. Rewards are those of the run's
    `task.weights`, made of the terms that were recorded.

    Args:
        path: Their folder.
        game: The game of the run.
        specs: The arrays of its teams.
        teams: The teams that learn.

    Raises:
        ConfigError: If they cannot be read, were altered, or are of another task, control rate,
            body, of other senses or actions.
    """
    try:
        found = Demonstrations(Path(path))
        _check_game(found, game)
        forms = team_forms(game, specs)
        weights = find_task(game.task.name).step_weights(game.task, game.clock)
        for team in teams:
            found.check_team(team, forms[team])
            found.weigh_rewards(team, weights)
    except DemonstrationsError as error:
        raise ConfigError(f"demonstrations: {error}") from error
    return found


def _check_game(found: Demonstrations, game: GameCfg) -> None:
    card, rate = found.card, game.clock.control_rate_hz
    if card.task != game.task.name:
        raise DemonstrationsError(f"{found.folder} is of {card.task}, not of {game.task.name}")
    if card.control_rate_hz != rate:
        raise DemonstrationsError(
            f"{found.folder} has {card.control_rate_hz} steps per second, this run {rate}"
        )
