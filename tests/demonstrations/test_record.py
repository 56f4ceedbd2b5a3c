"""Recording: the same bytes by any number of processes, and after an interruption."""

import errno
import json
import shutil
from importlib.metadata import version

import pytest
from composed import compose
from refusals import naming
from rollouts import game_cfg

from veca_marl.algos.demonstration_files import CARD, INDEX, DemonstrationsError
from veca_marl.algos.demonstrations import Demonstrations
from veca_marl.algos.files import WriteError
from veca_marl.config import ConfigError
from veca_marl.demonstrations import episode_files, main
from veca_marl.demonstrations.episode_files import Archive
from veca_marl.demonstrations.record import Recording, make_card, record
from veca_marl.envs.core.expert import has_expert
from veca_marl.envs.core.task import TASKS

SHORT = ["+task=KickTheBall", "task.max_seconds=0.4", "senses/vision=blind"]


def recording(episodes=4, seed=0, *overrides):
    return Recording(compose([*SHORT, *overrides]).game, episodes, seed)


def recorded(folder, processes=0, **choices):
    what = recording(**choices)
    archive = Archive(folder, make_card(what, {}))
    archive.begin()
    record(what, archive, processes, bar=False)
    return Demonstrations(folder)


def content(folder):
    return {
        path.relative_to(folder): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file() and path.name != ".lock"
    }


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    folder = tmp_path_factory.mktemp("whole")
    recorded(folder)
    return folder


@pytest.mark.parametrize("processes", [1, 2])
def test_the_number_of_processes_changes_no_byte(tmp_path, whole, processes):
    recorded(tmp_path, processes)
    assert content(tmp_path) == content(whole)


class KilledError(Exception):
    """Stands for the end of the process."""


@pytest.mark.parametrize("copies", [0, 3, 17])
def test_a_recording_continues_after_a_kill(tmp_path, whole, monkeypatch, copies):
    """The process ends while it appends, before an array or within one."""
    left, copy = [copies], shutil.copyfileobj

    def copy_or_end(source, target, length):
        left[0] -= 1
        if left[0] < 0:
            target.write(source.read(7))
            raise KilledError
        copy(source, target, length)

    monkeypatch.setattr(episode_files.shutil, "copyfileobj", copy_or_end)
    with pytest.raises(KilledError):
        recorded(tmp_path)
    monkeypatch.undo()
    with pytest.raises(DemonstrationsError, match="complete"):
        Demonstrations(tmp_path)
    recorded(tmp_path)
    assert content(tmp_path) == content(whole)


def test_a_full_disk_ends_in_one_line_and_loses_nothing_complete(tmp_path, whole, monkeypatch):
    def full(*_):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(episode_files.shutil, "copyfileobj", full)
    with pytest.raises(WriteError, match="No space"):
        recorded(tmp_path)
    monkeypatch.undo()
    recorded(tmp_path)
    assert content(tmp_path) == content(whole)


def test_more_episodes_are_added(tmp_path, whole):
    recorded(tmp_path, episodes=2)
    recorded(tmp_path, episodes=4)
    assert content(tmp_path) == content(whole)
    with pytest.raises(DemonstrationsError, match=naming(4, 2)):
        recorded(tmp_path, episodes=2)


def test_other_demonstrations_in_the_folder_are_refused(tmp_path):
    recorded(tmp_path, episodes=1)
    with pytest.raises(DemonstrationsError, match=naming("seed", 0, 1)):
        recorded(tmp_path, episodes=1, seed=1)
    other = Recording(compose([*SHORT, "task.mass_kg=0.777"]).game, 1, 0)
    with pytest.raises(DemonstrationsError, match="game"):
        Archive(tmp_path, make_card(other, {}))


def test_episodes_differ_and_depend_on_the_seed(tmp_path, whole):
    found, other = Demonstrations(whole), recorded(tmp_path, episodes=1, seed=1)
    digests = [episode.digest for episode in [*found.episodes, *other.episodes]]
    assert len(set(digests)) == 5


def test_the_command_records_and_says_what_there_is(tmp_path, capsys):
    words = [*SHORT, "episodes=2", "processes=0", f"to={tmp_path / 'here'}"]
    assert main(words) == 0
    card = json.loads((tmp_path / "here" / CARD).read_text())
    assert (card["task"], card["complete"], card["summary"]["steps"]) == ("KickTheBall", True, 20)
    assert card["provenance"]["packages"]["torch"] == version("torch")
    printed = capsys.readouterr().out
    assert card["checksum"] in printed
    assert main(words) == 0  # once more: nothing is left to do
    assert len((tmp_path / "here" / INDEX).read_text().splitlines()) == 2


@pytest.mark.parametrize(
    "words",
    [
        ["+task=KickTheBall", "episodes=0"],
        ["+task=KickTheBall", "processes=-1"],
        ["+task=KickTheBall", "senses/audio=deaf"],
        ["+task=Nothing"],
        ["episodes=2"],
        ["+task=KickTheBall", "sead=2"],
    ],
)
def test_impossible_choices_end_in_one_line(tmp_path, capsys, words):
    if not any(word.startswith("to=") for word in words):
        words = [*words, f"to={tmp_path}"]
    assert main(words) == 2
    error = capsys.readouterr().err
    assert error.startswith("error: ")
    assert error.count("\n") == 1


@pytest.mark.slow  # makes a world of every task
@pytest.mark.parametrize("task", sorted(task for task in TASKS if has_expert(task)))
def test_every_task_is_recorded_with_all_its_teams(tmp_path, task):
    what = Recording(game_cfg(task, "own", "task.max_seconds=0.4"), 1, 0)
    archive = Archive(tmp_path, make_card(what, {}))
    archive.begin()
    record(what, archive, 0, bar=False)
    found = Demonstrations(tmp_path)
    assert set(found.card.teams) == {team.name for team in what.game.teams}
    (played,) = found.trajectories()
    assert len(played) == found.steps
    for team in found.card.teams:
        assert played["next", team, "reward"].isfinite().all()


def test_a_missing_task_is_a_configuration_error(tmp_path):
    with pytest.raises(ConfigError):
        make_card(recording(1, 0, "senses/audio=deaf"), {})
