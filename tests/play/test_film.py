"""`python -m veca_marl.play ... video=FILE`: episodes as a video."""

import re

import av
import numpy as np
import pytest
from composed import compose
from refusals import naming

from veca_marl.algos.evaluation.evaluate import Exploration, seed_episodes
from veca_marl.envs.adapters.torchrl.env import VecaEnv
from veca_marl.envs.adapters.torchrl.scripted import ExpertPolicy
from veca_marl.envs.core.benchmark import start_state
from veca_marl.play.command import main
from veca_marl.play.session import Session
from veca_marl.runs.episode_page import read_page

TASK = ["+task=KickTheBall", "playground=simple", "task.max_seconds=0.4"]
SMALL = ["play.width=320", "play.height=180", "play.quality=fast"]


def play(path, *arguments):
    return main([*TASK, *SMALL, f"video={path}", *arguments])


def pictures_and_streams(path):
    with av.open(str(path)) as container:
        pictures = [f.to_ndarray(format="rgb24") for f in container.decode(video=0)]
        return pictures, [stream.type for stream in container.streams]


@pytest.mark.slow
def test_two_episodes_of_the_expert(tmp_path, capsys):
    path = tmp_path / "new" / "kick.mp4"
    assert play(path, "episodes=2") == 0
    pictures, streams = pictures_and_streams(path)
    assert len(pictures) == 2 * 10, "one picture per step"
    assert pictures[0].shape == (180, 320, 3)
    assert streams == ["video", "audio"]
    printed = capsys.readouterr().out
    assert "episode 0: return" in printed
    assert "episode 1: return" in printed


@pytest.mark.slow
def test_a_deaf_agent_has_a_video_without_sound(tmp_path):
    assert play(tmp_path / "deaf.mp4", "policy=random", "senses/audio=deaf") == 0
    assert pictures_and_streams(tmp_path / "deaf.mp4")[1] == ["video"]


@pytest.mark.parametrize(
    ("wrong", "parts"),
    [
        (["policy=champion"], ("policy=champion", "expert", "random")),
        (["episodes=0"], ("episodes", " 1", " 0")),
        (["video=kick.avi"], ("video=kick.avi", ".mp4")),
        (["save=kick.htm"], ("save=kick.htm", ".html")),
        (["save=kick.html"], ("save=kick.html", "video=")),
        (["play.camera=drone"], ("play.camera", "drone", "orbit")),
        (["play.agent=nobody"], ("nobody", "agents")),
        (["play.width=321"], ("width=321", "even")),
    ],
)
def test_wrong_options_end_in_one_line(tmp_path, capsys, wrong, parts):
    assert play(tmp_path / "a.mp4", *wrong) == 2
    assert re.search(naming(*parts), capsys.readouterr().err.splitlines()[-1])
    assert not list(tmp_path.iterdir())


def test_a_session_plays_the_episodes_of_evaluate():
    game = compose(TASK).game
    session = Session(game, ExpertPolicy, 1, Exploration.deterministic)
    env = VecaEnv(game, worlds=2, seed=5)
    seed_episodes(env, 1, 0)
    env.reset()
    for episode in (0, 1, 0):
        session.begin(episode)
        assert (start_state(session.game) == start_state(env.games[episode])).all()
    session.close()
    env.close()


def test_an_expert_without_the_sense_that_it_needs_ends_in_one_line(tmp_path, capsys):
    assert play(tmp_path / "deaf.mp4", "senses/audio=deaf") == 2
    said = capsys.readouterr().err.splitlines()[-1]
    assert re.search(naming("KickTheBallExpert", "audio", "agents"), said)
    assert not list(tmp_path.iterdir())


def test_a_session_sums_the_weighted_terms_of_each_episode():
    session = Session(compose(TASK).game, ExpertPolicy, 1, Exploration.deterministic)
    sums = []
    for episode in (0, 1, 0):
        moment, total = session.begin(episode), 0.0
        assert moment.steps == 0
        while not moment.done:
            moment = session.step()
            total += sum(moment.terms.values())
        assert moment.steps == 10
        assert sum(moment.sums.values()) == pytest.approx(total)
        sums.append(total)
    session.close()
    assert sums[0] == sums[2], "an episode is repeated by its number"
    assert sums[0] != sums[1]
    assert np.isfinite(sums).all()


@pytest.mark.slow
def test_an_episode_is_saved_as_a_page(tmp_path, capsys):
    path = tmp_path / "new" / "kick.html"
    assert main([*TASK, f"save={path}", "policy=random", "episodes=2"]) == 0
    read = read_page(path)
    assert read.steps == 10
    assert read.title == "KickTheBall"
    assert read.details == {"policy": "random", "seed": "1", "episode": "1"}
    assert "episode 1: return" in capsys.readouterr().out


def test_the_keyboard_needs_a_window(capsys, tmp_path):
    assert main([*TASK, f"save={tmp_path / 'a.html'}", "policy=keyboard"]) == 2
    assert re.search(naming("keyboard", "save="), capsys.readouterr().err.splitlines()[-1])
