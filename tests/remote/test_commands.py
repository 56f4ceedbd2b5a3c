"""`veca_marl.serve` and `veca_marl.connect`: arguments, errors of one line, a server of its own."""

import re
import signal
import subprocess
import sys

import numpy as np
import pytest
from refusals import naming

import veca_marl
from veca_marl.config import ConfigError
from veca_marl.remote.channel import RemoteError
from veca_marl.serve.command import main

CHEAP = ["+task=KickTheBall", "playground=simple", "senses/vision=blind"]


@pytest.mark.parametrize(
    ("words", "named"),
    [
        (["worlds=0"], ["worlds=0"]),
        (["clients=0"], ["clients=0"]),
        (["limit_s=0"], ["limit_s=0"]),
        (["busy_wait_s=2"], ["busy_wait_s=2", "1"]),
        (["address=5555"], ["'5555'", "tcp://"]),
        (["address=tcp://127.0.0.1:99999"], ["99999", "tcp://"]),
        (["address=tcp://0.0.0.0:5555"], ["0.0.0.0", "keys=", "without_keys=true"]),
        (["address=tcp://no.such.host:5555", "without_keys=true"], ["no.such.host"]),
        (["new_client=me"], ["new_client=me", "keys="]),
        (["keys=nowhere"], ["nowhere"]),
        (["keys=a", "without_keys=true"], ["keys=a", "without_keys"]),
        (["algo=sac"], ["algo=sac", "playground"]),
        (["adress=tcp://127.0.0.1:5555"], ["adress", "address"]),
        (["+task=Chess"], ["Chess", "KickTheBall"]),
    ],
)
def test_impossible_words_end_with_one_line(words, named, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    own = [] if any("task" in word for word in words) else CHEAP
    assert main([*own, *words]) == 2
    printed = capsys.readouterr()
    lines = [line for line in printed.err.splitlines() if not line.startswith("compiling")]
    assert len(lines) == 1
    assert all(part in printed.err for part in named), printed.err


def test_keys_are_made_for_one_client_after_another(tmp_path, capsys):
    folder = tmp_path / "keys"
    for name in ("one", "two"):
        assert main([f"keys={folder}", f"new_client={name}"]) == 0
        assert str(folder / f"{name}.key.json") in capsys.readouterr().out
    assert main([f"keys={folder}", "new_client=two"]) == 2
    assert "two.json" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        ({"library": "rllib"}, ["'rllib'", "torchrl", "gymnasium", "pettingzoo"]),
        ({"render_mode": "rgb_array"}, ["render_mode", "torchrl"]),
        ({"layout": "flat"}, ["layout", "torchrl"]),
        ({"library": "gymnasium", "worlds": 2}, ["worlds", "gymnasium"]),
        ({"library": "pettingzoo", "device": "cpu"}, ["device", "pettingzoo"]),
    ],
)
def test_arguments_of_another_library_are_refused(arguments, named):
    with pytest.raises(ConfigError, match=naming(*named)):
        veca_marl.connect("tcp://127.0.0.1:9", **arguments)


@pytest.mark.parametrize("address", ["127.0.0.1:5555", "tcp://127.0.0.1", "ipc:///tmp/x", 5, ""])
def test_what_is_no_address_is_refused(address):
    with pytest.raises(ValueError, match=naming("address", "tcp://")):
        veca_marl.connect(address)


@pytest.mark.parametrize("seconds", [0, -1.0, float("nan"), float("inf"), "5"])
def test_a_time_that_is_none_is_refused(seconds):
    with pytest.raises(ValueError, match="timeout_s"):
        veca_marl.connect("tcp://127.0.0.1:9", timeout_s=seconds)


def test_a_layout_or_render_mode_that_there_is_not_leaves_no_worlds_behind(server):
    for wrong in ({"layout": "round"}, {"render_mode": "drawn"}):
        with pytest.raises(ValueError, match=next(iter(wrong.values()))):
            veca_marl.connect(server.address, library="gymnasium", **wrong)
    with pytest.raises(ValueError, match="seed"):
        veca_marl.connect(server.address, seed=-1)
    assert not server._sessions


@pytest.mark.slow  # it starts the command
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGKILL])
def test_a_server_ends_with_its_worlds_however_it_ends(tmp_path, number):
    """The command, in a process of its own; its clients are told if it can."""
    command = [sys.executable, "-m", "veca_marl.serve", *CHEAP, "address=tcp://127.0.0.1:*"]
    server = subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=tmp_path
    )
    address = re.search(r"tcp://[\d.:]*\d", server.stdout.readline())[0]
    env = veca_marl.connect(address, library="pettingzoo", timeout_s=2.0)
    env.reset(seed=0)
    server.send_signal(number)
    server.wait(20.0)
    with pytest.raises(RemoteError, match="timeout_s" if number == signal.SIGKILL else "stopped"):
        env.step({name: np.zeros(2, np.float32) for name in env.agents})
    env.close()
    # its standard error ends when the last of its processes has ended
    _, printed = server.communicate(timeout=20.0)
    assert "Traceback" not in printed


def test_a_client_can_choose_device_and_worlds(server):
    env = veca_marl.connect(server.address, worlds=2, seed=3, device="cpu")
    assert env.batch_size == (2,)
    assert env.reset().device.type == "cpu"
    env.close()
    env = veca_marl.connect(server.address)
    assert env.batch_size == (3,)
    env.close()
