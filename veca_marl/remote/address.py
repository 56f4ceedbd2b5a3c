"""Addresses of servers: ``tcp://HOST:PORT``."""

from __future__ import annotations

import ipaddress
import re

_ADDRESS = re.compile(
    r"tcp://(?P<host>\[[0-9A-Fa-f:.%a-z]+\]|[A-Za-z0-9_.*-]+):(?P<port>\d{1,5}|\*)"
)
EXAMPLE = "tcp://127.0.0.1:5555"


def checked_address(address: object) -> str:
    """Return an address.

    Raises:
        ValueError: If it is none.
    """
    match = _ADDRESS.fullmatch(address) if isinstance(address, str) else None
    if match is None or (match["port"] != "*" and int(match["port"]) > 65535):
        raise ValueError(f"address={address!r} must be like {EXAMPLE}")
    return match[0]


def is_loopback(address: str) -> bool:
    """Return whether only programs of this machine can reach an address."""
    match = _ADDRESS.fullmatch(address)
    assert match is not None  # it was checked
    host = match["host"].strip("[]")
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:  # a name, which may stand for any interface
        return host == "localhost"


def numeric(address: str) -> str:
    """Return an address to listen at, with the number for ``localhost``."""
    return address.replace("//localhost:", "//127.0.0.1:")
