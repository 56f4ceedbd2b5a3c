"""Serve worlds to other machines: ``python -m veca_marl.serve +task=KickTheBall worlds=8``.

Each client has worlds of its own, up to ``worlds``, in a process of its own; up to ``clients`` of
them at once. ``veca_marl.connect("tcp://127.0.0.1:5555")`` plays there. Other machines reach the
server only at an address that is not the loopback, and with keys:

    python -m veca_marl.serve keys=veca_keys new_client=trainer
    python -m veca_marl.serve +task=KickTheBall worlds=8 address=tcp://0.0.0.0:5555 keys=veca_keys

The first command makes keys and ends. The file that it names goes to the other machine:
``connect("tcp://HOST:5555", key="trainer.key.json")``. Ctrl-C ends the server and all worlds.
"""

from __future__ import annotations

import logging
import resource
import signal
import sys
from collections.abc import Sequence
from contextlib import closing, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from veca_marl.config import Config, ConfigError, one_line
from veca_marl.config.choices import compose_game
from veca_marl.config.command_line import CommandLine
from veca_marl.envs.core.compile_ahead import CompileWorkers
from veca_marl.envs.core.game import Game
from veca_marl.runs.served_worlds import game_text, import_remote
from veca_marl.sim.compilation import announce_compilation


@dataclass
class ServeOptions:
    """Options of the command.

    Attributes:
        address: Where to listen: tcp://HOST:PORT, with the number of an interface as HOST.
        worlds: Worlds that a client may have.
        clients: Clients that may have worlds at once.
        keys: Folder with the keys of the server and its clients; None is none, on this machine.
        new_client: Name of a client to make keys for; then the command ends.
        without_keys: Whether everybody may connect who reaches the address.
        reconnect_s: Seconds for which worlds are kept whose client has lost its connection.
        limit_s: Seconds that worlds may take for one request, or to be built.
        busy_wait_s: Seconds for which the process of a client waits for the next request without
            sleeping, up to 1: a step is answered sooner, and a core is in use meanwhile.
    """

    address: str = "tcp://127.0.0.1:5555"
    worlds: int = 1
    clients: int = 8
    keys: str | None = None
    new_client: str | None = None
    without_keys: bool = False
    reconnect_s: float = 60.0
    limit_s: float = 600.0
    busy_wait_s: float = 0.0005

    def __post_init__(self) -> None:
        for name in ("worlds", "clients"):
            if not 1 <= getattr(self, name) <= 10_000:
                raise ValueError(f"{name}={getattr(self, name)} must be from 1 to 10000")
        for name in ("reconnect_s", "limit_s"):
            if not 0.0 < getattr(self, name) < 1e6:
                raise ValueError(f"{name}={getattr(self, name)} must be positive, up to 1e6")
        if not 0.0 <= self.busy_wait_s <= 1.0:
            raise ValueError(f"busy_wait_s={self.busy_wait_s} must be from 0 to 1")
        if self.new_client is not None and self.keys is None:
            raise ValueError(f"new_client={self.new_client} needs keys=FOLDER")
        if self.keys is not None and self.without_keys:
            raise ValueError(f"keys={self.keys} and without_keys=true exclude each other")


def run(options: ServeOptions, overrides: list[str]) -> None:
    """Make keys, or serve worlds until the command is interrupted."""
    if options.new_client is not None:
        _make_keys(Path(str(options.keys)), options.new_client)
        return
    _serve(options, overrides)


def _make_keys(folder: Path, client: str) -> None:
    """Make keys for a client, and those of the server if the folder has none."""
    keys = import_remote("keys")
    try:
        if not keys.has_keys(folder):
            keys.make_server_keys(folder)
        file = keys.add_client(folder, client)
    except keys.KeyFileError as error:
        raise ConfigError(str(error)) from error
    print(f"{file}: the keys of {client}; bring this file to its machine, and show it to nobody")


def _serve(options: ServeOptions, overrides: list[str]) -> None:
    server, keys, address = import_remote("server"), import_remote("keys"), import_remote("address")
    try:
        chosen = server.ServerCfg(
            address.checked_address(options.address),
            options.worlds,
            options.clients,
            options.without_keys,
            options.reconnect_s,
            options.limit_s,
            options.busy_wait_s,
        )
        chosen.check(options.keys is not None)
        known = None if options.keys is None else keys.load_server_keys(Path(options.keys))
        cfg = compose_game(overrides)
        specs = _specs(cfg)
        _raise_limit_of_files()
        opened = server.Server(chosen, server.WorldsCfg(cfg.game, tuple(cfg.plugins)), specs, known)
    except (ValueError, OSError) as error:
        raise ConfigError(one_line(error)) from error
    logging.basicConfig(level=logging.INFO, format="%(asctime)s %(message)s", stream=sys.stderr)
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # schedulers stop jobs with it
    with closing(opened):
        allowed = "everybody" if known is None else ", ".join(sorted(known.clients.values()))
        print(
            f"{cfg.task.name} at {opened.address}: {options.worlds} worlds for each of "
            f"{options.clients} clients; who may connect: {allowed or 'nobody yet'}",
            flush=True,
        )
        opened.run()


def _specs(cfg: Config) -> Any:
    """Return the specs of the game; one world is built and closed for it."""
    description = import_remote("description")
    announce_compilation(CompileWorkers(cfg.game))
    with closing(Game(cfg.game)) as game:
        return description.GameSpecs.of(game, game_text(cfg.game))


def _raise_limit_of_files() -> None:
    """Let this process open as many files as it may: each connection is one."""
    with suppress(OSError, ValueError):
        _, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
        resource.setrlimit(resource.RLIMIT_NOFILE, (hard, hard))


def main(words: Sequence[str] | None = None) -> int:
    """Run the command line; return the exit status."""
    return CommandLine("serve", ServeOptions, str(__doc__), (ModuleNotFoundError,)).run(run, words)
