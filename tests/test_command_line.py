"""The grammar of the commands that are not Hydra applications."""

import sys
from dataclasses import dataclass, field
from importlib import import_module

import pytest
from omegaconf import MISSING
from refusals import naming

from veca_marl.config import ConfigError, compose
from veca_marl.config.command_line import CommandLine
from veca_marl.override_text import normalised, quoted
from veca_marl.version import __version__


@dataclass
class ToolCfg:
    sizes: list[int] = field(default_factory=lambda: [1])
    margin: float = 0.5

    def __post_init__(self):
        if self.margin < 0:
            raise ValueError(f"tool.margin must be 0 or more, got {self.margin}")


@dataclass
class ToolOptions:
    run: str = MISSING
    episodes: int = 16
    tool: ToolCfg = field(default_factory=ToolCfg)


LINE = CommandLine("tool", ToolOptions, "Does something.")
RUN = "run=runs/KickTheBall/2026-11-22_05-00-00/checkpoints/000512.pt"


def test_options_and_other_overrides_are_separated():
    jobs = list(LINE.jobs([RUN, "senses/audio=mono", "episodes=1e2", "tool.sizes=[1,2]", "seed=3"]))
    assert len(jobs) == 1
    options, others = jobs[0]
    assert options == ToolOptions(RUN.partition("=")[2], 100, ToolCfg([1, 2]))
    assert others == ["senses/audio=mono", "seed=3"]


def test_multirun_runs_every_combination():
    words = [RUN, "-m", "senses/audio=hrtf,mono", "episodes=1,2", "tool.sizes=[1,2]"]
    jobs = [(o.episodes, others) for o, others in LINE.jobs(words)]
    assert jobs == [
        (1, ["senses/audio=hrtf"]),
        (2, ["senses/audio=hrtf"]),
        (1, ["senses/audio=mono"]),
        (2, ["senses/audio=mono"]),
    ]


def test_runs_that_would_write_the_same_file_are_refused():
    line = CommandLine("tool", ToolOptions, "Does something.", outputs=("run",))
    with pytest.raises(ConfigError, match=naming("run=a", "2", "run=A,B")):
        next(line.jobs(["-m", "run=a", "episodes=1,2"]))
    assert [o.run for o, _ in line.jobs(["-m", "run=a,b", "seed=1"])] == ["a", "b"]


@pytest.mark.parametrize(
    ("words", "parts"),
    [
        ([], ("run=VALUE",)),
        ([RUN, "epsodes=3"], ("'epsodes'", "episodes", "run")),
        ([RUN, "tool.size=[1]"], ("'tool.size'", "sizes", "margin")),
        ([RUN, "tool.sizes=[x]"], ("tool.sizes[0]", "'x'")),
        ([RUN, "episodes=1.5e0"], ("episodes", "'1.5'")),
        ([RUN, "tool.margin=-1"], ("tool.margin", "-1")),
        ([RUN, "--episodes", "3"], ("'--episodes'", "--help")),
        ([RUN, "senses/audio=hrtf,mono"], ("senses/audio=hrtf,mono", "-m")),
        (["runs/KickTheBall"], ("runs/KickTheBall",)),
        ([RUN, "x y=1"], ("x y=1",)),
    ],
)
def test_errors_are_one_line(words, parts, capsys):
    with pytest.raises(ConfigError, match=naming(*parts)):
        list(LINE.jobs(words))
    assert LINE.run(lambda options, others: None, words) == 2
    printed = capsys.readouterr()
    assert printed.err.startswith("error: ")
    assert printed.err.count("\n") == 1


def test_help_lists_the_options(capsys):
    assert LINE.run(lambda options, others: pytest.fail("the command was called"), ["--help"]) == 0
    printed = capsys.readouterr().out
    assert "Does something." in printed
    assert "episodes: 16" in printed


# ---- paths

AWKWARD = [
    "/data/a (1)",
    "/data/köpfe/a",
    "/a/b=c",
    "/a/it's",
    "/a/b[1]{2}",
    "/a/b  c",
    "./x~y",
    "/a\\",
]


@pytest.mark.parametrize("path", AWKWARD)
def test_a_path_is_read_as_it_is(path):
    ((options, _),) = LINE.jobs([f"run={path}"])
    assert options.run == path


def test_home_is_expanded(monkeypatch):
    monkeypatch.setenv("HOME", "/home/jo (b)")
    ((options, _),) = LINE.jobs(["run=~/runs/x"])
    assert options.run == "/home/jo (b)/runs/x"
    assert [o.run for o, _ in LINE.jobs(["-m", "run=~/a,~/b"])] == [
        "/home/jo (b)/a",
        "/home/jo (b)/b",
    ]


@pytest.mark.parametrize("path", AWKWARD)
def test_a_quoted_path_stays_as_it_is(path):
    ((options, _),) = LINE.jobs([f"run={quoted(path)}"])
    assert options.run == path
    assert normalised([f"run={quoted('~/a')}"]) == ["run='~/a'"]


@pytest.mark.parametrize("name", ["KickTheBall,collect=one", "a (1)", "it's, here"])
@pytest.mark.parametrize("ending", ["", ":red"])
def test_a_path_that_exists_is_read_whatever_its_characters(tmp_path, monkeypatch, name, ending):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "runs" / name).mkdir(parents=True)
    for path in (f"runs/{name}{ending}", f"{tmp_path}/runs/{name}{ending}"):
        ((options, _),) = LINE.jobs([f"run={path}"])
        assert options.run == path


@pytest.mark.parametrize(
    "value",
    ["[~/a,/b (1)]", "['a',./b]", "'/data/a,/b'", '"/a,~/b"', "choice(/a,/b)", "{a:/x,b:/y}"],
)
def test_paths_within_other_values_stay_as_they_are(value):
    assert normalised([f"key={value}"]) == [f"key={value}"]


def test_paths_of_a_configuration_are_read_like_those_of_commands(tmp_path):
    path = tmp_path / "köpfe (neu)" / "it's.sofa"
    cfg = compose(["+task=KickTheBall", f"senses.audio.sofa_path={path}"])
    assert cfg.senses.audio.sofa_path == str(path)


def test_the_error_about_another_text_names_the_quoted_one():
    with pytest.raises(ConfigError, match=naming("run=köpfe", "run='köpfe'")):
        next(LINE.jobs(["run=köpfe"]))


def test_the_version_is_that_of_this_package(capsys):
    assert LINE.run(lambda *_: None, ["--version"]) == 0
    assert capsys.readouterr().out.split() == ["veca_marl", __version__]


@pytest.mark.parametrize("words", ["--config-name nope", "-cn nope", "--config-name=nope"])
def test_an_unknown_configuration_is_refused_with_the_choices(words, monkeypatch, capsys):
    train = import_module("veca_marl.train")
    monkeypatch.setattr(sys, "argv", ["train", *words.split(), "+task=KickTheBall"])
    with pytest.raises(SystemExit):
        train.main()
    (line,) = capsys.readouterr().err.strip().splitlines()
    assert "nope" in line
    assert "config" in line
