"""Games whose worlds are on a server, see `veca_marl.remote`: the extra ``[remote]``."""

from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module
from types import ModuleType

from omegaconf import OmegaConf

from veca_marl.config import ConfigError
from veca_marl.envs.adapters.torchrl.env import VecaEnv
from veca_marl.envs.core.game_cfg import GameCfg


def import_remote(module: str) -> ModuleType:
    """Return a module of `veca_marl.remote`.

    Raises:
        ModuleNotFoundError: Without the extra ``[remote]``.
    """
    try:
        return import_module(f"veca_marl.remote.{module}")
    except ModuleNotFoundError as error:
        raise ModuleNotFoundError(
            "worlds of other machines need pyzmq and msgpack: pip install 'veca_marl[remote]'",
            name=error.name,
        ) from error


def game_text(game: GameCfg) -> str:
    """Return a configuration as YAML: what a server says of its games to those who read it."""
    return OmegaConf.to_yaml(OmegaConf.structured(game))


@dataclass(frozen=True)
class ServedGames:
    """Makes environments of worlds on a server, also in worker processes.

    Attributes:
        address: Address of the server.
        key: File with the keys of this client; None for a server without keys.
    """

    address: str
    key: str | None = None

    def __call__(self, worlds: int, seed: int) -> VecaEnv:
        """Return `worlds` games in one environment."""
        there = import_remote("client").RemoteWorlds(self.address, self.key)
        return VecaEnv(there.cfg, worlds, seed, host=import_remote("games").RemoteHost(there))

    def check(self, game: GameCfg, worlds: int, clients: int) -> None:
        """Check that the server has the games of a configuration, and enough worlds and places.

        Args:
            game: The game.
            worlds: Worlds that a process needs at most.
            clients: Processes that have worlds at the same time.

        Raises:
            ConfigError: If it has not, or does not serve this client.
        """
        try:
            there = import_remote("client").RemoteWorlds(self.address, self.key)
        except (ValueError, RuntimeError, ModuleNotFoundError) as error:
            raise ConfigError(f"collect.server={self.address}: {error}") from error
        own, other = game_text(game).splitlines(), there.cfg.specs.configuration.splitlines()
        if own != other:
            pairs = zip([*own, "nothing more"], [*other, "nothing more"], strict=False)
            here, differs = next((a.strip(), b.strip()) for a, b in pairs if a != b)
            raise ConfigError(
                f"collect.server={self.address} has another game: {differs} there, {here} here; "
                "start both commands with the same words"
            )
        if there.most < worlds:
            raise ConfigError(
                f"collect.server={self.address} gives each process {there.most} worlds, and the "
                f"run needs {worlds}: start the server with worlds={worlds}"
            )
        if there.free < clients:
            raise ConfigError(
                f"collect.server={self.address} has {there.free} of {there.clients} places for "
                f"clients free, and the run needs {clients}, one for each process that collects or "
                "evaluates: wait until others have ended, choose smaller collect.processes, or "
                f"start the server with larger clients={there.clients}"
            )
