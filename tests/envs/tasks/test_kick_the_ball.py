"""KickTheBall: launches, kicks, rewards, sound, and an expert that needs both ears."""

import math

import numpy as np
import pytest
import scipy.io.wavfile
from composed import compose
from refusals import naming

import veca_marl
from veca_marl.envs.core.game import Game


def game_of(*overrides):
    game = Game(compose(["+task=KickTheBall", *overrides]).game)
    game.reset(np.random.default_rng(0))
    game.observe(game.players[0])
    return game


@pytest.fixture(scope="module")
def game():
    game = game_of("senses/vision=blind")
    yield game
    game.close()


def stand(game, seconds):
    for _ in range(round(seconds / 0.04)):
        yield game.step({"agents": np.zeros(2, np.float32)})


def launches(game, count):
    for seed in range(count):
        game.reset(np.random.default_rng(seed))
        yield game.task.ball


def test_the_ball_comes_out_of_either_side_wall(game):
    sides = []
    for ball in launches(game, 40):
        x, y, z = ball.position
        assert abs(abs(y) - (3.0 - 0.17)) < 1e-9
        assert abs(x) <= 2.0
        assert z == pytest.approx(0.15)
        sides.append(np.sign(y))
    assert 8 < sides.count(1.0) < 32


def test_no_ball_starts_within_the_player(game):
    """The player stands at the side wall, where a new ball may begin."""
    game.reset(np.random.default_rng(0))
    player = game.players[0].body
    for seed in range(60):
        player.place((0.0, 2.8, 0.0))
        game.task._launch(np.random.default_rng(seed))
        gap_m = math.dist(game.task.ball.position[:2], (0.0, 2.8)) - 0.15 - player.radius_m
        assert gap_m >= 0.0


def test_it_rolls_into_the_room_at_the_speed_asked_for(game):
    speeds = []
    for ball in launches(game, 40):
        velocity = ball.velocity
        assert velocity[1] * ball.position[1] < 0.0
        aside = math.degrees(math.atan2(abs(velocity[0]), abs(velocity[1])))
        assert aside <= 30.0
        speeds.append(np.linalg.norm(velocity))
    assert min(speeds) >= 0.5
    assert max(speeds) <= 1.0
    assert np.ptp(speeds) > 0.3


def test_it_rolls_without_slipping_from_the_start(game):
    game.reset(np.random.default_rng(3))
    game.players[0].body.place((2.0, 0.0, 0.0))
    start = np.linalg.norm(game.task.ball.velocity)
    for _ in stand(game, 1.0):
        pass
    assert np.linalg.norm(game.task.ball.velocity) == pytest.approx(start, rel=0.1)


def test_the_player_starts_inside_and_faces_anywhere(game):
    yaws = []
    for _ in launches(game, 40):
        body = game.players[0].body
        assert game.task.room.contains(body.position, margin_m=0.2)
        yaws.append(body.yaw_rad)
    assert min(yaws) < -1.0
    assert max(yaws) > 1.0


def test_a_ball_that_is_not_kicked_is_replaced(game):
    game.reset(np.random.default_rng(1))
    game.players[0].body.place((2.5, 2.5, 0.0), math.pi)
    places = []
    for _ in stand(game, 6.2):
        places.append(game.task.ball.position)
    jumps = np.linalg.norm(np.diff(places, axis=0), axis=1)
    assert (jumps > 0.3).sum() == 1
    assert np.argmax(jumps) == pytest.approx(6.0 / 0.04 - 1, abs=2)


def test_a_kicked_ball_that_comes_back_does_not_count_again(game):
    game.reset(np.random.default_rng(1))
    game.players[0].body.place((0.0, 0.0, 0.0))
    kicks = 0.0
    for _ in range(9):  # 0.36 s: the next ball comes after 0.4 s
        game.task.ball.place((0.36, 0.0, 0.15))
        outcome = game.step({"agents": np.zeros(2, np.float32)})
        kicks += outcome.terms["agents"]["kick"]
    assert kicks == 1.0


def test_a_kick_counts_once_and_the_next_ball_follows(game):
    game.reset(np.random.default_rng(1))
    body, ball = game.players[0].body, game.task.ball
    body.place((0.0, 0.0, 0.0))
    ball.place((0.36, 0.0, 0.15))
    kicks, places = [], []
    for outcome in stand(game, 0.8):
        kicks.append(outcome.terms["agents"]["kick"])
        places.append(ball.position)
    assert kicks[0] == 1.0
    assert sum(kicks) == 1.0
    assert places[5][0] > 0.6  # it flew off
    assert abs(abs(places[11][1]) - 2.83) < 0.1  # 0.4 s later the next one comes


@pytest.mark.parametrize(("bearing_deg", "expected"), [(0, 1.0), (60, 0.5), (90, 0.0), (180, -1.0)])
def test_approach_is_the_cosine_between_velocity_and_displacement(game, bearing_deg, expected):
    game.reset(np.random.default_rng(1))
    body, ball = game.players[0].body, game.task.ball
    body.place((0.0, 0.0, 0.0))
    bearing = math.radians(bearing_deg)
    ball.place((2.0 * math.cos(bearing), 2.0 * math.sin(bearing), 0.15))
    outcome = game.step({"agents": np.array([1.0, 0.0], np.float32)})
    assert outcome.terms["agents"]["approach"] == pytest.approx(expected, abs=0.03)


@pytest.mark.parametrize(("facing", "forward"), [(0.0, 0.3), (math.pi, -1.0)])
def test_approach_is_0_below_the_least_speed(game, facing, forward):
    """Otherwise following the ball slowly has a higher return than kicking it."""
    game.reset(np.random.default_rng(1))
    game.players[0].body.place((0.0, 0.0, 0.0), facing)
    game.task.ball.place((2.0, 0.0, 0.15))
    creep = {"agents": np.array([forward, 0.0], np.float32)}
    outcome = game.step(creep)
    assert game.players[0].body.velocity[0] > 0.1
    assert outcome.terms["agents"]["approach"] == 0.0


def test_approach_is_0_at_rest(game):
    game.reset(np.random.default_rng(1))
    game.players[0].body.place((2.0, 0.0, 0.0), 0.0)
    outcome = next(stand(game, 0.04))
    assert outcome.terms["agents"]["approach"] == 0.0


@pytest.mark.parametrize("rate_hz", [5, 10, 25, 49])
def test_balls_live_and_rest_for_the_same_time_at_every_control_rate(rate_hz, monkeypatch):
    clock = [f"clock.control_rate_hz={rate_hz}", f"clock.substeps={max(1, 125 // rate_hz)}"]
    game = game_of("senses/vision=blind", "task.life_s=2.0", *clock)
    launched, task, step = [], game.task, 0
    launch = task._launch
    monkeypatch.setattr(task, "_launch", lambda rng: (launched.append(step), launch(rng)))
    kick_at = 5 * rate_hz  # steps, after two balls that were not kicked
    for step in range(8 * rate_hz):
        can_kick = step == kick_at
        monkeypatch.setattr(task.kicker, "kick", lambda ball, can=can_kick: can)
        game.step({"agents": np.zeros(2, np.float32)})
    seconds = np.array(launched) / rate_hz
    # the kick counts at the end of its step
    after_kick = (kick_at + 1) / rate_hz + 0.4
    np.testing.assert_allclose(seconds[:3], [2.0, 4.0, after_kick], atol=0.5 / rate_hz + 1e-9)
    if rate_hz != 49:
        np.testing.assert_allclose(seconds[:3], [2.0, 4.0, after_kick], atol=1e-9)
    game.close()


def test_the_episode_never_terminates(game):
    game.reset(np.random.default_rng(1))
    outcomes = list(stand(game, 20.0))
    assert not any(outcome.terminated for outcome in outcomes)
    assert [outcome.truncated for outcome in outcomes].index(True) == 499


@pytest.mark.parametrize(("side", "y"), [("left", 1.0), ("right", -1.0)])
def test_the_ball_is_heard_from_its_side(game, side, y):
    """The nearer ear has the higher level."""
    game.reset(np.random.default_rng(1))
    game.players[0].body.place((0.0, 0.0, 0.0))
    game.observe(game.players[0])
    for _ in range(5):
        game.task.ball.place((0.0, y, 0.15))
        game.step({"agents": np.zeros(2, np.float32)})
        left, right = game.observe(game.players[0])["audio"][:2].mean(axis=-1)
    assert (left > right) == (side == "left")


def kicks_of_expert(audio, episodes):
    game, rng = game_of("senses/vision=blind", f"senses/audio={audio}"), np.random.default_rng(5)
    player, kicks = game.players[0], []
    for _ in range(episodes):
        game.reset(rng)
        seen, total = game.observe(player), 0.0
        for _ in range(game.max_steps):
            row = player.body.encode(game.expert_of(player).act(seen))
            total += game.step({"agents": row}).terms["agents"]["kick"]
            seen = game.observe(player)
        kicks.append(total)
    game.close()
    return np.array(kicks)


@pytest.mark.slow
def test_the_expert_needs_both_ears():
    hrtf, mono = kicks_of_expert("hrtf", 3), kicks_of_expert("mono", 3)
    assert hrtf.mean() > 2.0
    assert hrtf.mean() > 2.0 * mono.mean()


def test_a_beeping_ball_is_heard_for_its_share_of_the_time():
    game = game_of("senses/vision=blind", "task.pulse_s=0.2", "task.pause_s=0.6")
    source = game.world.sound.sources["ball"]
    heard = [source.silent_samples == 0 for _ in stand(game, 8.0)]  # ten periods
    game.close()
    assert 0.25 <= np.mean(heard) <= 0.31  # a step in which a pulse begins or ends counts


def test_impossible_beeps_are_refused():
    with pytest.raises(ValueError, match=r"pause_s=-1\.0"):
        compose(["+task=KickTheBall", "task.pause_s=-1.0"])


@pytest.mark.parametrize("task", ["KickTheBall", "SoccerOnePlayer", "SoccerTwoPlayer"])
def test_a_ball_that_is_too_heavy_for_a_walker_is_refused(task):
    cfg = compose([f"+task={task}", "body=walker", "task.mass_kg=6"]).game
    with pytest.raises(ValueError, match=naming("task.mass_kg=6", "body.push_limit_kg=5")):
        Game(cfg)


def test_joint_level_bodies_may_have_any_ball():
    game = Game(compose(["+task=SoccerOnePlayer", "task.mass_kg=6"]).game)
    assert game.task.ball.cfg.mass_kg == 6.0
    game.close()


def test_the_ball_can_sound_like_a_wav_file(tmp_path):
    """A tone on a bin of the observation is the largest magnitude at both ears."""
    path = tmp_path / "tone (1).wav"
    tone = 0.5 * np.sin(2.0 * np.pi * 47 * 22_050 / 1024 * np.arange(22_050) / 22_050)
    scipy.io.wavfile.write(path, 22_050, tone.astype(np.float32))
    env = veca_marl.gym_env(
        "KickTheBall", senses={"vision": "blind"}, overrides=[f"task.sound_path={path}"]
    )
    env.reset(seed=0)
    for _ in range(5):
        observation, *_ = env.step(np.zeros(2, np.float32))
    assert abs(int(observation["audio"][0].argmax()) - 47) <= 1
    env.close()
