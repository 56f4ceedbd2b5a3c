"""The tasks. Importing this package registers them all."""

from veca_marl.envs.tasks.crawl_baby import CrawlBaby
from veca_marl.envs.tasks.kick_the_ball import KickTheBall
from veca_marl.envs.tasks.sit_baby import SitBaby
from veca_marl.envs.tasks.turn_baby import TurnBaby

__all__ = ["CrawlBaby", "KickTheBall", "SitBaby", "TurnBaby"]
