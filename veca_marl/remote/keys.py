"""Keys of servers and clients: CURVE, the public-key encryption of ZeroMQ.

A folder holds the secret key of a server (`server.json`) and a file for each client that may
connect (`clients/NAME.json`, its public key). A client has one file, which holds its own secret key
and the public key of the server. Files with secrets are readable by their owner only, and others
are refused.
"""

from __future__ import annotations

import json
import os
import re
import stat
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import zmq

from veca_marl.stored_files import StoredFileError, read_json

SERVER, CLIENTS = "server.json", "clients"
SUFFIX = ".key.json"
_KEY = re.compile(r"[0-9A-Za-z.\-:+=^!/*?&<>()\[\]{}@%$#]{40}")  # Z85
_NAME = re.compile(r"[A-Za-z0-9_.-]{1,64}")


class KeyFileError(ValueError):
    """A file of keys cannot be used; the message is one line."""


@dataclass(frozen=True)
class ServerKeys:
    """Keys of a server.

    Attributes:
        public: Its public key.
        secret: Its secret key.
        clients: Name of each client that may connect, by its public key.
    """

    public: str
    secret: str
    clients: Mapping[str, str]

    def __repr__(self) -> str:
        """Return the names of the clients, and no secret."""
        return f"ServerKeys(clients={sorted(self.clients.values())})"


@dataclass(frozen=True)
class ClientKeys:
    """Keys of a client.

    Attributes:
        public: Its public key.
        secret: Its secret key.
        server: The public key of the server.
    """

    public: str
    secret: str
    server: str

    def __repr__(self) -> str:
        """Return the public key only."""
        return f"ClientKeys(public={self.public!r})"


def has_keys(folder: Path) -> bool:
    """Return whether a folder holds the keys of a server."""
    return (folder / SERVER).exists()


def make_server_keys(folder: Path) -> None:
    """Write new keys of a server into a folder, which is created; no client may connect yet.

    Raises:
        KeyFileError: If there are keys already, or they cannot be written.
    """
    public, secret = _pair()
    _write(folder / SERVER, {"public": public, "secret": secret})


def add_client(folder: Path, name: str) -> Path:
    """Let a new client connect to the server of a folder of keys.

    Args:
        folder: The folder.
        name: Name of the client.

    Returns:
        The file for the client, which goes to its machine.

    Raises:
        KeyFileError: If the name is taken or no name, the folder has no keys, or nothing can be
            written.
    """
    if not _NAME.fullmatch(name) or name.startswith("."):
        raise KeyFileError(
            f"client={name}: a name has up to 64 letters, digits, and _ . - without a dot first"
        )
    server = _read(folder / SERVER, ("public", "secret"))
    public, secret = _pair()
    file = folder / f"{name}{SUFFIX}"
    _write(folder / CLIENTS / f"{name}.json", {"public": public})
    _write(file, {"public": public, "secret": secret, "server": server["public"]})
    return file


def load_server_keys(folder: Path) -> ServerKeys:
    """Return the keys in a folder.

    Raises:
        KeyFileError: If it has none, or others could have read the secret one.
    """
    keys = _read(folder / SERVER, ("public", "secret"))
    files = sorted((folder / CLIENTS).glob("*.json"))
    clients = {_read(file, ("public",))["public"]: file.stem for file in files}
    return ServerKeys(keys["public"], keys["secret"], clients)


def load_client_keys(file: Path) -> ClientKeys:
    """Return the keys in the file of a client.

    Raises:
        KeyFileError: If it is no such file, or others could have read the secret one.
    """
    keys = _read(file, ("public", "secret", "server"))
    return ClientKeys(keys["public"], keys["secret"], keys["server"])


def _pair() -> tuple[str, str]:
    public, secret = zmq.curve_keypair()
    return public.decode(), secret.decode()


def _write(file: Path, content: dict[str, Any]) -> None:
    """Write a new file that its owner only can read."""
    try:
        file.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        handle = os.open(file, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
        with open(handle, "w") as opened:
            json.dump(content, opened)
            opened.write("\n")
    except FileExistsError as error:
        raise KeyFileError(f"{file} exists already; remove it first") from error
    except OSError as error:
        raise KeyFileError(f"{file} cannot be written: {error.strerror}") from error


def _read(file: Path, names: tuple[str, ...]) -> dict[str, str]:
    """Return the keys in a file.

    Raises:
        KeyFileError: If one is missing or no key, or the file has a secret and is readable by
            others than its owner.
    """
    try:
        content = read_json(file)
    except StoredFileError as error:
        raise KeyFileError(str(error)) from error
    found = {name: content.get(name) for name in names}
    wrong = [n for n, key in found.items() if not (isinstance(key, str) and _KEY.fullmatch(key))]
    if wrong:
        raise KeyFileError(f"{file} is no file of keys with {', '.join(names)}: no {wrong[0]}")
    mode = stat.S_IMODE(file.stat().st_mode)
    if "secret" in names and mode & 0o077:
        raise KeyFileError(f"{file} can be read or written by others: chmod 600 {file}")
    return {name: str(key) for name, key in found.items()}
