"""Rules of the tasks that ship with the package. Importing this package registers them."""

from veca_marl.envs.tasks.babyzumas_revenge import BabyzumasRevenge
from veca_marl.envs.tasks.cars.chase_car import ChaseCar
from veca_marl.envs.tasks.cars.dodge_car import DodgeCar
from veca_marl.envs.tasks.hand_regard import HandRegard
from veca_marl.envs.tasks.kick_the_ball import KickTheBall
from veca_marl.envs.tasks.locomotion.crawl_baby import CrawlBaby
from veca_marl.envs.tasks.locomotion.run_baby import RunBaby
from veca_marl.envs.tasks.locomotion.sit_baby import SitBaby
from veca_marl.envs.tasks.locomotion.turn_baby import TurnBaby
from veca_marl.envs.tasks.navigation.maze_nav import MazeNav
from veca_marl.envs.tasks.navigation.multi_agent_nav import MultiAgentNav
from veca_marl.envs.tasks.navigation.object_nav import ObjectNav, ObjectPhysNav
from veca_marl.envs.tasks.objects.grab_object import GrabObject
from veca_marl.envs.tasks.objects.move_to_target import MoveToTarget
from veca_marl.envs.tasks.objects.pile_up_block import PileUpBlock
from veca_marl.envs.tasks.objects.put_down_block import PutDownBlock
from veca_marl.envs.tasks.objects.rotate_cube import RotateCube
from veca_marl.envs.tasks.push_out import PushOut1v1, PushOut2v2
from veca_marl.envs.tasks.self_touch import SelfTouch
from veca_marl.envs.tasks.soccer import SoccerOnePlayer, SoccerTwoPlayer
from veca_marl.envs.tasks.sorting.color_sort import ColorSort
from veca_marl.envs.tasks.sorting.fill_fraction import FillFraction
from veca_marl.envs.tasks.sorting.shape_sort import ShapeSort

__all__ = [
    "BabyzumasRevenge",
    "ChaseCar",
    "ColorSort",
    "CrawlBaby",
    "DodgeCar",
    "FillFraction",
    "GrabObject",
    "HandRegard",
    "KickTheBall",
    "MazeNav",
    "MoveToTarget",
    "MultiAgentNav",
    "ObjectNav",
    "ObjectPhysNav",
    "PileUpBlock",
    "PushOut1v1",
    "PushOut2v2",
    "PutDownBlock",
    "RotateCube",
    "RunBaby",
    "SelfTouch",
    "ShapeSort",
    "SitBaby",
    "SoccerOnePlayer",
    "SoccerTwoPlayer",
    "TurnBaby",
]
