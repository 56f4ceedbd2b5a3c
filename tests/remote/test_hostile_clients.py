"""Whatever comes in at its port, a server stays up and serves others."""

import resource
import socket
import threading
from contextlib import ExitStack, closing, contextmanager, suppress

import msgpack
import numpy as np
import pytest
import zmq
from refusals import naming
from served import gym_env, served, torchrl_env

from veca_marl.envs.adapters.torchrl.env import VecaEnv
from veca_marl.envs.rendering import FilmCfg
from veca_marl.remote import keys as key_files
from veca_marl.remote.channel import RemoteError
from veca_marl.remote.client import RemoteWorlds
from veca_marl.remote.games import RemoteHost
from veca_marl.remote.messages import CLOSE, HELLO, MARK, PEER, STEP, Message, decode
from veca_marl.remote.pictures import fields_of

THOUSAND = 1000
PICTURE = {"worlds": [0], **fields_of(FilmCfg())}


@pytest.fixture(scope="module")
def honest(server):
    """An environment that plays while others attack."""
    with closing(torchrl_env(server, 1, timeout_s=20.0)) as env:
        yield env


@pytest.fixture(autouse=True)
def served_as_before(honest):
    """After each attack the honest client plays on, and its worlds were not disturbed."""
    yield
    assert honest.rollout(3).shape == (1, 3)


def port_of(server):
    return int(server.address.rpartition(":")[2])


def raw(server):
    return socket.create_connection(("127.0.0.1", port_of(server)), timeout=10.0)


@contextmanager
def dealer(server, **options):
    """A client of ZeroMQ that follows no protocol."""
    with zmq.Context() as context, context.socket(zmq.DEALER) as peer:
        peer.setsockopt(zmq.LINGER, 0)
        for name, value in options.items():
            setattr(peer, name, value)
        peer.connect(server.address)
        yield peer


def answers(peer, seconds=10.0):
    """Return the messages that come until none has come for some time; wait for the first."""
    found, wait_ms = [], 1000 * seconds
    while peer.poll(wait_ms):
        found.append(decode(peer.recv_multipart(), 1_000_000))
        wait_ms = 200
    return found


def test_random_bytes(server):
    rng = np.random.default_rng(0)
    greeting = b"\xff" + bytes(8) + b"\x7f\x03\x01NULL" + bytes(48)
    for length in (1, 10, 64, 5000, 200_000):
        for beginning in (b"", greeting):
            with raw(server) as peer, suppress(OSError):
                peer.sendall(beginning + rng.bytes(length))
                peer.settimeout(0.2)
                peer.recv(100)


def test_frames_that_are_no_messages(server):
    rng = np.random.default_rng(0)
    deep = b"\x91" * 5000 + b"\xc0"
    wrong = [
        [b""],
        [MARK],
        [MARK, b""],
        [MARK, rng.bytes(50)],
        [MARK, deep],
        [MARK, msgpack.packb(msgpack.ExtType(4, b"x"))],
        [MARK, msgpack.packb(["hello", -1, {}])],
        [MARK, msgpack.packb(["hello", 2**64 - 1, {}])],
        [MARK, msgpack.packb(["hello", 1, {1: 2}])],
        [MARK, msgpack.packb([["hello"], 1, {}])],
        [MARK, msgpack.packb(["hello", 1, {}]) + b"more"],
        [MARK, b"\xdd\xff\xff\xff\xff"],  # a list that says it has 4e9 entries
        [MARK, b"\xc6\xff\xff\xff\xff"],  # bytes that say they are 4 GB
        [MARK, msgpack.packb(["hello", 1, {}]), b"", b""],
        [b"x"] * 500,
        [rng.bytes(60_000)],
        *[[MARK, rng.bytes(int(n))] for n in rng.integers(1, 200, 50)],
    ]
    with dealer(server) as peer:
        for frames in wrong:
            peer.send_multipart(frames)
            assert peer.poll(10_000)
            answer = decode(peer.recv_multipart(), 1_000_000)
            assert answer.kind == "refused"
            assert "\n" not in answer.fields["message"]
        assert answers(peer, 0.2) == []


@pytest.mark.parametrize("mark", [b"veca_marl 0", b"veca_marl 2", b"veca_marl 999999999"])
def test_another_version_is_told_both(server, mark):
    with dealer(server) as peer:
        peer.send_multipart([mark, msgpack.packb(["hello", 1, {}])])
        (answer,) = answers(peer)
        assert str(int(mark.split()[1])) in answer.fields["message"]
        assert answer.fields["reason"] == PEER


def test_requests_that_lie(server):
    """A client with worlds sends numbers and sizes that are not so; its worlds stay."""
    there = RemoteWorlds(server.address)
    env = VecaEnv(there.cfg, 2, 0, host=RemoteHost(there))
    env.reset()
    channel = there._channel
    seed = [[b"\1"]]
    kinds, action = ["float32"], bytes(2 * 8)
    lies = [
        ("reset", {"worlds": [2], "seeds": seed}, b""),
        ("reset", {"worlds": [-1], "seeds": seed}, b""),
        ("reset", {"worlds": [0, 0], "seeds": seed * 2}, b""),
        ("reset", {"worlds": [], "seeds": []}, b""),
        ("reset", {"worlds": [True], "seeds": seed}, b""),
        ("reset", {"worlds": [0.5], "seeds": seed}, b""),
        ("reset", {"worlds": [0], "seeds": seed * 5}, b""),
        ("reset", {"worlds": [0], "seeds": [[]]}, b""),
        ("reset", {"worlds": [0], "seeds": [[b"x" * 65]]}, b""),
        ("reset", {"worlds": [0], "seeds": [[-3]]}, b""),
        ("reset", {"worlds": [0], "seeds": [[b"x"] * 9]}, b""),
        ("reset", {"worlds": list(range(10_000)), "seeds": seed}, b""),
        ("reset", {}, b""),
        ("step", {"worlds": [0, 1], "kinds": kinds}, action[:-1]),
        ("step", {"worlds": [0, 1], "kinds": kinds}, action + b"x"),
        ("step", {"worlds": [0, 1], "kinds": kinds}, b""),
        ("step", {"worlds": [0, 1], "kinds": ["object"]}, action),
        ("step", {"worlds": [0, 1], "kinds": ["|V8"]}, action),
        ("step", {"worlds": [0, 1], "kinds": ["bool"]}, action),
        ("step", {"worlds": [0, 1], "kinds": [[1]]}, action),
        ("step", {"worlds": [0, 1], "kinds": kinds * 2}, action),
        ("step", {"worlds": [0, 1]}, action),
        ("view", {"worlds": [0, 1]}, b""),
        ("view", {"worlds": [9]}, b""),
        ("view", {"worlds": [0], "width": 64}, b""),
        ("view", PICTURE | {"width": 10**6}, b""),
        ("view", PICTURE | {"camera": "__class__"}, b""),
        ("state", {"worlds": [9]}, b""),
        ("state", {}, b""),
        ("open", {"worlds": 1, "digest": there.cfg.specs.digest}, b""),
        ("quit", {}, b""),
        ("x" * 60_000, {}, b""),
        ("done", {}, b""),
    ]
    for kind, fields, data in lies:
        with pytest.raises(RemoteError, match=naming(server.address)):
            channel.ask(kind, fields, data)
    with pytest.raises(ValueError, match=naming("world 0", "nan")):
        channel.ask("step", {"worlds": [0], "kinds": kinds}, np.full(2, np.nan, "<f4").tobytes())
    assert env.rollout(3).shape == (2, 3)
    env.close()


def test_a_message_larger_than_any_request_is_not_read(server):
    with dealer(server) as peer:
        peer.send_multipart([MARK, bytes(50_000_000)])
        assert answers(peer, 1.0) == []


def test_nobody_gets_the_worlds_of_another_client(server):
    """A peer that names itself like a connection it has seen, with no key, takes nothing away."""
    (client,) = list(server._sessions)[:1]
    with dealer(server, routing_id=b"c" + bytes(16)) as peer:
        peer.send_multipart(Message(CLOSE, 5).frames())
        peer.send_multipart(Message(STEP, 5, {"worlds": [0], "kinds": ["float32"]}).frames())
        assert [answer.kind for answer in answers(peer)] == ["done", "refused"]  # nothing to end
    assert client in server._sessions


@pytest.mark.slow  # it builds four worlds
def test_more_clients_than_there_may_be(server):
    with ExitStack() as stack:
        for _ in range(3):
            stack.enter_context(closing(gym_env(server)))
        with pytest.raises(RemoteError, match=naming("clients=4")):
            gym_env(server)
    with closing(gym_env(server)) as env:
        env.reset()


def test_a_client_that_asks_and_does_not_read(server, honest):
    with dealer(server, rcvhwm=1, rcvbuf=4096) as peer:
        hello = Message(HELLO, 1, {"version": "0"}).frames()
        for _ in range(20_000):
            with suppress(zmq.Again):
                peer.send_multipart(hello, zmq.NOBLOCK)
        assert honest.rollout(3).shape == (1, 3)


def test_a_flood_of_requests_holds_up_nobody(server, honest):
    stop = threading.Event()

    def flood():
        with dealer(server) as peer:
            while not stop.is_set():
                with suppress(zmq.Again):
                    peer.send_multipart([MARK, b"rubbish"], zmq.NOBLOCK)
                with suppress(zmq.Again):
                    peer.recv_multipart(zmq.NOBLOCK)

    attacker = threading.Thread(target=flood)
    attacker.start()
    try:
        assert honest.rollout(20).shape[0] == 1
    finally:
        stop.set()
        attacker.join()


def test_slow_senders(server, honest):
    with ExitStack() as stack:
        peers = [stack.enter_context(raw(server)) for _ in range(20)]
        for byte in b"\xff\x00\x00\x00":
            for peer in peers:
                peer.sendall(bytes([byte]))
            assert honest.rollout(1).shape == (1, 1)


def test_a_thousand_connections(server, honest):
    """They are open at once, and silent."""
    _, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    if hard < 3 * THOUSAND:
        pytest.skip(f"this process may open {hard} files only")
    with ExitStack() as stack:
        for _ in range(THOUSAND):
            stack.enter_context(raw(server))
        assert honest.rollout(5).shape == (1, 5)
        with closing(gym_env(server)) as env:
            env.reset()


def test_a_thousand_clients_without_a_key(cfg, tmp_path):
    key_files.make_server_keys(tmp_path)
    file = key_files.add_client(tmp_path, "friend")
    keys = key_files.load_server_keys(tmp_path)
    with served(cfg, 1, keys=keys) as server, ExitStack() as stack:
        context = stack.enter_context(zmq.Context())
        context.max_sockets = 2 * THOUSAND
        for _ in range(THOUSAND):
            peer = stack.enter_context(context.socket(zmq.DEALER))
            peer.setsockopt(zmq.LINGER, 0)
            peer.setsockopt(zmq.CURVE_SERVERKEY, keys.public.encode())
            peer.curve_publickey, peer.curve_secretkey = zmq.curve_keypair()
            peer.connect(server.address)
            peer.send_multipart(Message(HELLO, 1, {"version": "0"}).frames())
        with closing(torchrl_env(server, 1, key=file)) as env:
            assert env.rollout(5).shape == (1, 5)
        assert not peer.poll(0)
