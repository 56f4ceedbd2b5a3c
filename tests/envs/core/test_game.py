"""A game: players, actions, time and errors."""

import numpy as np
import pytest
from composed import compose
from refusals import naming

from veca_marl.envs.core.game import Game, player_names, random_action
from veca_marl.envs.core.task import (
    TASKS,
    Player,
    Task,
    TaskCfg,
    Team,
    find_task,
    register_task,
    terms,
)
from veca_marl.sim.body.walker import Walker
from veca_marl.sim.sense import ArraySpec


def cfg_of(*overrides):
    return compose(["+task=KickTheBall", "playground=simple", *overrides]).game


@pytest.fixture
def game():
    game = Game(cfg_of())
    game.reset(np.random.default_rng(0))
    yield game
    game.close()


@pytest.fixture
def duel():
    """A game of two teams, the second of two players, that ends after three steps."""

    class Duel(Task):
        """Terms: push."""

        teams = (Team("red"), Team("blue", 2))
        cfg: TaskCfg

        def build(self):
            self.steps = 0

        def reset(self, rng):
            self.steps = 0
            for x, player in enumerate(self.players):
                player.body.place((float(x), 0.0, 0.0), rng.uniform(-1.0, 1.0))

        def after_step(self, rng):
            self.steps += 1

        def reward(self, player):
            return {}

        def terminated(self):
            return self.steps >= 3

    cfg = cfg_of()
    cfg.task = TaskCfg(name="Duel")
    register_task(Duel)
    game = Game(cfg)
    game.reset(np.random.default_rng(0))
    yield game
    game.close()
    del TASKS["Duel"]


def still(game):
    return {player.name: np.zeros(2, np.float32) for player in game.players}


def test_players_are_named_by_their_teams(duel):
    assert [player.name for player in duel.players] == ["red", "blue_0", "blue_1"]
    assert [player.name for player in duel.team("blue")] == ["blue_0", "blue_1"]
    assert player_names(Team("solo")) == ["solo"]


def test_teams_wear_their_shirts(duel):
    colours = duel.world.scene.geoms.colours
    red, *blues = (
        colours[duel.world.scene.find(name).geoms] for name in ("red", "blue_0", "blue_1")
    )
    np.testing.assert_array_equal(*blues)
    assert (red != blues[0]).any()


def test_the_rules_can_end_a_game_before_its_time_is_up(duel):
    outcomes = [duel.step(still(duel)) for _ in range(3)]
    assert [outcome.terminated for outcome in outcomes] == [False, False, True]
    assert not any(outcome.truncated for outcome in outcomes)


def test_a_reset_restarts_the_count_of_steps(game):
    game.step(still(game))
    game.reset(np.random.default_rng(0))
    assert game.steps == 0


def test_an_invalid_action_stops_the_step_of_all_players(duel):
    before = duel.world.scene.positions.copy()
    actions = {name: np.ones(2, np.float32) for name in ("red", "blue_0", "blue_1")}
    actions["blue_1"][0] = np.nan
    with pytest.raises(ValueError, match=naming("blue_1", "nan", "[-1, 1]")):
        duel.step(actions)
    np.testing.assert_array_equal(duel.world.scene.positions, before)
    assert duel.steps == 0
    # the next step applies its own actions
    duel.step(still(duel))
    np.testing.assert_allclose(duel.world.scene.positions[:, :2], before[:, :2], atol=1e-6)


def test_every_actor_needs_an_action(duel):
    actions = still(duel)
    del actions["blue_0"]
    with pytest.raises(ValueError, match=naming("['blue_0']", "'red'")):
        duel.step(actions)
    with pytest.raises(ValueError, match="'green'"):
        duel.step({**still(duel), "green": np.zeros(2)})
    with pytest.raises(ValueError, match=naming("[3, None]", "'red'")):
        duel.step({**still(duel), None: np.zeros(2), 3: np.zeros(2)})


@pytest.mark.parametrize("actions", [None, 5, [1.0]])
def test_actions_are_a_mapping(duel, actions):
    with pytest.raises(ValueError, match=naming(type(actions).__name__, "'red'", "'blue_0'")):
        duel.step(actions)


def test_the_reward_is_the_weighted_sum_of_the_terms(game):
    assert game.reward_of({"kick": 1.0, "approach": -0.5}) == pytest.approx(1.0 - 0.005)


@pytest.mark.parametrize(
    ("returned", "named"),
    [
        ({"kick": 1.0}, ("['kick']", "'approach'")),
        ({"kick": 1.0, "approach": 0.0, "jump": 1.0}, ("'jump'", "'approach'")),
        ({"kick": "1", "approach": 0.0}, ("'kick'", "str")),
        ({"kick": np.ones(1), "approach": 0.0}, ("'kick'", "ndarray")),
        ([1.0, 0.0], ("list", "'approach'")),
        (None, ("NoneType", "'approach'")),
    ],
)
def test_rewards_that_are_not_the_tasks_terms_are_refused(game, returned, named, monkeypatch):
    monkeypatch.setattr(game.task, "reward", lambda _: returned)
    rng = np.random.default_rng(0)
    actions = {player.name: random_action(player.body.action_spec, rng) for player in game.players}
    with pytest.raises(ValueError, match=naming("KickTheBall", *named)):
        game.step(actions)


def test_an_unknown_task_is_an_error_that_lists_the_tasks():
    with pytest.raises(ValueError, match=naming("'Chess'", "KickTheBall")):
        find_task("Chess")
    cfg = cfg_of()
    cfg.task = TaskCfg(name="Chess")
    with pytest.raises(ValueError, match="Chess"):
        Game(cfg)


def test_a_name_is_registered_once():
    another = type("KickTheBall", (Task,), {"__module__": "elsewhere"})
    with pytest.raises(ValueError, match=naming("'KickTheBall'", "elsewhere")):
        register_task(another)


@pytest.mark.parametrize("weights", [{"kick": 1.0}, {"kick": 1.0, "approch": 0.01}, {}])
def test_weights_must_be_those_of_the_tasks_terms(weights):
    cfg = cfg_of()
    cfg.task.weights = weights
    with pytest.raises(
        ValueError, match=naming("task.weights", "KickTheBall", "['approach', 'kick']")
    ):
        Game(cfg)


@pytest.mark.parametrize("seconds", [0.0, -1.0, np.nan, np.inf, 1e308])
def test_the_length_of_an_episode_is_positive_and_finite(seconds):
    with pytest.raises(ValueError, match="max_seconds"):
        TaskCfg(max_seconds=seconds)


@pytest.mark.parametrize("seconds", [0.01, 0.019])
def test_an_episode_has_a_step(seconds):
    with pytest.raises(ValueError, match=naming(f"task.max_seconds={seconds}", "0.04 s")):
        Game(cfg_of(f"task.max_seconds={seconds}"))


def test_a_team_without_players_is_refused(monkeypatch):
    monkeypatch.setattr(find_task("KickTheBall"), "teams", (Team("agents"), Team("red", 0)))
    with pytest.raises(ValueError, match=naming("'red'", "KickTheBall", "size=0")):
        Game(cfg_of())


def test_a_task_that_would_eliminate_nobody_is_refused(monkeypatch):
    monkeypatch.setattr(find_task("KickTheBall"), "is_eliminated", lambda *_: True)
    with pytest.raises(
        ValueError, match=naming("KickTheBall", "is_eliminated", "eliminates=False")
    ):
        Game(cfg_of())


def test_a_term_has_not_the_name_of_another_entry_of_info(monkeypatch):
    monkeypatch.setattr(Walker, "info", lambda body: {"kick": 0.0})
    with pytest.raises(ValueError, match=naming("task.weights", "['kick']", "'agents'")):
        Game(cfg_of())


@pytest.mark.parametrize("weight", [np.nan, np.inf, -np.inf, 1e308])
def test_a_weight_is_a_number_that_rewards_can_hold(weight):
    with pytest.raises(ValueError, match=naming("task.weights", "'kick'", weight)):
        TaskCfg(weights={"kick": weight})


def test_terms_are_not_shared_between_tasks():
    default = terms(a=1.0).default_factory
    default()["a"] = 2.0
    assert default() == {"a": 1.0}


def test_absent_senses_leave_no_key():
    game = Game(cfg_of("senses/vision=blind"))
    game.reset(np.random.default_rng(0))
    assert set(game.observe(game.players[0])) == {"audio"}
    game.close()


@pytest.mark.parametrize(
    ("sense", "presets"),
    [
        ("vision", ("binocular", "monocular", "grey", "blur", "infant")),
        ("audio", ("hrtf", "stereo", "mono")),
    ],
)
def test_presets_change_the_values_and_not_the_specs(sense, presets):
    specs: list[ArraySpec] = []
    contents = []
    for preset in presets:
        game = Game(cfg_of(f"senses/{sense}={preset}"))
        rng = np.random.default_rng(1)
        game.reset(rng)
        game.observe(game.players[0])
        game.step(still(game))
        specs.append(game.senses["agents"][sense].specs[sense])
        contents.append(game.observe(game.players[0])[sense].tobytes())
        game.close()
    assert all(spec == specs[0] for spec in specs)
    assert len(set(contents)) == len(presets)


def test_a_player_is_a_body_on_a_team(game):
    (player,) = game.players
    assert isinstance(player, Player)
    assert isinstance(player.body, Walker)
    assert (player.name, player.team) == ("agents", "agents")
