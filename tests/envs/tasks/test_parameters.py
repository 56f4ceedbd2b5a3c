"""Impossible parameters of tasks, and bodies that a task cannot use, are errors that name them."""

from dataclasses import replace

import pytest
from composed import compose
from hydra.core.override_parser.overrides_parser import OverridesParser
from omegaconf import OmegaConf
from refusals import naming

from veca_marl.envs.core.game import Game
from veca_marl.sim.body.humanoid import HumanoidCfg
from veca_marl.sim.body.walker import WalkerCfg

HUMANOID_TASKS = (
    *("TurnBaby", "SitBaby", "CrawlBaby", "RunBaby"),
    *("GrabObject", "MoveToTarget", "PileUpBlock", "PutDownBlock", "RotateCube"),
)
CONTESTS = ("PushOut1v1", "PushOut2v2", "SoccerOnePlayer", "SoccerTwoPlayer")


@pytest.mark.parametrize("task", HUMANOID_TASKS + CONTESTS)
def test_tasks_at_joint_level_in_the_paper_have_such_a_body_by_default(task):
    assert isinstance(compose([f"+task={task}"]).game.body, HumanoidCfg)


@pytest.mark.parametrize("name", ["soccer", "memory_soccer", "mappo_ippo", "self_play"])
def test_experiments_with_walkers_choose_them(name):
    assert isinstance(compose([f"+experiment={name}"]).game.body, WalkerCfg)


def make_game(task, override):
    """Make a game with an override of Hydra's grammar; to compose each of them takes longer."""
    cfg = compose([f"+task={task}"]).game
    node, found = OmegaConf.structured(cfg.task), OverridesParser.create().parse_override(override)
    OmegaConf.update(node, found.key_or_group, found.value())
    return Game(replace(cfg, task=OmegaConf.to_object(node)))


@pytest.mark.parametrize(
    ("task", "override", "parts"),
    [
        ("KickTheBall", "speed_mps=[1.0,0.5]", ("speed_mps",)),
        ("KickTheBall", "speed_mps=[0.0,1.0]", ("speed_mps",)),
        ("KickTheBall", "life_s=0.0", ("life_s",)),
        ("KickTheBall", "rest_s=-1.0", ("rest_s",)),
        ("KickTheBall", "radius_m=4", ("task.radius_m=4.0", "0.6")),
        ("KickTheBall", "radius_m=0", ("task.radius_m=0.0",)),
        ("KickTheBall", "mass_kg=0", ("task.mass_kg=0.0",)),
        ("KickTheBall", "pulse_s=-1", ("task.pulse_s=-1.0",)),
        ("KickTheBall", "loudness=-1", ("task.loudness=-1.0",)),
        ("KickTheBall", "spread_deg=90", ("task.spread_deg=90.0", "[0, 90)")),
        ("BabyzumasRevenge", "loudness=-1", ("task.loudness=-1.0",)),
        ("BabyzumasRevenge", "frequency_hz=10", ("frequency_hz=10.0", "80")),
        ("TurnBaby", "spread_deg=-1.0", ("spread_deg",)),
        ("TurnBaby", "spread_deg=31.0", ("spread_deg",)),
        ("SitBaby", "torso_m=0.0", ("torso_m",)),
        ("SitBaby", "head_m=inf", ("head_m",)),
        ("SitBaby", "starts={on_back:0}", ("task.starts=", "'on_back'")),
        ("SitBaby", "starts={on_back:-1,sitting:2}", ("task.starts=", "'on_back': -1")),
        ("SitBaby", "starts={sitting:inf}", ("task.starts=", "'sitting': inf")),
        ("SitBaby", "starts={lying:1}", ("task.starts", "'lying'", "offering", "on_back")),
        ("CrawlBaby", "top_mps=0.0", ("top_mps",)),
        ("CrawlBaby", "top_mps=inf", ("top_mps",)),
        ("RunBaby", "top_mps=0.0", ("top_mps",)),
        ("RunBaby", "fallen_m=0.7", ("fallen_m",)),
        ("RunBaby", "kneeling_m=0.2", ("kneeling_m",)),
        ("TurnBaby", "turned_deg=90", ("turned_deg",)),
        ("SitBaby", "upright_deg=90", ("upright_deg",)),
        ("SitBaby", "sat=0", ("sat=0",)),
        ("SitBaby", "seat_m=0", ("seat_m",)),
        ("GrabObject", "edge_m=0.2", ("edge_m",)),
        ("GrabObject", "mass_kg=0.0", ("mass_kg",)),
        ("GrabObject", "ahead_m=[0.3,0.2]", ("ahead_m",)),
        ("GrabObject", "aside_m=-0.1", ("aside_m",)),
        ("GrabObject", "turn_deg=-1", ("task.turn_deg=-1.0",)),
        ("GrabObject", "lifted_m=0.0", ("lifted_m",)),
        ("MoveToTarget", "target_m=[0.03,0.1]", ("target_m",)),
        ("MoveToTarget", "solved_m=0.0", ("solved_m",)),
        ("MoveToTarget", "solved_m=-1.0", ("task.solved_m=-1.0",)),
        ("MoveToTarget", "clip_m=0.1", ("clip_m",)),
        ("MoveToTarget", "edge_m=-1.0", ("edge_m",)),
        ("PileUpBlock", "edge_m=0.0", ("edge_m=0.0",)),
        ("PileUpBlock", "edge_m=0.2", ("task.edge_m=0.2", "0.1 m")),
        ("PileUpBlock", "mass_kg=-1.0", ("mass_kg=-1.0",)),
        ("PileUpBlock", "ahead_m=[0.3,0.2]", ("ahead_m",)),
        ("PileUpBlock", "aside_m=[0.01,0.2]", ("aside_m",)),
        ("PileUpBlock", "blue_ahead_m=[0.3,0.4]", ("task.blue_ahead_m=(0.3, 0.4)",)),
        ("PileUpBlock", "blue_aside_m=-1", ("blue_aside_m=-1",)),
        ("RotateCube", "clear_m=0", ("clear_m",)),
        ("PutDownBlock", "blue=0", ("blue=0",)),
        ("PutDownBlock", "turn_deg=-5", ("task.turn_deg=-5.0",)),
        ("PutDownBlock", "ahead_m=[0.3,0.2]", ("ahead_m",)),
        ("PutDownBlock", "ahead_m=[0.14,0.2]", ("task.ahead_m=(0.14, 0.2)", "0.150")),
        ("PutDownBlock", "edge_m=0.1", ("0.250", "task.blue=2", "task.edge_m=0.1")),
        ("PutDownBlock", "fallen=1.5", ("fallen=1.5",)),
        ("RotateCube", "edge_m=0.0", ("edge_m",)),
        ("RotateCube", "lost_m=0.01", ("lost_m",)),
        ("RotateCube", "start_deg=60.0", ("start_deg",)),
        ("RotateCube", "turn_deg=5.0", ("turn_deg",)),
        ("RotateCube", "friction=inf", ("friction",)),
        ("PushOut1v1", "radius_m=3.5", ("task.radius_m=3.5", "'room'")),
        ("PushOut1v1", "radius_m=0.2", ("task.radius_m=0.2", "0.5 m")),
        ("PushOut1v1", "start_share=1.0", ("task.start_share=1.0", "[0.3, 0.9]")),
        ("PushOut1v1", "spread_deg=200", ("task.spread_deg=200", "[0, 180]")),
        (
            "SoccerTwoPlayer",
            "ball_from_goal_m=[2.0,5.0]",
            ("6.6 m", "task.ball_from_goal_m", "'room'"),
        ),
        ("SoccerTwoPlayer", "aside_m=2.9", ("5.8 m", "task.aside_m", "'room'")),
        ("SoccerTwoPlayer", "ball_from_goal_m=[3.0,2.0]", ("task.ball_from_goal_m=(3.0, 2.0)",)),
        ("SoccerTwoPlayer", "radius_m=0.7", ("task.goal_width_m=", "task.radius_m=0.7")),
        ("SoccerTwoPlayer", "kick_rest_s=0", ("task.kick_rest_s=0",)),
        ("SoccerTwoPlayer", "spread_deg=200", ("task.spread_deg=200", "[0, 180]")),
        (
            "SoccerTwoPlayer",
            "defender_from_goal_m=[0.3,1.5]",
            ("task.defender_from_goal_m=(0.3, 1.5)", "0.57 m"),
        ),
        (
            "SoccerOnePlayer",
            "goal_from_wall_m=0.12",
            ("task.goal_from_wall_m=0.12", "task.radius_m=0.12"),
        ),
        (
            "SoccerOnePlayer",
            "goal_width_m=5.1",
            ("'simple'", "task.goal_width_m=5.1", " 5 ", "'room'", "6 m"),
        ),
        (
            "SoccerOnePlayer",
            "attacker_from_ball_m=[0.56,1.0]",
            ("task.attacker_from_ball_m=(0.56, 1.0)", "0.57", "task.radius_m=0.12"),
        ),
        (
            "ObjectNav",
            "reach_m=1.1",
            ("task.apart_m=1.2", "task.reach_m=1.1", "pyramid", "0.20 m"),
        ),
        ("ObjectNav", "apart_m=0.45", ("task.apart_m=0.45", "task.reach_m=0.3")),
        ("ObjectPhysNav", "reach_m=1.85", ("task.apart_m=2", "task.reach_m=1.85")),
        ("KickTheBall", "speed_mps=[50,60]", ("task.speed_mps", " 60 ", "task.radius_m=0.15")),
        ("RotateCube", "edge_m=0.5", ("task.edge_m=0.5", "0.1")),
        ("MultiAgentNav", "agents=1", ("task.agents=1", "2")),
        ("MultiAgentNav", "radius_m=0", ("task.radius_m=0.0",)),
    ],
)
def test_impossible_parameters_are_refused(task, override, parts):
    with pytest.raises(ValueError, match=naming(*parts)):
        make_game(task, override)


def test_an_unknown_choice_is_refused_with_the_choices():
    with pytest.raises(ValueError, match=naming("muted", "'most'", "finder", "seekers")):
        compose(["+task=MultiAgentNav", "task.muted=most"])


@pytest.mark.parametrize("task", HUMANOID_TASKS)
def test_tasks_at_joint_level_refuse_a_walker(task):
    with pytest.raises(ValueError, match=naming("joints", "body=full")):
        Game(compose([f"+task={task}", "body=walker"]).game)


def test_kick_the_ball_refuses_a_body_with_joints():
    with pytest.raises(ValueError, match=naming("body=walker")):
        Game(compose(["+task=KickTheBall", "body=mitten"]).game)
