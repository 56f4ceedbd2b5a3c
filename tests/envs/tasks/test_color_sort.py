"""ColorSort: placement, rewards, exploits, configuration, the expert."""

import math

import numpy as np
import pytest
import started
from refusals import naming

from veca_marl.envs.core.episodes import play_to_end
from veca_marl.envs.core.game_cfg import Script
from veca_marl.envs.tasks.sorting.sorting_task import COLOURS
from veca_marl.sim.body.walker import WalkCommand

SMALL_EYES = ("senses.vision.width=32", "senses.vision.height=32")


def game_of(*overrides):
    return started.game_of("ColorSort", *SMALL_EYES, *overrides)


@pytest.fixture(scope="module")
def game():
    game = game_of()
    yield game
    game.close()


def put(game, number, basket=None):
    """Put a toy on a basket, or on the floor beside the start; return the reward of the step."""
    item = game.task.items[number]
    if basket is None:
        item.place(np.array([-2.8, number * 0.3 - 1.0, 0.0]), 0.0)
    else:
        x, y, _ = game.task.baskets[basket].prop.position
        game.task.items[number].prop.place((x, y, 0.12))
    return rest(game)


def rest(game, steps=1):
    """Stand still; return the sum of the rewards."""
    total = 0.0
    for _ in range(steps):
        game.players[0].body.rest()
        total += game.reward_of(game.advance().terms["agents"])
    return total


def command(game, verb):
    body = game.players[0].body
    game.step({"agents": body.encode(WalkCommand(0.0, 0.0, verb=verb))})
    return body.applied_verb is not None


def test_all_toys_in_baskets_are_counted(game):
    """Anywhere in a basket, up to its corners, and beside it; against the test of every pair."""
    game.reset(np.random.default_rng(0))
    task, counts = game.task, []
    for x in (-0.21, -0.199, 0.0, 0.199, 0.21):
        for y in (-0.199, 0.1, 0.21):
            for item, basket in zip(task.items, [*task.baskets] * 2, strict=True):
                middle = basket.prop.position
                item.prop.place((middle[0] + x, middle[1] + y, 0.1))
            inside = [[b.contains(item.prop) for b in task.baskets] for item in task.items]
            right = sum(row[c] for row, c in zip(inside, task.category, strict=True))
            task.after_step(np.random.default_rng(0))
            assert task._counts == (right, np.sum(inside) - right)
            counts.append(np.sum(inside))
    assert set(counts) == {0, 6}


# ---- placement


def test_each_colour_has_its_toys_in_every_episode_and_shapes_do_not_tell_the_colour(game):
    seen = {item.prop.name: set() for item in game.task.items}
    for seed in range(20):
        game.reset(np.random.default_rng(seed))
        assert sorted(game.task.category) == [0, 0, 1, 1, 2, 2]
        for item, category in zip(game.task.items, game.task.category, strict=True):
            geoms = game.world.scene.objects[item.prop.object_id].geoms
            colour = game.world.scene.surfaces.colours[geoms]
            expected = COLOURS[game.cfg.task.colours[category]]
            np.testing.assert_allclose(colour, [expected] * len(colour))
            seen[item.prop.name].add(category)
    assert all(categories == {0, 1, 2} for categories in seen.values())


def test_toys_and_baskets_stand_apart_and_stay_where_they_are(game):
    for seed in range(10):
        game.reset(np.random.default_rng(seed))
        things = [*game.task.items, *game.task.baskets]
        before = [one.prop.position[:2] for one in things]
        places = [*before, game.players[0].body.position[:2]]
        assert min(math.dist(a, b) for n, a in enumerate(places) for b in places[:n]) >= 0.75
        assert rest(game, 3) == 0.0
        moved = [math.dist(a, one.prop.position[:2]) for a, one in zip(before, things, strict=True)]
        assert max(moved) < 0.01


# ---- rewards


def test_the_right_basket_is_rewarded_and_a_wrong_one_is_not(game):
    game.reset(np.random.default_rng(0))
    category = game.task.category[0]
    assert put(game, 0, category) == 1.0
    assert put(game, 0, (category + 1) % 3) == -1.5
    assert put(game, 0) == 0.5


def test_a_random_choice_among_the_baskets_has_no_return_on_average(game):
    weights = game.weights
    assert weights["sorted"] / 3 + weights["wrong"] * 2 / 3 == 0.0


def test_putting_in_and_taking_out_has_no_return(game):
    game.reset(np.random.default_rng(0))
    for basket in range(3):
        total = sum(put(game, 0, basket) + put(game, 0) for _ in range(3))
        assert total == 0.0


def test_a_toy_in_the_hand_over_a_basket_is_not_sorted(game):
    game.reset(np.random.default_rng(0))
    walker = game.players[0].body
    walker.grab(game.task.items[0].prop)
    over = np.array([*walker.palms()[1][:2], 0.0])
    game.task.baskets[game.task.category[0]].place(over, 0.0)
    assert not game.task.is_sorted(0)
    walker.release()
    assert game.task.is_sorted(0)


def test_grabbing_and_releasing_has_no_return(game):
    game.reset(np.random.default_rng(0))
    walker = game.players[0].body
    walker.place((0.0, 0.0, 0.0))
    for number in range(1, len(game.task.items)):  # out of reach
        game.task.items[number].place(np.array([-2.8, number * 0.3 - 1.0, 0.0]), 0.0)
    game.task.items[0].place(np.array([0.9, 0.0, 0.0]), 0.0)
    game.world.refresh()
    for _ in range(3):
        assert command(game, "grab")
        assert walker.held is game.task.items[0].prop
        assert rest(game, 5) == 0.0
        assert command(game, "release")
        assert rest(game, 10) == 0.0
        game.task.items[0].place(np.array([0.9, 0.0, 0.0]), 0.0)
        game.world.refresh()


def test_put_into_lays_the_held_toy_into_the_basket_ahead(game):
    game.reset(np.random.default_rng(0))
    walker, basket = game.players[0].body, game.task.baskets[game.task.category[0]]
    walker.place((0.0, 0.0, 0.0))
    for number, other in enumerate(game.task.baskets):  # out of reach
        other.place(np.array([-2.5, number - 1.0, 0.0]), 0.0)
    basket.place(np.array([0.9, 0.0, 0.0]), 0.0)
    game.world.refresh()
    assert not command(game, "put_into")
    walker.grab(game.task.items[0].prop)
    walker.act(walker.encode(WalkCommand(0.0, 0.0, verb="put_into")))
    assert game.reward_of(game.advance().terms["agents"]) == 1.0
    assert rest(game, 20) == 0.0
    assert game.task.is_sorted(0)
    assert walker.held is None


def test_all_toys_in_their_baskets_end_the_episode_solved(game):
    game.reset(np.random.default_rng(0))
    player = game.players[0]
    for number, category in enumerate(game.task.category):
        assert not game.task.solved(player)
        put(game, number, category)
    assert game.task.solved(player)
    assert game.task.terminated()


# ---- configuration


@pytest.mark.parametrize(
    ("words", "parts"),
    [
        (["task.colours=[red]"], ("task.colours=['red']", "'green'", "'blue'")),
        (["task.colours=[red,red]"], ("task.colours=['red', 'red']",)),
        (["task.colours=[red,pink]"], ("'pink'", "'green'", "'blue'")),
        (["task.items=0"], ("task.items=0",)),
        (["task.apart_m=0.3"], ("task.apart_m=0.3",)),
        (["body.verbs=[grab]"], ("body.verbs=['grab']", "['put_into']")),
        (["body.interaction_range_m=0"], ("body.interaction_range_m=0", "put_into")),
        (["task.apart_m=6"], ("task.apart_m=6", " 10 ", "6.00 m")),
    ],
)
def test_impossible_values_are_errors_that_name_them(words, parts):
    with pytest.raises(ValueError, match=naming(*parts)):
        game_of(*words)


# ---- expert


@pytest.mark.slow
@pytest.mark.parametrize("body", ["walker_verbs", "walker_discrete_verbs"])
def test_the_expert_sorts_with_either_kind_of_move(body):
    game = game_of(f"body={body}", "task.items=1")
    taken_s = []
    for seed in range(4):
        game.reset(np.random.default_rng(seed))
        list(play_to_end(game, Script.expert))
        if game.task.solved(game.players[0]):
            taken_s.append(game.steps * game.world.clock.step_s)
    assert len(taken_s) >= 2
    assert min(taken_s) < 20.0
    game.close()
