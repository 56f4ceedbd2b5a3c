"""Whatever a server answers, a client ends with one line, and reads no more than it expects."""

import threading
from contextlib import closing, contextmanager

import msgpack
import numpy as np
import pytest
import zmq
from refusals import naming

from veca_marl.envs.adapters.torchrl.env import VecaEnv
from veca_marl.envs.core.game import Game
from veca_marl.remote import layouts
from veca_marl.remote.channel import RemoteError
from veca_marl.remote.client import RemoteWorlds
from veca_marl.remote.description import GameSpecs
from veca_marl.remote.games import RemoteHost
from veca_marl.remote.messages import MARK, PROTOCOL, Message, decode
from veca_marl.version import __version__


@pytest.fixture(scope="module")
def specs(cfg):
    with closing(Game(cfg)) as game:
        return GameSpecs.of(game)


@contextmanager
def impostor(answer):
    """Answer each request with the frames that a function returns for it; yield the address."""
    context = zmq.Context()
    socket = context.socket(zmq.ROUTER)
    socket.setsockopt(zmq.LINGER, 0)
    port = socket.bind_to_random_port("tcp://127.0.0.1")
    stop = threading.Event()

    def serve():
        while not stop.is_set():
            if socket.poll(50):
                peer, *frames = socket.recv_multipart()
                if reply := answer(decode(frames, 64_000)):
                    socket.send_multipart([peer, *reply])

    thread = threading.Thread(target=serve)
    thread.start()
    try:
        yield f"tcp://127.0.0.1:{port}"
    finally:
        stop.set()
        thread.join()
        socket.close()
        context.term()


def welcome(specs, **changes):
    places = {"clients": 8, "free": 3}
    return specs.fields() | {"version": __version__, "worlds": 4} | places | changes


def greeting(fields):
    """Answer a greeting with these fields."""
    return lambda request: Message("done", request.number, fields).frames()


def expect_refusal(address, *named):
    """A client that greets the server ends with one line."""
    with pytest.raises(RemoteError, match=naming(address, *named)):
        RemoteWorlds(address, timeout_s=5.0)


def test_a_server_of_another_version_is_told_from_others():
    with impostor(lambda request: [b"veca_marl 7", b""]) as address:
        expect_refusal(address, "7", str(PROTOCOL))


@pytest.mark.parametrize(
    "frames",
    [[b"HTTP/1.1 200 OK"], [MARK], [MARK, b"\xdd\xff\xff\xff\xff"], [MARK, b"\x91" * 9000]],
)
def test_what_is_no_message_is_refused(frames):
    with impostor(lambda request: frames) as address:
        expect_refusal(address)


def lies(specs):
    """Yield greetings that are not true, or of no game."""
    players = specs.fields()["players"]

    def with_array(**changes):
        array = {**players[0]["action"][0], **changes}
        return {"players": [{**players[0], "action": [array]}]}

    def with_sense(**changes):
        (sense, arrays) = players[0]["senses"][0]
        return {"players": [{**players[0], "senses": [[sense, [{**arrays[0], **changes}]]]}]}

    yield from (with_array(type="object"), with_array(type="|V9"), with_array(shape=[-1]))
    yield from (with_array(shape=[2**40]), with_array(shape=[2] * 40), with_array(shape="2"))
    yield from (with_array(low=float("nan")), with_array(high="1"), with_array(names=[1]))
    yield from (with_sense(shape=[2**20, 2**20]), with_sense(name=5), with_sense(shape=[1.0]))
    yield from ({"players": []}, {"players": players * 2}, {"players": [[]]}, {"players": None})
    yield from ({"weights": [["kick", float("inf")]]}, {"weights": {"kick": 1.0}}, {"weights": 3})
    yield from ({"worlds": 0}, {"worlds": "8"}, {"worlds": 10**9}, {"version": None}, {"task": 1})
    yield from ({"rate_hz": 0}, {"max_steps": -1}, {"state_size": 10**9}, {"has_goal": 1})
    yield from ({"clients": 0}, {"clients": None}, {"free": -1}, {"free": 9}, {"free": 1.0})
    yield {"configuration": "x" * 300_000}


def test_a_greeting_that_lies_is_refused(specs):
    for lie in lies(specs):
        with impostor(greeting(welcome(specs, **lie))) as address:
            expect_refusal(address)


def test_arrays_of_another_size_are_refused(specs):
    size = layouts.outcome_type(specs).itemsize
    for data in (b"", bytes(size - 1), bytes(size + 1), bytes(2 * size)):

        def answer(request, data=data):
            if request.kind == "hello":
                return Message("done", request.number, welcome(specs)).frames()
            return Message("done", request.number, data=data if request.kind == "reset" else b"")

        def frames(request, answer=answer):
            found = answer(request)
            return found if isinstance(found, list) else found.frames()

        with impostor(frames) as address:
            there = RemoteWorlds(address, timeout_s=5.0)
            env = VecaEnv(there.cfg, 1, 0, host=RemoteHost(there))
            with closing(env), pytest.raises(RemoteError, match=naming("bytes", address)):
                env.reset()


def with_part(specs, part):
    """Answer a greeting, and every further request with one part of a result."""
    size = layouts.outcome_type(specs).itemsize

    def answer(request):
        fields = {"hello": welcome(specs), "open": {}}.get(request.kind, {"part": part})
        return Message("done", request.number, fields, bytes(size)).frames()

    return answer


@pytest.mark.parametrize("part", [-1, 2, "0", None, 2**60])
def test_parts_that_no_result_has_are_refused(specs, part):
    with impostor(with_part(specs, part)) as address:
        there = RemoteWorlds(address, timeout_s=5.0)
        env = VecaEnv(there.cfg, 2, 0, host=RemoteHost(there))
        with closing(env), pytest.raises(RemoteError, match=naming("part", address)):
            env.reset()


def test_a_server_that_never_sends_the_first_part_is_given_up(specs):
    with impostor(with_part(specs, 1)) as address:
        there = RemoteWorlds(address, timeout_s=0.5)
        env = VecaEnv(there.cfg, 2, 0, host=RemoteHost(there))
        with closing(env), pytest.raises(RemoteError, match=naming("0.5 s", address)):
            env.reset()


def test_arrays_larger_than_the_specs_allow_are_not_read(specs):
    def answer(request):
        if request.kind == "hello":
            return Message("done", request.number, welcome(specs)).frames()
        return Message("done", request.number, data=bytes(100_000_000)).frames()

    with impostor(answer) as address:
        there = RemoteWorlds(address, timeout_s=1.0)
        with pytest.raises(RemoteError, match=naming(address)):
            there.open(1)


def test_numbers_of_any_bits_are_taken_as_they_are(specs):
    """A server may lie about what happens in its worlds: the client gets that, and no more."""
    rng = np.random.default_rng(0)

    def answer(request):
        if request.kind == "hello":
            return Message("done", request.number, welcome(specs)).frames()
        worlds = len(request.fields.get("worlds", [])) if request.kind != "open" else 0
        data = rng.bytes(worlds * layouts.outcome_type(specs).itemsize)
        return Message("done", request.number, data=data).frames()

    with impostor(answer) as address:
        there = RemoteWorlds(address, timeout_s=5.0)
        env = VecaEnv(there.cfg, 1, 0, host=RemoteHost(there))
        with closing(env), np.errstate(over="ignore", invalid="ignore"):
            played = env.rollout(3, break_when_any_done=False)
    assert played.batch_size == (1, 3)


def test_a_reason_that_is_no_text_is_refused(specs):
    def answer(request):
        return [MARK, msgpack.packb(["refused", request.number, {"reason": 5, "message": [1]}])]

    with impostor(answer) as address, pytest.raises(RemoteError, match=naming(address)):
        RemoteWorlds(address, timeout_s=5.0)
