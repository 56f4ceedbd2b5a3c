"""The tasks. Importing this package registers them all."""

from veca_marl.envs.tasks.crawl_baby import CrawlBaby
from veca_marl.envs.tasks.grab_object import GrabObject
from veca_marl.envs.tasks.kick_the_ball import KickTheBall
from veca_marl.envs.tasks.move_to_target import MoveToTarget
from veca_marl.envs.tasks.multi_agent_nav import MultiAgentNav
from veca_marl.envs.tasks.pile_up_block import PileUpBlock
from veca_marl.envs.tasks.push_out_1v1 import PushOut1v1
from veca_marl.envs.tasks.push_out_2v2 import PushOut2v2
from veca_marl.envs.tasks.put_down_block import PutDownBlock
from veca_marl.envs.tasks.rotate_cube import RotateCube
from veca_marl.envs.tasks.run_baby import RunBaby
from veca_marl.envs.tasks.sit_baby import SitBaby
from veca_marl.envs.tasks.soccer_one_player import SoccerOnePlayer
from veca_marl.envs.tasks.soccer_two_player import SoccerTwoPlayer
from veca_marl.envs.tasks.turn_baby import TurnBaby

__all__ = [
    "CrawlBaby",
    "GrabObject",
    "KickTheBall",
    "MoveToTarget",
    "MultiAgentNav",
    "PileUpBlock",
    "PushOut1v1",
    "PushOut2v2",
    "PutDownBlock",
    "RotateCube",
    "RunBaby",
    "SitBaby",
    "SoccerOnePlayer",
    "SoccerTwoPlayer",
    "TurnBaby",
]
