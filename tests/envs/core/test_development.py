"""Body and senses of an age, set at once, and tasks that refuse sizes."""

import pytest
from composed import compose
from refusals import naming

from veca_marl.config import ConfigError
from veca_marl.envs.core.development import CHILD_HEAD
from veca_marl.envs.core.task import TASKS


@pytest.mark.parametrize("task", ["KickTheBall", "TurnBaby", "ObjectNav", "MultiAgentNav"])
def test_it_sets_body_eyes_and_ears(task):
    game = compose([f"+task={task}", "development=8"]).game
    assert game.body.age_months == 8.0
    assert game.senses.vision.infant_age_months == 8.0
    assert game.senses.audio.head_scale == CHILD_HEAD
    assert game.senses.audio.infant_age_months == 8.0


def test_without_it_nothing_changes():
    cfg = compose(["+task=KickTheBall"])
    assert cfg.development is None
    assert cfg.game.body == cfg.body
    assert cfg.game.senses == cfg.senses


def test_what_a_configuration_sets_itself_stays():
    own = [
        "body.height_m=0.7",
        "senses.vision.infant_age_months=2",
        "senses.audio.head_scale=0.9",
        "senses.audio.infant_age_months=3",
    ]
    game = compose(["+task=KickTheBall", "development=8", *own]).game
    assert (game.body.age_months, game.body.height_m) == (None, 0.7)
    assert game.senses.vision.infant_age_months == 2.0
    assert game.senses.audio.head_scale == 0.9
    assert game.senses.audio.infant_age_months == 3.0


def test_it_is_for_all_teams():
    game = compose(
        ["+task=PushOut1v1", "development=18", "+body@team.red.body=walker_discrete"]
    ).game
    assert {game.body_of(team).age_months for team in ("red", "blue")} == {18.0}


def test_teams_can_differ_in_age():
    game = compose(
        ["+task=PushOut1v1", "+body@team.red.body=walker", "team.red.body.age_months=36"]
    ).game
    assert game.body_of("red").age_months == 36.0
    assert game.body_of("blue").age_months is None


@pytest.mark.parametrize(
    ("choices", "parts"),
    [
        (["development=0.5"], ("development=0.5", "1", "36")),
        (["development=40"], ("development=40", "1", "36")),
        (["body.age_months=37"], ("body.age_months=37", "1", "36")),
        (["body.height_m=0.3"], ("body.height_m=0.3", "0.5415", "0.9557")),
        (["body.height_m=0.7", "body.age_months=8"], ("body.height_m=0.7", "body.age_months=8")),
    ],
)
def test_impossible_sizes_are_refused_in_one_line(choices, parts):
    with pytest.raises(ConfigError, match=naming(*parts)) as error:
        compose(["+task=KickTheBall", *choices])
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    "task", sorted(name for name, task in TASKS.items() if task.ages_months is None)
)
def test_tasks_that_do_not_grow_refuse_other_sizes(task):
    with pytest.raises(ConfigError, match=naming("0.78 m", "0.697 m")):
        compose([f"+task={task}", "development=8"])


def test_a_task_refuses_ages_outside_its_own():
    with pytest.raises(ConfigError, match=naming("6 to 36 months", "0.63 m")):
        compose(["+task=BabyzumasRevenge", "development=4"])


@pytest.mark.parametrize("task", sorted(TASKS))
def test_all_other_tasks_can_be_composed_at_an_age(task):
    if TASKS[task].ages_months is not None:
        assert compose([f"+task={task}", "development=8"]).game.body.growth.height_m < 0.78
