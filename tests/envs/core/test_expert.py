"""The expert registry, and the experts that a game makes."""

import re
from contextlib import closing
from dataclasses import replace

import numpy as np
import pytest
from duels import duel
from knockouts import knockout
from refusals import naming

from veca_marl.envs.adapters.torchrl import ExpertPolicy
from veca_marl.envs.adapters.torchrl.env import VecaEnv
from veca_marl.envs.core.expert import (
    EXPERTS,
    Expert,
    find_expert,
    has_expert,
    missing_needs,
    register_expert,
)
from veca_marl.envs.core.game import Game
from veca_marl.envs.core.game_cfg import Script
from veca_marl.sim.physics import ClockCfg


class Counter(Expert):
    """Walks, and counts what it was asked."""

    def __init__(self, task, player):
        super().__init__(task, player)
        self.resets = self.steps = 0

    def reset(self):
        self.resets, self.steps = self.resets + 1, 0

    def act(self, observation):
        self.steps += 1
        assert set(observation) == {"vision", "audio"}
        return 1.0, 0.0


@pytest.fixture
def cfg(monkeypatch):
    with duel() as cfg:
        monkeypatch.setitem(EXPERTS, "Duel", Counter)
        yield cfg


def test_a_task_without_an_expert_is_playable_and_asking_for_the_expert_lists_the_others():
    with duel() as cfg:
        game = Game(cfg)
        game.reset(np.random.default_rng(0))
        assert not has_expert("Duel")
        named = naming("'Duel'", "expert", "'KickTheBall'", "'TurnBaby'")
        with pytest.raises(ValueError, match=named):
            game.expert_of(game.players[0])
        game.close()
        with pytest.raises(ValueError, match=naming("'Duel'", "expert")):
            Game(replace(cfg, script={"blue": Script.expert}))


def test_a_task_has_one_expert():
    with pytest.raises(ValueError, match=naming("'KickTheBall'", "KickTheBallExpert", "Counter")):
        register_expert("KickTheBall")(Counter)
    assert find_expert("KickTheBall") is not Counter


def test_every_scripted_player_has_an_expert_of_its_own_that_is_reset_with_the_game(cfg):
    game, rng = Game(replace(cfg, script={"blue": Script.expert})), np.random.default_rng(0)
    experts = [game.expert_of(player) for player in game.team("blue")]
    assert experts[0] is not experts[1]
    assert [expert.player.name for expert in experts] == ["blue_0", "blue_1"]
    for episode in (1, 2):
        game.reset(rng)
        for _ in range(2):
            game.step({"red": np.zeros(2, np.float32)})
        assert [(expert.resets, expert.steps) for expert in experts] == [(episode, 2)] * 2
    game.close()


def test_an_expert_that_is_asked_for_during_an_episode_is_reset_then(cfg):
    game = Game(cfg)
    game.reset(np.random.default_rng(0))
    expert = game.expert_of(game.players[0])
    assert (expert.resets, expert.task) == (1, game.task)
    assert game.expert_of(game.players[0]) is expert
    game.close()


def test_an_expert_is_refused_at_a_control_rate_at_which_it_cannot_play(cfg, monkeypatch):
    monkeypatch.setattr(Counter, "control_rates_hz", (30, 50), raising=False)
    scripted = {"blue": Script.expert}
    needed = ("clock.control_rate_hz", "30", "50")
    named = naming("Counter", *needed, "25")
    with pytest.raises(ValueError, match=named):
        Game(replace(cfg, script=scripted))
    with closing(VecaEnv(cfg, 1, seed=0)) as env, pytest.raises(ValueError, match=named):
        ExpertPolicy(env)
    with closing(Game(cfg)) as game:
        (need,) = missing_needs(Counter, game.players[0], game.world.clock)
        assert re.search(naming(*needed), need)
    for rate_hz in (30, 50):
        Game(replace(cfg, script=scripted, clock=ClockCfg(control_rate_hz=rate_hz))).close()


def test_a_player_that_is_eliminated_rests():
    with knockout() as cfg:
        game, rng = Game(cfg), np.random.default_rng(0)
        game.reset(rng)
        first = min(game.players, key=lambda player: game.task.last[player.name])
        for _ in range(30):
            for player in game.players:
                game.play_script(player, Script.expert)
            if game.advance().done:
                break
        assert np.linalg.norm(first.body.velocity) == pytest.approx(0.0, abs=1e-6)
        game.close()
