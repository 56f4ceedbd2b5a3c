"""Folders of runs of unknown origin: each ends in one line, executes nothing, is quick.

Whatever a folder holds, `evaluate` and `resume` either do their work, or end with one line and exit
status 1 or 2. No file outside of the folder changes, and nothing is imported.
"""

import json
import os
import re
import shutil
import sys
import time
import zipfile
from pathlib import Path

import numpy as np
import pytest
import torch
from commands import train
from stored_runs import train_tiny

from veca_marl.algos.checkpoints import CheckpointError, map_checkpoint, read_checkpoint
from veca_marl.algos.specs import TeamSpec
from veca_marl.algos.transfer import load_actor
from veca_marl.evaluate import main as evaluate
from veca_marl.tournament import main as tournament

LIMIT_S = 5.0  # of processor time
SECRET = "s3cr3t-token"


@pytest.fixture(scope="module")
def complete(tmp_path_factory):
    folder = tmp_path_factory.mktemp("hostile") / "complete"
    return train_tiny(folder, 8, "log=csv", "log.video=false", "log.progress_bar=false")


@pytest.fixture
def run(complete, tmp_path):
    return Path(shutil.copytree(complete, tmp_path / "run"))


@pytest.fixture
def own(tmp_path, monkeypatch):
    """The user's folder, in which commands are called; a module there must not be imported."""
    folder = tmp_path / "own"
    folder.mkdir()
    (folder / "thesis.txt").write_text("own")
    (folder / "stranger.py").write_text("from pathlib import Path\nPath('executed').touch()\n")
    monkeypatch.chdir(folder)
    monkeypatch.setenv("SECRET_TOKEN", SECRET)
    monkeypatch.syspath_prepend(folder)
    return folder


def content(folder):
    return {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def latest(run):
    return sorted((run / "checkpoints").glob("frames_*.pt"))[-1]


class Config:
    """Changes the text of `config.yaml`."""

    def __init__(self, pattern, replacement):
        self.pattern, self.replacement = pattern, replacement

    def __call__(self, run):
        path = run / "config.yaml"
        before = path.read_text()
        text = re.sub(self.pattern, lambda _: self.replacement, before, count=1, flags=re.M)
        assert text != before
        path.write_text(text)


class Content:
    """Writes another content into a file, or puts something else in its place."""

    def __init__(self, name, new):
        self.name, self.new = name, new

    def __call__(self, run):
        path = run / self.name
        path.unlink(missing_ok=True)
        if callable(self.new):
            self.new(path)
        else:
            path.write_bytes(self.new if isinstance(self.new, bytes) else self.new.encode())


class Provenance:
    """Changes entries of `provenance.json`."""

    def __init__(self, **entries):
        self.entries = entries

    def __call__(self, run):
        path = run / "provenance.json"
        path.write_text(json.dumps(json.loads(path.read_text()) | self.entries))


class Checkpoint:
    """Changes the content of all checkpoints, in place or by another one."""

    def __init__(self, change):
        self.change = change

    def __call__(self, run):
        for path in (run / "checkpoints").glob("*.pt"):
            stored = torch.load(path, weights_only=True)
            changed = self.change(stored)
            torch.save(stored if changed is None else changed, path)


def replaced(*keys, by):
    """Return what replaces an entry of nested mappings."""

    def change(stored):
        for key in keys[:-1]:
            stored = stored[key]
        assert keys[-1] in stored
        stored[keys[-1]] = by

    return Checkpoint(change)


def weights(stored):
    return stored["state"]["actors"]["agents"]


def fill(value):
    def change(stored):
        for tensor in weights(stored).values():
            tensor.fill_(value)

    return Checkpoint(change)


def repeat(stored):
    name = next(name for name, tensor in weights(stored).items() if tensor.ndim == 2)
    weights(stored)[name] = torch.zeros(1).expand(200_000, 200_000)


def doubled(levels):
    """Return nested lists that stand for ``2**levels`` entries."""
    entry = [0.2]
    for _ in range(levels):
        entry = [entry, entry]
    return entry


class Call:
    def __reduce__(self):
        return os.system, ("touch executed",)


def pickled(run):
    torch.save({"format": 3, "call": Call()}, latest(run))


def recompressed(run, grown=0):
    path = latest(run)
    with zipfile.ZipFile(path) as stored:
        records = {name: stored.read(name) for name in stored.namelist()}
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as packed:
        for name, record in records.items():
            packed.writestr(name, bytes(grown) if grown and name.endswith("/data/0") else record)


def flipped(run):
    content = bytearray(latest(run).read_bytes())
    content[len(content) // 2] ^= 0x40
    latest(run).write_bytes(content)


def lists(width, levels):
    rows = [f"a0: &a0 [{', '.join('x' * width)}]"]
    for level in range(1, levels):
        rows.append(f"a{level}: &a{level} [{', '.join([f'*a{level - 1}'] * width)}]")
    return "\n".join(rows) + "\n"


AGENTS = ("algorithms", "agents")
PROGRESS = ("state", "progress")
HOSTILE = {
    "aliases": Config(r"\A", lists(9, 9)),
    "alias of a value": Config(r"^seed: 0$", "seed: &s 0\nthreads: *s"),
    "python tag": Config(r"^seed: 0$", "seed: !!python/object/apply:os.system ['touch executed']"),
    "tag": Config(r"^seed: 0$", "seed: !!binary aGk="),
    "deep lists": Config(r"\Z", f"x: {'[' * 5000}{']' * 5000}\n"),
    "many values": Config(r"\Z", f"x: [{'1,' * 100_000}1]\n"),
    "large file": Config(r"\Z", f"x: {'a' * 2_000_000}\n"),
    "environment": Config(r"^  name: KickTheBall$", "  name: ${oc.env:SECRET_TOKEN}"),
    "environment in a list": Config(r"^plugins: \[\]$", "plugins: ['${oc.env:SECRET_TOKEN}']"),
    "interpolation of itself": Config(r"^seed: 0$", "seed: ${seed}"),
    "number as a key": Config(r"\A", "1: 2\n"),
    "long number": Config(r"^seed: 0$", f"seed: {'1' * 5000}"),
    "null": Content("config.yaml", "null\n"),
    "list": Content("config.yaml", "[1, 2]\n"),
    "not UTF-8": Content("config.yaml", b"task: \xff\xfe\n"),
    "folder as config": Content("config.yaml", Path.mkdir),
    "pipe as config": Content("config.yaml", os.mkfifo),
    "task is a list": Config(r"^  name: KickTheBall$", "  name: [1, 2]"),
    "task is missing": Config(r"^task:$", "no_task:"),
    "task is missing a value": Config(r"^  name: KickTheBall$", "  name: ???"),
    "algo is missing": Config(r"^algo:$", "no_algo:"),
    "algo is text": Config(r"^seed: 0$", "seed: 0\nalgo: ppo"),
    "learner is a list": Config(r"^learner: \{\}$", "learner: [1]"),
    "learner of a number": Config(r"^learner: \{\}$", "learner: {agents: 3}"),
    "team is text": Config(r"^team: \{\}$", "team: abc"),
    "unknown team": Config(r"^team: \{\}$", "team: {ghost: {body: null}}"),
    "plugins is a number": Config(r"^plugins: \[\]$", "plugins: 7"),
    "plugins is missing a value": Config(r"^plugins: \[\]$", "plugins: ???"),
    "plugins holds null": Config(r"^plugins: \[\]$", "plugins: [null]"),
    "plugin is relative": Config(r"^plugins: \[\]$", "plugins: [.x, '']"),
    "plugin of the user": Config(r"^plugins: \[\]$", "plugins: [stranger]"),
    "target": Config(r"^log:$", "log:\n  _target_: os.system\n  _args_: ['touch executed']"),
    "many worlds": Config(r"^  worlds: 1$", "  worlds: 1.5e30"),
    "provenance is a list": Content("provenance.json", "[1]"),
    "provenance is deep": Content("provenance.json", "[" * 100_000),
    "provenance is not UTF-8": Content("provenance.json", b"\xff\xfe"),
    "pipe as provenance": Content("provenance.json", os.mkfifo),
    "bodies is a list": Provenance(bodies=[1, 2]),
    "body is a number": Provenance(bodies={"body": 7}),
    "body is unknown": Provenance(bodies={"body": "dragon"}),
    "body of a seed": Provenance(bodies={"seed": "walker", "body": "walker"}),
    "body of an unknown team": Provenance(bodies={"team.ghost.body": "walker"}),
    "identifier is a query": Provenance(id="' OR 1=1"),
    "identifier is a list": Provenance(id=[1]),
    "resumed is text": Provenance(resumed="x"),
    "weights are NaN": fill(float("nan")),
    "weights are infinite": fill(float("inf")),
    "weights repeat": Checkpoint(repeat),
    "other content": Checkpoint(lambda _: [1, 2]),
    "format is text": replaced("format", by="x" * 10_000),
    "identity is text": replaced("identity", by="x"),
    "task is none": replaced("identity", "task", by=None),
    "specs are none": replaced("identity", "specs", by=None),
    "spec is a number": replaced("identity", "specs", "agents", by=3),
    "agents is text": replaced("identity", "specs", "agents", "agents", by="x"),
    "configuration is a list": replaced("config", by=[1]),
    "value is a tensor": replaced("config", "seed", by=torch.zeros(2)),
    "value stands for many": replaced("config", "seed", by=doubled(40)),
    "algorithms is a list": replaced("algorithms", by=[1]),
    "algorithm is a number": replaced(*AGENTS, by=3),
    "algorithm is a path": replaced(*AGENTS, "name", by="../../x"),
    "number is text": replaced(*AGENTS, "clip", by="abc"),
    "number is a list": replaced(*AGENTS, "epochs", by=[1]),
    "network is none": replaced(*AGENTS, "network", by=None),
    "network is huge": replaced(*AGENTS, "network", "trunk_features", by=200_000),
    "state is a number": replaced("state", by=3),
    "state is empty": replaced("state", by={}),
    "actor is a list": replaced("state", "actors", "agents", by=[1]),
    "learnt is a number": replaced("state", "algorithm", "agents", by=3),
    "frames are text": replaced(*PROGRESS, "frames", by="x"),
    "best return is NaN": replaced(*PROGRESS, "best_return", by=float("nan")),
    "pickle": pickled,
    "changed bit": flipped,
    "compressed": recompressed,
    "zip bomb": lambda run: recompressed(run, grown=500_000_000),
    "folder as checkpoint": lambda run: Content(latest(run).relative_to(run), Path.mkdir)(run),
    "pipe as checkpoint": lambda run: Content(latest(run).relative_to(run), os.mkfifo)(run),
    "metrics is not UTF-8": Content("metrics.csv", b"frames,x\n4,\xff\n"),
    "metrics has no frames": Content("metrics.csv", "x,y\n1,2\n"),
    "metrics has zeros": Content("metrics.csv", b"frames,x\n4,\0\n" + b"\0" * 100),
    "metrics has long rows": Content("metrics.csv", "frames,x\n4,1,2,3\n4,1\n"),
    "pipe as metrics": Content("metrics.csv", os.mkfifo),
    "folder as metrics": Content("metrics.csv", Path.mkdir),
    "evaluations without numbers": Content("evaluations.csv", "frames,player\nx,y\n"),
}
WITHOUT_EFFECT_ON_EVALUATE = {
    "resumed is text",
    "configuration is a list",
    "learnt is a number",
    "frames are text",
    "best return is NaN",
    "changed bit",  # in the state of the optimiser
    *(name for name in HOSTILE if "metrics" in name or "evaluations" in name),
}
WITHOUT_EFFECT_ON_RESUME = {
    "number is text",
    "number is a list",
    "network is none",
    "network is huge",
    "algorithm is a path",
    "actor is a list",
    "metrics has zeros",
}
QUICK = ("aliases", "environment", "weights are NaN", "pickle", "metrics is not UTF-8")
CASES = [pytest.param(name, marks=() if name in QUICK else pytest.mark.slow) for name in HOSTILE]


def check(name, may_work, call, run, own, capsys):
    HOSTILE[name](run)
    before, modules, begin = content(own), set(sys.modules), time.process_time()
    status = call()
    took_s = time.process_time() - begin
    output, errors = capsys.readouterr()
    assert content(own) == before
    assert not {module for module in set(sys.modules) - modules if "stranger" in module}
    assert SECRET not in output + errors
    assert took_s < LIMIT_S
    if may_work and status == 0:
        return
    assert status in (1, 2)
    (line,) = (line for line in errors.splitlines() if line.strip())
    assert line.startswith("error: ")
    assert len(line) < 1500
    assert "weights_only" not in line


@pytest.mark.parametrize("name", CASES)
def test_evaluate_ends_in_one_line(name, run, own, capsys):
    words = [f"run={run}", "episodes=1", "eval.worlds=1"]
    check(name, name in WITHOUT_EFFECT_ON_EVALUATE, lambda: evaluate(words), run, own, capsys)


@pytest.mark.slow
@pytest.mark.parametrize("name", CASES)
def test_a_run_that_is_resumed_ends_in_one_line(name, run, own, capsys):
    words = [f"resume={run}", "total_frames=12", "log.progress_bar=false"]
    check(name, name in WITHOUT_EFFECT_ON_RESUME, lambda: train(own, *words), run, own, capsys)


def test_the_run_without_damage_is_evaluated_and_continued(run, own):
    assert evaluate([f"run={run}", "episodes=1", "eval.worlds=1"]) == 0
    assert tournament([f"run={run}", "episodes=1"]) == 2
    words = [f"resume={run}", "total_frames=12", "log.progress_bar=false"]
    assert train(own, *words) == 0


def test_each_changed_bit_of_a_checkpoint_is_noticed_or_without_effect(run):
    """Bits between the records of the file have no meaning."""
    path = latest(run)
    sound = path.read_bytes()
    specs = read_checkpoint(path, torch.device("cpu"))["identity"]["specs"]
    spec = TeamSpec.from_dict(specs["agents"])
    expected = load_actor(path, "agents", spec).state_dict()
    generator, refused = np.random.default_rng(0), 0
    for position in generator.integers(len(sound), size=60):
        damaged = bytearray(sound)
        damaged[position] ^= 1 << int(generator.integers(8))
        path.write_bytes(damaged)
        try:
            read_checkpoint(path, torch.device("cpu"))
            found = load_actor(path, "agents", spec).state_dict()
            assert all(torch.equal(found[name], expected[name]) for name in expected)
        except CheckpointError:
            refused += 1
    assert refused > 30


def test_a_changed_weight_is_noticed_where_only_the_actor_is_read(run):
    path = latest(run)
    stored, _ = map_checkpoint(path)
    weight = next(tensor for tensor in weights(stored).values() if tensor.numel() > 100)
    place = path.read_bytes().find(weight.numpy().tobytes())
    del stored, weight
    content = bytearray(path.read_bytes())
    content[place + 7] ^= 1
    path.write_bytes(content)
    stored, verify = map_checkpoint(path)
    with pytest.raises(CheckpointError, match="checksum"):
        verify(stored["state"]["actors"])
