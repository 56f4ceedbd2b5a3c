"""Keys: who may connect, and who may read the files."""

import json
import stat
from contextlib import closing

import pytest
import zmq
from refusals import naming
from served import served, torchrl_env

from veca_marl.remote.channel import RemoteError
from veca_marl.remote.client import RemoteWorlds
from veca_marl.remote.keys import (
    KeyFileError,
    add_client,
    load_client_keys,
    load_server_keys,
    make_server_keys,
)
from veca_marl.remote.server import ServerCfg


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("keys") / "own"
    make_server_keys(folder)
    add_client(folder, "trainer")
    return folder


@pytest.fixture(scope="module")
def locked(cfg, folder):
    with served(cfg, 1, keys=load_server_keys(folder)) as server:
        yield server


def test_a_client_with_its_key_is_served(locked, folder):
    with closing(torchrl_env(locked, 1, key=folder / "trainer.key.json")) as env:
        assert env.rollout(3).shape == (1, 3)


@pytest.mark.parametrize("address", ["tcp://*:5555", "tcp://127.0.0.1:*", "tcp://-:80"])
def test_an_address_to_listen_at_is_none_to_connect_to(address):
    with pytest.raises(ValueError, match=naming(address)):
        RemoteWorlds(address, timeout_s=5.0)


def test_a_peer_without_a_key_is_refused(locked):
    with pytest.raises(RemoteError, match=naming(locked.address, "key=")):
        RemoteWorlds(locked.address, timeout_s=20.0)


def test_a_peer_with_a_key_that_the_server_does_not_know_is_refused(locked, folder, tmp_path):
    content = json.loads((folder / "trainer.key.json").read_text())
    content["public"], content["secret"] = (key.decode() for key in zmq.curve_keypair())
    file = tmp_path / "other.key.json"
    file.write_text(json.dumps(content))
    file.chmod(0o600)
    with pytest.raises(RemoteError, match=naming(locked.address, "keys")):
        RemoteWorlds(locked.address, file, timeout_s=20.0)


def test_a_client_does_not_talk_to_another_server_than_that_of_its_key(server, locked, tmp_path):
    make_server_keys(tmp_path)
    file = add_client(tmp_path, "trainer")
    for wrong in (server, locked):
        with pytest.raises(RemoteError, match=naming(wrong.address, "keys")):
            RemoteWorlds(wrong.address, file, timeout_s=20.0)


def test_secrets_are_readable_by_their_owner_only(folder):
    for file in ("server.json", "trainer.key.json"):
        assert stat.S_IMODE((folder / file).stat().st_mode) == 0o600
    assert stat.S_IMODE(folder.stat().st_mode) == 0o700
    for keys in (load_server_keys(folder), load_client_keys(folder / "trainer.key.json")):
        assert keys.secret not in repr(keys)
        assert keys.secret not in str(keys)


@pytest.mark.parametrize("mode", [0o640, 0o604, 0o660])
def test_secrets_that_others_could_read_are_refused(folder, tmp_path, mode):
    file = tmp_path / "key.json"
    file.write_text((folder / "trainer.key.json").read_text())
    file.chmod(mode)
    with pytest.raises(KeyFileError, match=naming(file, "chmod 600")):
        load_client_keys(file)


@pytest.mark.parametrize(
    "content", ["", "[]", "{}", '{"public": 1}', '{"public": "' + "x" * 39 + '"}', "\0", "[" * 9999]
)
def test_damaged_files_are_errors_of_one_line(tmp_path, content):
    file = tmp_path / "key.json"
    file.write_text(content)
    file.chmod(0o600)
    with pytest.raises(KeyFileError, match=naming(file)):
        load_client_keys(file)


@pytest.mark.parametrize("name", ["", "..", "a/b", "../a", ".hidden", "x" * 65, "a b"])
def test_names_that_are_no_names_are_refused(folder, name):
    with pytest.raises(KeyFileError, match="name"):
        add_client(folder, name)


def test_keys_are_not_overwritten(folder):
    before = (folder / "server.json").read_text()
    with pytest.raises(KeyFileError, match="exists"):
        make_server_keys(folder)
    with pytest.raises(KeyFileError, match="exists"):
        add_client(folder, "trainer")
    assert (folder / "server.json").read_text() == before
    assert list(load_server_keys(folder).clients.values()) == ["trainer"]


@pytest.mark.parametrize(
    ("address", "is_reached"),
    [
        ("tcp://127.0.0.1:5555", False),
        ("tcp://127.3.2.1:5555", False),
        ("tcp://localhost:5555", False),
        ("tcp://[::1]:5555", False),
        ("tcp://0.0.0.0:5555", True),
        ("tcp://*:5555", True),
        ("tcp://[::]:5555", True),
        ("tcp://192.168.1.7:5555", True),
        ("tcp://eth0:5555", True),
        ("tcp://localhost.example.org:5555", True),
    ],
)
def test_beyond_this_machine_a_server_needs_keys_or_a_plain_word(address, is_reached):
    ServerCfg(address).check(has_keys=True)
    ServerCfg(address, without_keys=True).check(has_keys=False)
    if is_reached:
        with pytest.raises(ValueError, match=naming("keys=", "without_keys=true")):
            ServerCfg(address).check(has_keys=False)
    else:
        ServerCfg(address).check(has_keys=False)
