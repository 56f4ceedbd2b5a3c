"""Registers the game of `knockouts` in the processes of a server, as a plug-in."""

from knockouts import Knockout, KnockoutExpert

from veca_marl.envs.core.expert import EXPERTS
from veca_marl.envs.core.task import TASKS

TASKS["Knockout"], EXPERTS["Knockout"] = Knockout, KnockoutExpert
