"""SelfTouch: distinct regions of the own body that each hand touches."""

import numpy as np
import pytest
from composed import compose

from veca_marl.envs.core.game import Game
from veca_marl.envs.tasks.self_touch import region_of, regions_of, touched_regions
from veca_marl.sim.body.humanoid.postures import Posture

# the right palm on the left forearm
ARMS_CROSSED = {
    "l_upper_arm.flexion": 45.0,
    "l_forearm.flexion": 90.0,
    "l_upper_arm.internal_rotation": 60.0,
    "r_upper_arm.flexion": 45.0,
    "r_forearm.flexion": 90.0,
    "r_upper_arm.internal_rotation": 60.0,
}


@pytest.fixture(scope="module")
def game():
    game = Game(compose(["+task=SelfTouch", "senses/touch=numb"]).game)
    yield game
    game.close()


def step(game):
    game.step(
        {player.name: player.body.encode(player.body.joint_angles()) for player in game.actors}
    )


def test_a_hand_has_14_regions_without_its_own_arm():
    assert len(regions_of("l")) == len(set(regions_of("l"))) == 14
    assert "r_forearm" in regions_of("l")
    assert not {"l_hand", "l_forearm", "l_upper_arm"} & set(regions_of("l"))


def test_fingers_belong_to_the_hand():
    assert region_of("l_thumb_distal") == region_of("l_index_middle") == "l_hand"
    assert region_of("r_shank") == "r_shank"
    assert region_of("chest") == "chest"


class Touching:
    """A body with given contacts."""

    def __init__(self, *pairs):
        self._pairs = set(pairs)

    def self_contacts(self):
        return self._pairs


def test_contacts_of_hands_count_and_others_do_not():
    body = Touching(("chest", "l_index_distal"), ("l_hand", "r_thumb_distal"), ("l_foot", "r_foot"))
    assert touched_regions(body) == {"left_hand": {"chest", "r_hand"}, "right_hand": {"l_hand"}}


def test_nothing_is_touched_at_the_start(game):
    game.reset(np.random.default_rng(0))
    assert game.task.touched == {"left_hand": set(), "right_hand": set()}
    step(game)
    assert sum(game.task.reward(game.players[0]).values()) == 0.0


def test_a_region_is_rewarded_once_in_an_episode(game):
    """The hands are put against each other."""
    game.reset(np.random.default_rng(0))
    body = game.actors[0].body
    folded = Posture(-90.0, ARMS_CROSSED)
    rewards = []
    for _ in range(3):
        body.place(body.position * (1, 1, 0), 0.0, folded)
        step(game)
        rewards.append(game.task.reward(game.players[0]))
    touched = game.task.touched
    assert touched["left_hand"] | touched["right_hand"], "the arms are folded"
    for hand, regions in touched.items():
        total = sum(reward[hand] for reward in rewards)
        assert total == pytest.approx(len(regions) / 14)
    assert rewards[2] == {"left_hand": 0.0, "right_hand": 0.0}
    game.reset(np.random.default_rng(1))
    assert not any(game.task.touched.values())


@pytest.mark.slow
def test_the_expert_touches_most_regions(game):
    from veca_marl.envs.core.game_cfg import Script

    game.reset(np.random.default_rng(5))
    for _ in range(500):
        game.play_script(game.actors[0], Script.expert)
        game.advance()
    assert sum(map(len, game.task.touched.values())) >= 16
