"""A server of a cheap game, for all tests of a module."""

import pytest

pytest.importorskip("msgpack", reason="worlds on a server need the extra [remote]")
pytest.importorskip("zmq", reason="worlds on a server need the extra [remote]")

from composed import compose
from served import served

CHEAP = ("+task=KickTheBall", "playground=simple", "senses/vision=blind", "task.max_seconds=0.4")


@pytest.fixture(scope="package")
def cfg():
    return compose(CHEAP).game


@pytest.fixture(scope="module")
def server(cfg):
    with served(cfg, worlds=3, clients=4) as server:
        yield server
