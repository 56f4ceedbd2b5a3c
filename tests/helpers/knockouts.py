"""A game of two teams in which one player after another is eliminated."""

from contextlib import contextmanager
from dataclasses import dataclass, replace

from veca_marl.envs.core.expert import EXPERTS, Expert
from veca_marl.envs.core.task import TASKS, Task, TaskCfg, Team, terms


@dataclass
class KnockoutCfg(TaskCfg):
    weights: dict[str, float] = terms(place=1.0)


class Knockout(Task):
    """Each player is eliminated at a time drawn at the start; the last one ends the game.

    Terms:
        place: how far a player has come along x.
    """

    teams = (Team("red", senses=("proprioception",)), Team("blue", 2))
    senses = ("proprioception", "audio")
    eliminates = True
    cfg: KnockoutCfg

    def build(self):
        self.steps, self.last = 0, {}

    def reset(self, rng):
        self.steps = 0
        order = rng.permutation([2, 4, 6])
        for x, player in enumerate(self.players):
            self.last[player.name] = order[x]
            player.body.place((float(x), 0.0, 0.0), rng.uniform(-1.0, 1.0))

    def after_step(self, rng):
        self.steps += 1

    def is_eliminated(self, player):
        return self.steps >= self.last[player.name]

    def reward(self, player):
        return {"place": float(player.body.position[0]) + 5.0}


class KnockoutExpert(Expert):
    def act(self, observation):
        return 1.0, float(observation["proprioception"].mean() > 0.0)


@contextmanager
def knockout(*overrides):
    """Register the task within the context; yield its configuration."""
    from composed import compose  # not in the processes of a server, which need no torch

    game = compose(["+task=KickTheBall", "playground=simple", *overrides]).game
    TASKS["Knockout"], EXPERTS["Knockout"] = Knockout, KnockoutExpert
    try:
        yield replace(game, task=KnockoutCfg(name="Knockout"))
    finally:
        del TASKS["Knockout"], EXPERTS["Knockout"]
