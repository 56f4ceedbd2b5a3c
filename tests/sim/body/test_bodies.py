"""Bodies in a world: the registry, bodies of plug-ins, and the state after a reset."""

from dataclasses import dataclass

import numpy as np
import pytest
from composed import compose
from refusals import naming
from walking import ball, empty_world

from veca_marl.sim.body import BODIES, Body, BodyCfg, VoiceKind, make_body, register_body
from veca_marl.sim.body.humanoid import HumanoidCfg
from veca_marl.sim.body.walker import Walker, WalkerCfg
from veca_marl.sim.sense import discrete_spec

CFGS = {"walker": WalkerCfg(voice=VoiceKind.calls), "humanoid": HumanoidCfg()}


@dataclass
class StatueCfg(BodyCfg):
    """Parameters of a body that a plug-in adds."""

    pedestal_m: float = 0.5


class Statue(Body):
    """A body of a plug-in: it stands still and chooses a pose."""

    cfg_type = StatueCfg

    def __init__(self, name, cfg, world, shirt=0):
        super().__init__(name, cfg, world, shirt)
        self.pose = 0
        world.attach(self)

    def _movement_spec(self, cfg):
        return {"pose": discrete_spec(("arms_down", "arms_up"))}

    body_id = -1
    velocity = np.zeros(3)
    forward = np.array([1.0, 0.0, 0.0])

    def _move(self, parts):
        self.pose = int(parts["pose"])

    def encode(self, command):
        return self._with_voice({"pose": np.asarray(command)}, 0)

    def rest(self):
        self.pose = 0

    def place(self, position, yaw_rad=0.0):
        self._frames()[0][0] = position

    def before_step(self): ...

    def before_substep(self, substep_s): ...

    def write_frames(self): ...


def test_a_body_without_joints_defines_nothing_after_a_physics_step():
    world = empty_world()
    Statue("statue", StatueCfg(), world)
    world.freeze()
    world.reset(np.random.default_rng(0))
    world.step()
    world.close()


@pytest.fixture
def statue():
    register_body("statue", Statue)
    yield StatueCfg(voice=VoiceKind.calls)
    del BODIES["statue"]


@pytest.mark.parametrize("name", CFGS)
def test_the_class_of_the_configuration_chooses_the_body(name):
    body = make_body("child", CFGS[name], empty_world())
    assert type(body) is BODIES[name]
    assert isinstance(body, Body)


def test_a_configuration_without_a_body_is_refused_with_the_known_ones():
    with pytest.raises(ValueError, match=naming("BodyCfg", "HumanoidCfg", "WalkerCfg")):
        make_body("child", BodyCfg(), empty_world())


def test_a_plug_in_adds_a_body_that_acts_and_calls(statue):
    world = empty_world()
    body = make_body("child", statue, world)
    assert list(body.action_spec) == ["pose", "voice"]
    world.freeze()
    world.reset(np.random.default_rng(0))
    body.act({"pose": np.array(1), "voice": np.array(2)})
    assert body.pose == 1
    assert body._voice.speaking
    with pytest.raises(ValueError, match=naming("'pose'", "array(2)", "arms_up")):
        body.act({"pose": np.array(2), "voice": np.array(0)})


def test_the_body_of_a_plug_in_is_a_choice_of_the_configuration(statue):
    cfg = compose(["+task=ObjectNav", "body=statue", "body.pedestal_m=0.7"]).game.body
    assert type(cfg) is StatueCfg
    assert cfg.pedestal_m == 0.7


def test_two_bodies_of_one_configuration_are_refused():
    with pytest.raises(ValueError, match=naming("WalkerCfg", "'walker'")):
        register_body("runner", type("Runner", (Walker,), {}))


@pytest.mark.parametrize(
    ("wrong", "parts"),
    [
        ({"eye_range_deg": -1.0}, ("body.eye_range_deg=-1.0",)),
        ({"eye_range_deg": 90.0}, ("body.eye_range_deg=90.0",)),
        ({"voice": "loud"}, ("body.voice='loud'", "silent", "calls")),
    ],
)
@pytest.mark.parametrize("cfg_type", [WalkerCfg, HumanoidCfg])
def test_impossible_parameters_are_refused(cfg_type, wrong, parts):
    with pytest.raises(ValueError, match=naming(*parts)):
        cfg_type(**wrong)


# ---- reset


def state_of(body, world):
    colours = world.scene.geoms.colours[world.scene.find(body.name).geoms]
    return {
        "muted": body.muted,
        "speaking": body._voice.speaking,
        "focal_distance_m": body.focal_distance_m,
        "colours": colours.copy(),
        "eye": body.mount("eye_left").rotation,
        "bones": body.bone_positions(),
        "angles": body.joint_angles(),
        "torques": body.joint_torques(),
        "velocity": body.velocity,
    }


@pytest.mark.parametrize("name", CFGS)
def test_a_reset_restores_the_state_in_which_a_body_was_built(name):
    world = empty_world(ball())
    body = make_body("child", CFGS[name], world)
    world.freeze()
    world.reset(np.random.default_rng(0))
    built = state_of(body, world)
    disturb(body, world)
    disturbed = state_of(body, world)
    for key in ("muted", "speaking", "focal_distance_m", "colours", "eye", "bones", "angles"):
        assert not np.array_equal(disturbed[key], built[key]), key
    world.reset(np.random.default_rng(0))
    np.testing.assert_equal(state_of(body, world), built)


def disturb(body, world):
    """Change everything that a body lets change."""
    body.place((1.0, 1.0, 0.0), 0.5)
    body.act({part: np.full(s.shape, s.high, s.dtype) for part, s in body.action_spec.items()})
    for _ in range(3):
        world.step()
    body.make_sound(np.ones(9000, np.float32))
    body.muted = True
    body.look_toward_point((3.0, 4.0, 0.0))
    body.adjust_focal_length(0.3)
    world.scene.find(body.name).paint((0.1, 0.2, 0.3))


@pytest.mark.parametrize("name", CFGS)
def test_a_body_touches_only_props_in_contact(name):
    world = empty_world(ball(position=(3.0, 0.0, 0.1)))
    body = make_body("child", CFGS[name], world)
    prop = world.prop("ball")
    world.freeze()
    world.reset(np.random.default_rng(0))
    world.step()
    assert not body.touches(prop)
    prop.place((0.0, 0.19 if name == "walker" else 0.0, 0.1 if name == "walker" else 1.2))
    for _ in range(20):
        world.step()
        if body.touches(prop):
            return
    pytest.fail("the ball never touched the body")
