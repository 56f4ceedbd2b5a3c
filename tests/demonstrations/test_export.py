"""Exports: what Minari and the readers of LeRobot's files find is what was recorded."""

import json

import av
import numpy as np
import pytest
from composed import compose
from demonstrated import record_toy
from refusals import naming

from veca_marl.algos.demonstration_files import DemonstrationsError
from veca_marl.algos.demonstrations import Demonstrations
from veca_marl.demonstrations import main
from veca_marl.demonstrations.episode_files import Archive
from veca_marl.demonstrations.export.agent import DemonstratedAgent
from veca_marl.demonstrations.export.lerobot_format import RunningStatistics, export_lerobot
from veca_marl.demonstrations.export.minari_format import export_minari
from veca_marl.demonstrations.record import Recording, make_card, record

EPISODES = 2


def recorded(folder, *words):
    what = Recording(compose(list(words)).game, EPISODES, 0)
    overrides = {"overrides": list(words)}
    archive = Archive(folder, make_card(what, overrides))
    archive.begin()
    record(what, archive, 0, bar=False)
    return Demonstrations(folder)


@pytest.fixture(scope="module")
def parts(tmp_path_factory):
    """An action of several parts, both eyes, the samples at the ears."""
    return recorded(
        tmp_path_factory.mktemp("parts"),
        "+task=KickTheBall",
        "body=walker_voice",
        "task.max_seconds=0.4",
        "senses.audio.waveform=true",
    )


def test_statistics_are_those_of_all_rows():
    rows = np.random.default_rng(0).normal(2.0, 3.0, (50, 4))
    found = RunningStatistics()
    for part in np.array_split(rows, 3):
        found.add(part)
    numbers = found.to_dict(50)
    assert numbers["count"] == [50]
    for name, wanted in (("min", rows.min(0)), ("max", rows.max(0)), ("mean", rows.mean(0))):
        np.testing.assert_allclose(numbers[name], wanted, atol=1e-9)
    np.testing.assert_allclose(numbers["std"], rows.std(0), atol=1e-6)


@pytest.fixture(scope="module")
def written(parts, tmp_path_factory):
    pytest.importorskip("pyarrow", reason="the extra [lerobot] is not installed")
    folder = tmp_path_factory.mktemp("lerobot") / "here"
    export_lerobot(DemonstratedAgent(parts, None), folder)
    return folder


def test_images_with_odd_sides_are_refused_before_anything_is_written(tmp_path):
    pytest.importorskip("pyarrow", reason="the extra [lerobot] is not installed")
    numbers = ["senses.vision.width=63", "senses.vision.height=62", "task.max_seconds=0.2"]
    odd = recorded(tmp_path / "odd", "+task=KickTheBall", *numbers)
    with pytest.raises(DemonstrationsError, match=naming("vision", "63 x 62")):
        export_lerobot(DemonstratedAgent(odd, None), tmp_path / "here")
    assert not (tmp_path / "here").exists()


def test_an_export_that_fails_leaves_nothing(parts, tmp_path, monkeypatch):
    pytest.importorskip("pyarrow", reason="the extra [lerobot] is not installed")

    def fail(*_):
        raise ArithmeticError

    monkeypatch.setattr(RunningStatistics, "to_dict", fail)
    with pytest.raises(ArithmeticError):
        export_lerobot(DemonstratedAgent(parts, None), tmp_path / "here")
    assert not list(tmp_path.iterdir())


@pytest.fixture(scope="module")
def info(written):
    return json.loads((written / "meta" / "info.json").read_text())


def rows_of(written, number):
    from pyarrow import parquet

    return parquet.read_table(written / f"data/chunk-000/file-{number:03}.parquet")


def test_arrays_are_those_recorded(parts, written):
    for number in range(EPISODES):
        table, wanted = rows_of(written, number), DemonstratedAgent(parts, None)
        episode = wanted.episode(number)
        for sense in ("audio", "waveform"):
            stored = np.array(table[f"observation.{sense}"].to_pylist(), np.float32)
            np.testing.assert_array_equal(stored, episode.observations[sense][:-1])
        action = np.array(table["action"].to_pylist(), np.float32)
        np.testing.assert_array_equal(action[:, :2], episode.actions["move"])
        np.testing.assert_array_equal(table["next.reward"].to_numpy(), episode.rewards)
        assert table["next.done"].to_pylist() == [False] * 9 + [True]


def test_counters_count(written):
    second = rows_of(written, 1)
    assert second["index"].to_pylist() == list(range(10, 20))
    assert second["frame_index"].to_pylist() == list(range(10))
    assert second["episode_index"].to_pylist() == [1] * 10
    np.testing.assert_allclose(second["timestamp"].to_numpy(), np.arange(10) / 25, atol=1e-6)


def test_videos_show_both_eyes(parts, written):
    images = DemonstratedAgent(parts, None).episode(0).observations["vision"][:-1]
    for index, eye in enumerate(("left", "right")):
        path = written / f"videos/observation.images.{eye}/chunk-000/file-000.mp4"
        with av.open(str(path)) as file:
            shown = np.stack([f.to_ndarray(format="rgb24") for f in file.decode(video=0)])
        wanted = np.moveaxis(images[:, index], 1, -1)
        assert shown.shape == wanted.shape
        # of 255: the codec loses detail and stores colours at half the resolution
        assert np.abs(shown.astype(float) - wanted).mean() < 8.0


def test_every_column_is_a_feature_of_its_shape(written, info):
    table = rows_of(written, 0)
    features = info["features"]
    videos = {name for name, one in features.items() if one["dtype"] == "video"}
    assert set(features) - videos == set(table.column_names)
    for name in table.column_names:
        shape = np.array(table[name].to_pylist()).shape[1:] or (1,)
        assert list(shape) == features[name]["shape"], name
    assert len(features["action"]["names"]) == features["action"]["shape"][0]
    assert all("/" not in name for name in features)


def test_the_tables_of_episodes_and_tasks_lead_to_the_files(written, info):
    from pyarrow import parquet

    rows = parquet.read_table(written / "meta/episodes/chunk-000/file-000.parquet").to_pylist()
    assert [row["length"] for row in rows] == [10, 10]
    assert rows[1]["dataset_from_index"] == 10
    assert rows[1]["dataset_to_index"] == info["total_frames"] == 20
    for row in rows:
        place = (row["data/chunk_index"], row["data/file_index"])
        assert (
            written / info["data_path"].format(chunk_index=place[0], file_index=place[1])
        ).exists()
        assert row["videos/observation.images.left/to_timestamp"] == pytest.approx(0.4)
    tasks = parquet.read_table(written / "meta/tasks.parquet")
    assert tasks.to_pylist() == [{"task_index": 0, "task": "KickTheBall"}]
    assert json.loads(tasks.schema.metadata[b"pandas"])["index_columns"] == ["task"]
    assert (info["codebase_version"], info["fps"], info["total_episodes"]) == ("v3.0", 25, 2)


def test_every_feature_has_statistics(written, info):
    found = json.loads((written / "meta/stats.json").read_text())
    assert set(found) == set(info["features"])
    images = found["observation.images.left"]
    assert np.array(images["mean"]).shape == (3, 1, 1)
    assert 0.0 <= np.min(images["min"]) <= np.max(images["max"]) <= 1.0


def test_an_agent_of_a_team_is_chosen_by_name(tmp_path):
    pytest.importorskip("pyarrow", reason="the extra [lerobot] is not installed")
    record_toy(tmp_path / "toy", 1, agents=2, teams=("red", "blue"))
    found = Demonstrations(tmp_path / "toy")
    with pytest.raises(DemonstrationsError, match=naming("red_0", "red_1", "blue_0")):
        DemonstratedAgent(found, None)
    export_lerobot(DemonstratedAgent(found, "blue_1"), tmp_path / "out")
    info = json.loads((tmp_path / "out" / "meta" / "info.json").read_text())
    assert info["features"]["observation.audio"]["shape"] == [2, 10]


def test_an_existing_folder_is_refused(parts, tmp_path):
    pytest.importorskip("pyarrow", reason="the extra [lerobot] is not installed")
    with pytest.raises(DemonstrationsError, match="exists"):
        export_lerobot(DemonstratedAgent(parts, None), tmp_path)


@pytest.fixture
def minari():
    return pytest.importorskip("minari", reason="the extra [minari] is not installed")


def test_it_holds_what_was_recorded_and_makes_the_environment(minari, parts, tmp_path, monkeypatch):
    agent = DemonstratedAgent(parts, None)
    name = export_minari(agent, tmp_path)
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path))
    found = minari.load_dataset(name)
    assert (found.total_episodes, found.total_steps) == (2, 20)
    for number, stored in enumerate(found.iterate_episodes()):
        wanted = agent.episode(number)
        for sense, array in wanted.observations.items():
            np.testing.assert_array_equal(stored.observations[sense], array)
        for part, array in wanted.actions.items():
            np.testing.assert_array_equal(stored.actions[part], array)
        np.testing.assert_allclose(stored.rewards, wanted.rewards, atol=1e-6)
        assert stored.truncations[-1]
    env = found.recover_environment()
    assert wanted.observations["audio"].shape[1:] == env.observation_space["audio"].shape
    for number, about in enumerate(found.storage.get_episode_metadata([0, 1])):
        first, _ = env.reset(seed=int(about["seed"]), options=about["options"])
        for sense, array in agent.episode(number).observations.items():
            np.testing.assert_array_equal(first[sense], array[0])
    env.close()


def test_a_team_is_refused(minari, tmp_path):
    record_toy(tmp_path / "toy", 1, agents=2)
    agent = DemonstratedAgent(Demonstrations(tmp_path / "toy"), "agents_1")
    with pytest.raises(DemonstrationsError, match=naming("2 agents", "lerobot")):
        export_minari(agent, tmp_path / "out")


@pytest.mark.parametrize("command", ["show", "export"])
def test_the_commands_end_in_one_line(tmp_path, capsys, command):
    words = [command, f"demonstrations={tmp_path}"]
    words += [f"to={tmp_path / 'out'}"] * (command == "export")
    assert main(words) == 2
    assert main([*words, "task.max_seconds=3"]) == 2
    assert main([command]) == 2
    errors = capsys.readouterr().err.splitlines()
    assert len(errors) == 3
    assert all(line.startswith("error: ") for line in errors)


def test_show_says_what_there_is(parts, capsys):
    assert main(["show", f"demonstrations={parts.folder}"]) == 0
    assert parts.card.checksum in capsys.readouterr().out
