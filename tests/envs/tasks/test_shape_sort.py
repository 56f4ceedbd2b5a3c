"""ShapeSort: categories are shapes, samples on stands, the expert."""

import numpy as np
import pytest
import started
from refusals import naming

from veca_marl.envs.core.game_cfg import Script
from veca_marl.envs.tasks.sorting.sorting_task import COLOURS

SMALL_EYES = ("senses.vision.width=32", "senses.vision.height=32")
ALL_SHAPES = ("task.shapes=[sphere,cube,pyramid,cylinder,doll]", "task.items=1")


def game_of(*overrides):
    return started.game_of("ShapeSort", *SMALL_EYES, *overrides)


@pytest.fixture(scope="module")
def game():
    game = game_of(*ALL_SHAPES)
    yield game
    game.close()


def rest(game):
    game.players[0].body.rest()
    return game.reward_of(game.advance().terms["agents"])


def test_a_sample_of_the_shape_stands_behind_each_basket(game):
    for seed in range(5):
        game.reset(np.random.default_rng(seed))
        for name, basket in zip(game.cfg.task.shapes, game.task.baskets, strict=True):
            stand, sample = basket.sign
            assert (
                sample.cfg.shape is game.task.items[game.cfg.task.shapes.index(name)].prop.cfg.shape
            )
            assert sample.fixed
            assert sample.cfg.interactions == []
            np.testing.assert_allclose(sample.position[:2], stand.position[:2], atol=1e-9)
            assert sample.lowest_m == pytest.approx(0.3, abs=0.01)


def test_colours_differ_from_episode_to_episode_and_say_nothing(game):
    seen = set()
    for seed in range(30):
        game.reset(np.random.default_rng(seed))
        assert game.task.category == [0, 1, 2, 3, 4]
        geoms = game.world.scene.objects[game.task.items[0].prop.object_id].geoms
        seen.add(tuple(game.world.scene.surfaces.colours[geoms][0].round(2).tolist()))
    assert len(seen) == len(COLOURS)


def test_every_shape_falls_into_its_basket_and_is_rewarded_once(game):
    game.reset(np.random.default_rng(0))
    total = 0.0
    for number in range(5):
        prop, basket = game.task.items[number].prop, game.task.baskets[number].prop
        for _ in range(2):
            prop.place(basket.position + np.array([0.0, 0.0, 0.3]))
            total += rest(game)
    for _ in range(20):
        total += rest(game)
    assert total == 5.0
    assert game.task.solved(game.players[0])
    assert all(
        b.prop.contains(i.prop) for b, i in zip(game.task.baskets, game.task.items, strict=True)
    )


def test_an_unknown_shape_is_an_error_that_lists_the_choices():
    with pytest.raises(ValueError, match=naming("['sphere', 'ring']", "'cube'", "'pyramid'")):
        game_of("task.shapes=[sphere,ring]")


def test_the_expert_sorts_all_shapes(game):
    game.reset(np.random.default_rng(3))
    done = False
    while not done:
        game.play_script(game.players[0], Script.expert)
        done = game.advance().done
    assert game.task.solved(game.players[0])
