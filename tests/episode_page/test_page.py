"""A page holds what was recorded, and nothing else; damaged pages are refused."""

import re
from contextlib import closing
from dataclasses import replace
from io import BytesIO

import av
import numpy as np
import pytest
from composed import compose
from recorded import RATE_HZ, record
from refusals import naming
from scipy.spatial.transform import Rotation

from veca_marl.algos.evaluation.evaluate import random_policy
from veca_marl.envs.adapters.torchrl.env import VecaEnv
from veca_marl.runs.episode_page import EpisodeRecorder, play, read_page, write_page
from veca_marl.runs.episode_page.description import POSITION_UNIT_M, QUATERNION_UNIT
from veca_marl.runs.episode_page.media import picture_sheet, read_sheet, sound_file
from veca_marl.runs.episode_page.page import page_of
from veca_marl.stored_files import StoredFileError

KICK = ("+task=KickTheBall", "task.max_seconds=1.2")


@pytest.fixture(scope="module")
def kick():
    return record(*KICK)


@pytest.fixture(scope="module")
def page(kick, tmp_path_factory):
    path = tmp_path_factory.mktemp("page") / "new" / "episode.html"
    write_page(path, kick.episode)
    return path


def test_poses_are_those_of_the_scene(kick, page):
    episode, frames = read_page(page), kick.positions[0].shape[0]
    assert episode.steps == 30
    np.testing.assert_allclose(
        episode.positions[:, :frames], kick.positions, atol=0.51 * POSITION_UNIT_M
    )
    turns = Rotation.from_quat(episode.quaternions[:, :frames].reshape(-1, 4)).as_matrix()
    rotations = np.array(kick.rotations).reshape(-1, 3, 3)
    np.testing.assert_allclose(turns, rotations, atol=4.0 * QUATERNION_UNIT)


def test_eyes_see_what_they_saw(kick, page):
    (agent,) = read_page(page).agents
    assert agent.pictures is not None
    pictures = np.concatenate([read_sheet(each, agent.picture_size) for each in agent.pictures])
    seen = np.stack([each["agents"]["vision"] for each in kick.observations])
    assert pictures.shape == seen.shape
    assert np.abs(pictures.astype(int) - seen).mean() < 2.0, "the same pictures, if not exactly"


def test_rewards_and_actions_are_those_of_the_steps(kick, page):
    (agent,) = read_page(page).agents
    for term, weight in kick.weights.items():
        paid = [float(step["next", "agents", "info", term][0, 0, 0]) for step in kick.played]
        np.testing.assert_allclose(agent.terms[term], weight * np.array(paid), rtol=1e-5)
    done = np.stack([step["agents", "action"][0, 0].numpy() for step in kick.played])
    np.testing.assert_allclose(agent.actions["move"], done, atol=1e-4)
    assert agent.action_names == {"move": ["forward", "turn"]}


def test_touch_is_that_of_the_taxels(tmp_path):
    made = record("+task=CrawlBaby", "task.max_seconds=0.6")
    write_page(tmp_path / "crawl.html", made.episode)
    (agent,) = read_page(tmp_path / "crawl.html").agents
    assert agent.pictures is None, "it does not see"
    assert agent.touch is not None
    for (taxels, levels), seen in zip(agent.touch, made.observations, strict=True):
        touch = seen["agents"]["touch"]
        np.testing.assert_array_equal(taxels, np.flatnonzero(touch))
        np.testing.assert_allclose(levels / 255.0, touch[taxels], atol=1.0 / 255.0)
    assert any(len(taxels) for taxels, _ in agent.touch), "it touches the floor"


def test_a_recording_ends_after_its_limit(tmp_path):
    made = record(*KICK, "senses/vision=blind", longest_s=0.4)
    assert made.episode.is_cut
    write_page(tmp_path / "cut.html", made.episode)
    assert read_page(tmp_path / "cut.html").steps == 10


def repainting(env):
    """A policy that paints the ball in its third step."""
    act, steps = random_policy(env), []

    def policy(state):
        steps.append(state)
        if len(steps) == 3:
            env.games[0].world.scene.find("ball").paint((0.0, 1.0, 0.5))
        return act(state)

    return policy


def test_changed_colours_are_recorded(tmp_path):
    made = record(*KICK, "senses/vision=blind", policy=repainting)
    write_page(tmp_path / "painted.html", made.episode)
    read = read_page(tmp_path / "painted.html")
    colours = read.scene.colours.copy()
    np.testing.assert_allclose(colours, made.colours[0], atol=1e-6)
    (change,) = read.repaintings
    assert change.step == 3
    colours[change.surfaces] = change.colours
    np.testing.assert_allclose(colours, made.colours[-1], atol=1e-4)


def test_players_that_follow_a_script_are_recorded(tmp_path):
    """They sense and move like others; their actions and rewards are not those of a policy."""
    made = record("+task=PushOut1v1", "opponent.blue=random", "task.max_seconds=0.2")
    write_page(tmp_path / "scripted.html", made.episode)
    red, blue = read_page(tmp_path / "scripted.html").agents
    assert (red.name, blue.name) == ("red", "blue")
    assert red.actions
    assert red.terms
    assert not blue.actions
    assert blue.pictures
    assert blue.touch


def test_a_recording_ends_before_a_step_that_is_not_finite(tmp_path):
    game = compose(KICK).game
    with closing(VecaEnv(game, 1, 3)) as env:
        recorder = EpisodeRecorder(env)
        for step, played in enumerate(play(env, random_policy(env))):
            if step == 5:
                env.games[0].world.scene.positions[-1] = np.nan
            if step == 0:
                recorder.begin()
            else:
                recorder.add(played)
        episode = recorder.episode("broken", {}, RATE_HZ)
    assert episode.steps == 4
    assert episode.is_cut
    write_page(tmp_path / "broken.html", episode)
    assert np.isfinite(read_page(tmp_path / "broken.html").positions).all()


def test_nothing_is_loaded_from_elsewhere(page):
    text = page.read_text()
    outside = re.sub(
        r'<script type="(text/plain|application/json)".*?</script>', "", text, flags=re.S
    )
    assert not re.search(r"https?://|\bsrc=|\bhref=|url\(|@import", outside)


def test_names_cannot_end_the_element_that_they_are_in(kick):
    evil = "</script><script>alert(1)</script>{{data}}"
    text = page_of(replace(kick.episode, title=evil, details={evil: evil}))
    assert "<script>alert" not in text
    assert text.count("<script") == page_of(kick.episode).count("<script")


@pytest.mark.parametrize(
    "damage",
    [
        lambda text: text[: len(text) // 2],
        lambda text: "",
        lambda text: text.replace('"format":1', '"format":99', 1),
        lambda text: text.replace('"steps":30', '"steps":31', 1),
        lambda text: text.replace('"steps":30', '"steps":"x"', 1),
        lambda text: re.sub(r'(id="data">.{1000})....', r"\1AAAA", text),
    ],
)
def test_damaged_pages_are_refused_in_one_line(page, tmp_path, damage):
    path = tmp_path / "damaged.html"
    path.write_text(damage(page.read_text()))
    with pytest.raises(StoredFileError, match=naming(path)) as refused:
        read_page(path)
    assert "\n" not in str(refused.value)


def test_pictures_of_few_colours_are_stored_exactly():
    pictures = np.zeros((4, 2, 3, 60, 84), np.uint8)
    pictures[:, 0, 0, :30], pictures[:, 1, 2, 30:] = 200, 37
    sheet = picture_sheet(list(pictures))
    np.testing.assert_array_equal(read_sheet(sheet, (60, 84)), pictures)


def test_sound_keeps_its_time_and_the_difference_of_the_ears():
    """A click is where it was, within a millisecond, and half as strong at the right ear."""
    waveform = np.zeros((2, RATE_HZ), np.float32)
    first, width = RATE_HZ // 2, RATE_HZ // 200
    burst = np.sin(2.0 * np.pi * 1000.0 / RATE_HZ * np.arange(width)) * np.hanning(width)
    waveform[:, first : first + width] = np.array([[1.0], [0.5]]) * burst
    content, _ = sound_file(waveform, RATE_HZ)
    with av.open(BytesIO(content)) as file:
        rate = file.streams.audio[0].rate
        resampler = av.AudioResampler("fltp", "stereo", rate)
        blocks = [b for f in file.decode(audio=0) for b in resampler.resample(f)]
        sound = np.concatenate([block.to_ndarray() for block in blocks], axis=1)
    energy = sound[0] ** 2
    centre = (energy * np.arange(len(energy))).sum() / energy.sum() / rate
    assert centre == pytest.approx((first + width / 2) / RATE_HZ, abs=1e-3)
    assert sound[1].std() / sound[0].std() == pytest.approx(0.5, abs=0.05)
