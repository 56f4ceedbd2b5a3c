"""MazeNav: mazes, walls, trials, the observation of trials, rewards, the expert."""

import math

import numpy as np
import pytest
import started
from composed import compose
from refusals import naming

from veca_marl.config import ConfigError
from veca_marl.envs.core.game import Game
from veca_marl.envs.core.game_cfg import Script
from veca_marl.envs.tasks.floors.places import clearances_m, gap_m
from veca_marl.envs.tasks.navigation.mazes import random_maze

SMALL_EYES = ("senses.vision.width=16", "senses.vision.height=16")
STAND = {"agents": np.zeros(2, np.float32)}


def game_of(*overrides):
    return started.game_of("MazeNav", *SMALL_EYES, *overrides)


@pytest.fixture(scope="module")
def game():
    game = game_of("task.trial_s=0.4", "task.trials=3")
    yield game
    game.close()


def trial_of(game):
    return game.observe(game.players[0])["trial"]


def put_at_the_object(game):
    x, y, _ = game.task.target.position
    game.task.walker.place((x + 0.3, y, 0.0))


# ---- the object is not reached through walls


@pytest.mark.parametrize(("cells", "limit_m"), [(2, 1.51), (4, 0.76), (8, 0.385)])
def test_a_body_beyond_a_wall_does_not_reach_the_object(cells, limit_m):
    """The limit is the gap to the object of a walker that touches the other side of a wall."""
    named = naming("task.reach_m=", f" {limit_m} ", f"task.cells={cells}")
    with pytest.raises(ConfigError, match=named):
        compose(["+task=MazeNav", f"task.cells={cells}", f"task.reach_m={limit_m + 1e-9}"])
    game = game_of(f"task.cells={cells}", f"task.reach_m={limit_m - 1e-3}")
    target, wall = game.task.target, game.world.prop("maze_wall_0")
    x, y, _ = target.position
    inward, half_m = (-1.0 if x > 0.0 else 1.0), 3.0 / cells  # away from the wall round the maze
    wall.place((x + inward * half_m, y, 0.0), math.pi / 2.0)
    beyond_m = half_m + wall.cfg.size_m[1] / 2.0 + 0.11
    game.task.walker.place((x + inward * beyond_m, y, 0.0))
    assert gap_m(game.task.walker.position, target) == pytest.approx(limit_m)
    assert clearances_m(wall, game.task.walker.position[:2]) == pytest.approx(0.11)
    game.close()


def test_a_thinner_body_needs_a_smaller_reach():
    with pytest.raises(ValueError, match=naming("task.reach_m=0.75", "0.71", "0.06 m")):
        game_of("task.reach_m=0.75", "body.radius_m=0.06")


def test_a_body_that_is_wider_than_the_passages_is_refused():
    with pytest.raises(ValueError, match=naming("body.radius_m=0.35", "0.65 m", "task.cells=8")):
        game_of("task.cells=8", "body.radius_m=0.35")


# ---- mazes


@pytest.mark.parametrize("size", [2, 3, 5, 8])
def test_a_maze_has_one_path_between_any_two_cells(size):
    for seed in range(20):
        maze = random_maze(size, np.random.default_rng(seed))
        assert len(maze.steps_from((0, 0))) == size**2
        assert maze.is_open.sum() == size**2 - 1  # connected, and a tree
        assert len(maze.closed_edges()) == (size - 1) ** 2


def test_steps_are_counted_along_open_borders():
    maze = random_maze(5, np.random.default_rng(3))
    steps = maze.steps_from((2, 2))
    for cell, count in steps.items():
        around = [steps[other] for other in maze.neighbours(cell)]
        assert all(abs(other - count) == 1 for other in around)
        assert count == 0 or count - 1 in around


def test_mazes_differ_and_repeat_with_their_seed():
    mazes = [random_maze(4, np.random.default_rng(seed)).is_open.tobytes() for seed in range(30)]
    assert len(set(mazes)) > 25
    assert random_maze(4, np.random.default_rng(7)).is_open.tobytes() == mazes[7]


def test_walls_stand_on_closed_borders_only(game):
    maze = random_maze(4, np.random.default_rng(1))
    walls = game.task._walls
    walls.build(maze, np.random.default_rng(2))
    props = [prop for name, prop in game.world.props.items() if name.startswith("maze_wall")]
    for cell in maze.steps_from((0, 0)):
        for other in [(cell[0] + 1, cell[1]), (cell[0], cell[1] + 1)]:
            if max(other) > 3:
                continue
            border = (walls.middle_of(cell) + walls.middle_of(other))[:2] / 2.0
            free_m = min(clearances_m(prop, border) for prop in props)
            assert (free_m > 0.6) == (other in maze.neighbours(cell))


def test_a_placed_wall_stops_the_walker_and_hides_what_is_behind_it():
    game = game_of("task.cells=2")
    wall = game.world.props["maze_wall_0"]
    game.task.target.place((1.0, 1.2, 0.15))
    for yaw, passes in ((0.0, True), (math.pi / 2.0, False)):
        wall.place((0.0, 1.5, 0.0), yaw)
        game.task.walker.place((-0.5, 1.2, 0.0), 0.0)
        game.world.refresh()
        eyes = game.players[0].senses["vision"].eyes
        assert eyes.is_visible(game.task.target.object_id) is passes
        for _ in range(20):
            game.step({"agents": np.array([1.0, 0.0], np.float32)})
        assert bool(game.task.walker.position[0] > -0.1) is passes
    game.close()


@pytest.mark.parametrize(
    ("override", "parts"),
    [
        ("task.cells=1", ("task.cells=1", " 2 ", " 8 ", "'room'", "6.0 m")),
        ("task.cells=9", ("task.cells=9", " 2 ", " 8 ")),
        ("playground=single_room", ("'single_room'", "furniture", "playground=simple")),
        ("playground=four_rooms", ("'four_rooms'", " 4 ", "playground=simple")),
        ("task.reach_m=0.77", ("task.reach_m=0.77", "0.76", "task.cells=4")),
        ("task.trials=0", ("task.trials=0",)),
        ("task.trial_s=0", ("task.trial_s",)),
        ("body=mitten", ("body=walker",)),
    ],
)
def test_what_cannot_be_built_is_refused(override, parts):
    with pytest.raises(ValueError, match=naming(*parts)):
        Game(compose(["+task=MazeNav", override]).game)


def test_a_trial_shorter_than_a_step_is_refused_by_the_configuration():
    with pytest.raises(ConfigError, match=naming("task.trial_s=0.03", "0.04 s")):
        compose(["+task=MazeNav", "task.trial_s=0.03"])
    compose(["+task=MazeNav", "task.trial_s=0.04"])


# ---- trials


def test_maze_object_and_start_are_the_same_in_all_trials_and_new_in_the_next_episode(game):
    seen = []
    for seed in (0, 1):
        game.reset(np.random.default_rng(seed))
        starts, mazes = set(), set()
        for _ in range(3):
            starts.add(tuple(np.round(game.task.walker.position[:2], 6)))
            walls = [prop.position for prop in game.world.props.values()]
            mazes.add(np.round(np.array([*walls, game.task.target.position]), 6).tobytes())
            for _ in range(10):
                outcome = game.step(STAND)
            if not outcome.terminated:
                game.step(STAND)
        assert len(starts) == len(mazes) == 1
        seen += [mazes.pop()]
    assert seen[0] != seen[1]


def test_the_episode_ends_with_the_last_trial_and_standing_still_finds_nothing(game):
    game.reset(np.random.default_rng(0))
    outcomes = [game.step(STAND) for _ in range(30)]
    assert [outcome.terminated for outcome in outcomes] == [False] * 29 + [True]
    assert sum(outcome.terms["agents"]["reached"] for outcome in outcomes) == 0.0
    assert not game.task.solved(game.players[0])


def test_the_observation_tells_when_a_trial_ends(game):
    game.reset(np.random.default_rng(0))
    np.testing.assert_array_equal(trial_of(game), (0.0, 0.0, 0.0))
    seen = []
    for _ in range(12):
        game.step(STAND)
        seen.append(trial_of(game))
    ended, elapsed, completed = np.array(seen).T
    np.testing.assert_array_equal(np.flatnonzero(ended), [9])
    np.testing.assert_allclose(elapsed, [*np.arange(1, 11) / 10.0, 0.1, 0.2], atol=1e-6)
    np.testing.assert_allclose(completed, [0.0] * 9 + [1.0 / 3.0] * 3, atol=1e-6)


def test_the_observation_of_trials_can_be_removed():
    game = game_of("+senses.extra.trial.present=false")
    assert set(game.observe(game.players[0])) == {"vision"}
    game.step(STAND)
    game.close()


def test_each_trial_is_rewarded_once_and_begins_at_the_start(game):
    game.reset(np.random.default_rng(0))
    start = game.task.walker.position[:2]
    for trial in range(3):
        put_at_the_object(game)
        outcome = game.step(STAND)
        assert outcome.terms["agents"]["reached"] == 1.0
        assert trial_of(game)[0] == 1.0
        assert outcome.terminated is (trial == 2)
        assert game.task.solved(game.players[0]) is (trial == 2)
        if trial < 2:  # what was chosen at the object has no effect
            outcome = game.step({"agents": np.ones(2, np.float32)})
            assert outcome.terms["agents"]["reached"] == 0.0
            np.testing.assert_allclose(game.task.walker.position[:2], start, atol=1e-9)


def test_the_start_is_far_from_the_object(game):
    for seed in range(60):
        game.task.reset(np.random.default_rng(seed))
        away_m = math.dist(game.task.walker.position[:2], game.task.target.position[:2])
        assert away_m > 1.4


# ---- the expert


@pytest.mark.slow
@pytest.mark.parametrize("overrides", [("task.trials=2",), ("task.cells=8", "task.trials=1")])
def test_the_expert_finds_the_object_in_every_trial(overrides):
    game = game_of(*overrides)
    for seed in range(2):
        game.reset(np.random.default_rng(seed))
        done = False
        while not done:
            game.play_script(game.players[0], Script.expert)
            done = game.advance().done
        assert game.task.solved(game.players[0])
    game.close()
