"""A game of two teams in which all players have different places and rewards."""

from contextlib import contextmanager
from dataclasses import dataclass, replace

from composed import compose

from veca_marl.envs.core.task import TASKS, Task, TaskCfg, Team, terms

STEPS = 4


@dataclass
class DuelCfg(TaskCfg):
    weights: dict[str, float] = terms(place=1.0, luck=0.5)


class Duel(Task):
    """Ends by its rules after `STEPS` steps.

    Terms:
        place: how far a player has come along x.
        luck: random, and another number for each player.
    """

    teams = (Team("red"), Team("blue", 2))
    senses = ("vision", "audio")
    cfg: DuelCfg

    def build(self):
        self.steps, self.luck = 0, {}

    def reset(self, rng):
        self.steps = 0
        for x, player in enumerate(self.players):
            player.body.place((float(x), 0.0, 0.0), rng.uniform(-1.0, 1.0))

    def after_step(self, rng):
        self.steps += 1
        self.luck = {player.name: rng.uniform() for player in self.players}

    def reward(self, player):
        return {"place": float(player.body.position[0]), "luck": self.luck[player.name]}

    def terminated(self):
        return self.steps >= STEPS


@contextmanager
def duel(*overrides):
    """Register the task within the context; yield its configuration."""
    game = compose(["+task=KickTheBall", "playground=simple", *overrides]).game
    TASKS["Duel"] = Duel
    try:
        yield replace(game, task=DuelCfg(name="Duel"))
    finally:
        del TASKS["Duel"]
