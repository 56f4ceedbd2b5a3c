"""The printed argument that continues a run, for folders of any name."""

import shlex
from dataclasses import dataclass, field

import pytest
from commands import train
from hydra.core.override_parser.overrides_parser import OverridesParser

from veca_marl.runs.continuation import is_default, resume_argument

SMOKE = ["+experiment=smoke", "senses/vision=blind", "log=silent", "threads=1", "total_frames=64"]
ODD = "algo.gamma=0.9, (it's odd)"


@pytest.mark.parametrize(
    "path",
    [
        "/runs/a-b_c/2026.1",
        "runs/sweeps/algo.gamma=0.9/seed_0",
        f"/{ODD}/a\\b",
        "a\\'b\\\\",
        "/~/[a]{b}:é;&$HOME#",
        "null",
        "3",
    ],
)
def test_hydra_reads_the_path_that_a_shell_passes_on(path):
    (word,) = shlex.split(resume_argument(path))
    parsed = OverridesParser.create().parse_override(word)
    assert (parsed.key_or_group, parsed.value()) == ("resume", path)


def test_a_usual_path_has_no_quotation_marks():
    assert resume_argument("/runs/a-b_c/2026.1") == "resume=/runs/a-b_c/2026.1"


@pytest.mark.slow
def test_the_printed_argument_continues_the_run(tmp_path, capsys):
    start = [*SMOKE, f"hydra.run.dir={tmp_path / 'run'}"]
    assert train(tmp_path, *start) == 0
    run = (tmp_path / "run").rename(tmp_path / ODD)
    shown = interrupted(tmp_path, capsys, run)
    _, _, argument = shown.partition("continue with: python -m veca_marl.train ")
    assert train(tmp_path, *shlex.split(argument), "total_frames=128", "log.video=false") == 0
    assert '"frames": 128, "ended": true' in (run / "progress.json").read_text()


def interrupted(folder, capsys, run):
    """Return what is printed when continuing a run is interrupted."""

    def interrupt(*_):
        raise KeyboardInterrupt

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("veca_marl.runs.training.make_reporters", interrupt)
        assert train(folder, *shlex.split(resume_argument(run)), "total_frames=128") == 130
    return capsys.readouterr().err.strip().splitlines()[-1]


@dataclass
class Leaf:
    """A field whose default depends on another one."""

    width_m: float
    partition: bool = False
    height_m: float = 0.0

    def __post_init__(self):
        self.height_m = self.height_m or 2.0 * self.width_m


@dataclass
class Rooms:
    props: list[Leaf] = field(default_factory=list)
    named: dict[str, Leaf] = field(default_factory=dict)
    seed: int = 0


@pytest.mark.parametrize(
    ("key", "expected"),
    [
        ("seed", False),
        ("named", False),
        ("props.0.partition", True),
        ("props.1.partition", False),
        ("props.0.height_m", True),
        ("props.1.height_m", False),
        ("props.0.width_m", False),
        ("named.door.partition", True),
        ("named.door", False),
    ],
)
def test_a_field_that_was_not_set_is_told_from_others(key, expected):
    props = [Leaf(0.9), Leaf(0.9, partition=True, height_m=3.0)]
    cfg = Rooms(props, {"door": Leaf(0.9)}, seed=3)
    assert is_default(cfg, key) is expected
