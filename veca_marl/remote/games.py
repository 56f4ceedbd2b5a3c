"""Games on a server, as the adapters of this process play them.

A `RemoteGame` has what the adapters use of a `Game`. Actions are checked here, as bodies check
them, and one message carries those of all worlds that step.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType
from typing import Any, NoReturn, Protocol, cast

import numpy as np
from numpy.typing import NDArray

from veca_marl.envs.adapters.hosts import Host
from veca_marl.envs.core.game import Game, Observation, Outcome
from veca_marl.envs.core.game_cfg import GameCfg
from veca_marl.envs.core.task import Player, TaskCfg, Team
from veca_marl.envs.rendering.film import FilmCfg
from veca_marl.envs.rendering.spectator import RENDERED
from veca_marl.remote import layouts
from veca_marl.remote.description import GameSpecs, PlayerSpecs
from veca_marl.remote.layouts import Records
from veca_marl.sim.body import Body
from veca_marl.sim.body.action import checked_action
from veca_marl.sim.physics import ClockCfg
from veca_marl.sim.sense import ArraySpec, Sense


class Worlds(Protocol):
    """The worlds of this client on a server. Worlds are named by their index."""

    def open(self, worlds: int) -> None:
        """Let the server build worlds."""

    def reset(
        self, worlds: Sequence[int], rngs: Sequence[np.random.Generator]
    ) -> Iterator[Records]:
        """Begin an episode in each of some worlds; yield records, in order, as they arrive."""

    def step(
        self, worlds: Sequence[int], actions: Records, kinds: Sequence[str]
    ) -> Iterator[Records]:
        """Play one step in each of some worlds; yield records, in order, as they arrive."""

    def state(self, world: int) -> NDArray[np.float32]:
        """Return the state of a world."""

    def picture(self, world: int, cfg: FilmCfg) -> NDArray[np.uint8]:
        """Return a picture of a world."""

    def close(self) -> None:
        """End the worlds."""


class RemoteGameCfg(GameCfg):
    """What the client knows of the configuration: task, clock and teams.

    Attributes:
        specs: What the server says of its games; `specs.configuration` is all of it as YAML.
    """

    def __init__(self, specs: GameSpecs) -> None:
        super().__init__(
            task=TaskCfg(specs.task, max_seconds=specs.max_steps / specs.rate_hz),
            clock=ClockCfg(control_rate_hz=specs.rate_hz),
            global_state=specs.global_state,
        )
        self.specs = specs

    @property
    def teams(self) -> tuple[Team, ...]:
        """The teams whose actions this client gives."""
        names = [player.team for player in self.specs.players]
        return tuple(Team(name, names.count(name)) for name in dict.fromkeys(names))

    @property
    def max_steps(self) -> int:
        """Number of steps after which an episode is truncated."""
        return self.specs.max_steps

    def check(self) -> None:
        """Do nothing: the server has checked its configuration."""


class Scored(dict[str, float]):
    """Reward terms, with the reward as the server has summed them.

    Attributes:
        reward: Weighted sum of the terms.
    """

    reward: float = 0.0


class _RemoteBody:
    """A body on a server: the last action given to it, and what it has reported."""

    def __init__(self, specs: PlayerSpecs) -> None:
        self._info_names = specs.info
        self.action_spec = specs.action
        self.action: Mapping[str, NDArray[Any]] | None = None
        self.numbers: Sequence[float] = [0.0] * len(specs.info)

    def act(self, action: Mapping[str, Any]) -> None:
        """Set the action of the next step, see `Body.act`."""
        self.action = checked_action(self.action_spec, action)

    def rest(self) -> None:
        """Rest; the server lets eliminated players do so whatever their action is."""

    def info(self) -> dict[str, float]:
        """Return what the body has reported, see `Body.info`."""
        return dict(zip(self._info_names, self.numbers, strict=True))


class _RemoteSense:
    """The specs of a sense that is on a server."""

    def __init__(self, specs: Mapping[str, ArraySpec]) -> None:
        self.specs = dict(specs)


class _RemoteTask:
    """The rules, which are on a server."""

    def __init__(self, specs: GameSpecs) -> None:
        self.eliminates = specs.eliminates
        self._has_goal = specs.has_goal

    def has_goal(self) -> bool:
        """Return whether the task has a goal."""
        return self._has_goal


class _Results:
    """What the server has returned for some worlds, a row for each.

    Args:
        block: Records as of `layouts.outcome_type`.

    Attributes:
        columns: All fields.
        rewards: Rewards by row and player; so are `terms`, with an entry for each term, and the
            flags `solved`, `eliminated`, and `observed`.
        ended: Whether the episode has ended by the rules, and whether its time is up, by row.
    """

    def __init__(self, block: Records) -> None:
        self.columns = layouts.columns(block)
        self.rewards: list[list[float]] = self.columns[layouts.REWARD].tolist()
        self.terms: list[list[list[float]]] = self.columns[layouts.TERMS].tolist()
        self.ended: list[list[bool]] = self.columns[layouts.ENDED].tolist()
        self.solved: list[list[bool]] = self.columns[layouts.SOLVED].tolist()
        self.eliminated: list[list[bool]] = self.columns[layouts.ELIMINATED].tolist()
        self.observed: list[list[bool]] = self.columns[layouts.OBSERVED].tolist()


class RemoteGame(Game):
    """A game on a server.

    Players that follow a script are part of the world there: only those whose actions are given
    are known here. `world`, experts and scripts are not available.

    Args:
        cfg: What is known of the configuration.
        index: Index of its world.
        worlds: The worlds of this client.
    """

    def __init__(self, cfg: RemoteGameCfg, index: int, worlds: Worlds) -> None:
        specs = cfg.specs
        self.cfg, self.max_steps = cfg, specs.max_steps
        self.specs, self.index, self._worlds = specs, index, worlds
        self._weights = dict(specs.weights)
        self.task = cast(Any, _RemoteTask(specs))
        self._bodies = [_RemoteBody(player) for player in specs.players]
        self.senses = {
            player.name: {n: cast(Sense, _RemoteSense(s)) for n, s in player.senses.items()}
            for player in specs.players
        }
        self.players = self.actors = [
            Player(one.name, one.team, cast(Body, body), MappingProxyType(self.senses[one.name]))
            for one, body in zip(specs.players, self._bodies, strict=True)
        ]
        self.layout = layouts.ActionLayout(specs.players)
        self.steps = 0
        self.eliminated: frozenset[str] = frozenset()
        self._rng: np.random.Generator | None = None
        self._result: _Results | None = None
        self._row = 0
        self._fields = layouts.outcome_fields(specs)

    def __getattr__(self, name: str) -> NoReturn:
        """Say what cannot be had of a world on a server."""
        raise AttributeError(f"{name!r} of this game is on the server, with its world")

    def reset(self, rng: np.random.Generator) -> None:
        """See `Game.reset`."""
        begin([self], [rng], self._worlds)

    def begun(self, rng: np.random.Generator, results: _Results, row: int) -> None:
        """Take what the server has returned for the start of an episode."""
        self._rng, self.steps = rng, 0
        self._take(results, row)

    def advance(self) -> Outcome:
        """See `Game.advance`."""
        (outcome,) = advance([self], self._worlds)
        return outcome

    def stepped(self, results: _Results, row: int) -> Outcome:
        """Take what the server has returned for a step; return the outcome."""
        self.steps += 1
        self._take(results, row)
        terms: dict[str, dict[str, float]] = {}
        for index, player in enumerate(self.actors):
            scored = Scored(zip(self._weights, results.terms[row][index], strict=True))
            scored.reward = results.rewards[row][index]
            terms[player.name] = scored
        solved = {}
        if self.specs.has_goal:
            names = [player.name for player in self.actors]
            solved = dict(zip(names, results.solved[row], strict=True))
        bodies = {player.name: player.body.info() for player in self.actors}
        terminated, truncated = results.ended[row]
        return Outcome(terms, terminated, truncated, self.eliminated, solved, bodies)

    def _take(self, results: _Results, row: int) -> None:
        self._result, self._row = results, row
        if self.specs.eliminates:
            flags = zip(self.actors, results.eliminated[row], strict=True)
            self.eliminated = frozenset(player.name for player, gone in flags if gone)
        for body, fields in zip(self._bodies, self._fields, strict=True):
            if fields.info:
                body.numbers = results.columns[fields.info][row].tolist()

    def observe(self, player: Player, names: Collection[str] | None = None) -> Observation:
        """See `Game.observe`; nothing of a player that was eliminated before the last step."""
        index = self.actors.index(player)
        if self._result is None or not self._result.observed[self._row][index]:
            return {}
        columns, row = self._result.columns, self._row
        fields = self._fields[index].observations.items()
        return {name: columns[f][row] for name, f in fields if names is None or name in names}

    def reward_of(self, terms: Mapping[str, float]) -> float:
        """See `Game.reward_of`."""
        return terms.reward if isinstance(terms, Scored) else super().reward_of(terms)

    def state(self) -> NDArray[np.float32]:
        """Return what the simulator knows at this moment, see `GlobalState`."""
        if self.specs.global_state and self._result is not None:
            return np.array(self._result.columns[layouts.STATE][self._row], np.float32)
        return self._worlds.state(self.index)

    def actions(self) -> list[NDArray[Any]]:
        """Return all parts of all players' actions, in their order; zeros of eliminated players.

        Raises:
            RuntimeError: If a player has none yet.
        """
        parts: list[NDArray[Any]] = []
        for player, body in zip(self.actors, self._bodies, strict=True):
            if body.action is None and player.name not in self.eliminated:
                raise RuntimeError(f"{player.name} was given no action")
            for part, spec in body.action_spec.items():
                given = None if body.action is None else body.action[part]
                parts.append(np.zeros(spec.shape, spec.dtype) if given is None else given)
        return parts

    def close(self) -> None:
        """End the worlds of this client: all of them, see `Game.close`."""
        self._worlds.close()


def begin(games: Sequence[RemoteGame], rngs: Sequence[np.random.Generator], worlds: Worlds) -> None:
    """Begin an episode in each of some games."""
    if not games:
        return
    parts = worlds.reset([game.index for game in games], rngs)
    for game, rng, (results, row) in zip(games, rngs, _rows(parts), strict=True):
        game.begun(rng, results, row)


def advance(games: Sequence[RemoteGame], worlds: Worlds) -> Iterator[Outcome]:
    """Play one step in each of some games with the actions that were set, by one request.

    Yields:
        The outcome of each game when it arrives; the server simulates further ones meanwhile.
    """
    if not games:
        return
    layout = games[0].layout
    given = [game.actions() for game in games]
    kinds = layout.kinds_of(given)
    record = layout.record(kinds)
    actions = np.zeros(len(games), record)
    for name, column in zip(record.names or (), zip(*given, strict=True), strict=True):
        field = actions[name]
        for row, part in enumerate(column):
            field[row] = part
    parts = worlds.step([game.index for game in games], actions, kinds)
    for game, (results, row) in zip(games, _rows(parts), strict=True):
        yield game.stepped(results, row)


def _rows(parts: Iterable[Records]) -> Iterator[tuple[_Results, int]]:
    """Yield each row of some parts: the results that it is in, and its index there."""
    for part in parts:
        results = _Results(part)
        for row in range(len(part)):
            yield results, row


class _RemoteState:
    """Reads the state of a game on a server."""

    def __init__(self, game: RemoteGame) -> None:
        self._game = game

    @property
    def size(self) -> int:
        """Length of the vector."""
        return self._game.specs.state_size

    def read(self) -> NDArray[np.float32]:
        """Return the state at this moment."""
        return self._game.state()


class _RemoteView:
    """Lets the server render a game."""

    def __init__(self, game: RemoteGame, worlds: Worlds) -> None:
        self._game, self._worlds = game, worlds

    def frame(self, **choices: Any) -> NDArray[np.uint8]:
        """Return a picture of the present moment, see `Spectator.frame`."""
        return self._worlds.picture(self._game.index, replace(RENDERED, **choices))


class RemoteHost(Host):
    """Plays games in the worlds that a server has for this client.

    Args:
        worlds: Those worlds, not yet opened.
    """

    def __init__(self, worlds: Worlds) -> None:
        self._worlds = worlds

    def make(self, cfg: GameCfg, worlds: int) -> list[Game]:
        """See `Host`."""
        assert isinstance(cfg, RemoteGameCfg)
        self._worlds.open(worlds)
        return [RemoteGame(cfg, index, self._worlds) for index in range(worlds)]

    def reset(self, games: Sequence[Game], rngs: Sequence[np.random.Generator]) -> None:
        """See `Host`."""
        begin(_remote(games), rngs, self._worlds)

    def advance(self, games: Sequence[Game]) -> Iterator[Outcome]:
        """See `Host`; all worlds begin their step before the first outcome."""
        return advance(_remote(games), self._worlds)

    def state(self, game: Game) -> _RemoteState:
        """See `Host`."""
        (remote,) = _remote([game])
        return _RemoteState(remote)

    def view(self, game: Game) -> _RemoteView:
        """See `Host`."""
        (remote,) = _remote([game])
        return _RemoteView(remote, self._worlds)


def _remote(games: Sequence[Game]) -> list[RemoteGame]:
    return [game for game in games if isinstance(game, RemoteGame)]
