"""Laws of all senses: idempotent reading, no influence of one on another, the registry."""

from dataclasses import dataclass
from itertools import chain

import numpy as np
import pytest
from refusals import naming
from walking import ball, box, empty_world

from veca_marl.sim.body.humanoid import Detail, Humanoid, HumanoidCfg
from veca_marl.sim.body.proprioception import ProprioceptionCfg, ProprioceptionQuality
from veca_marl.sim.body.walker import Walker, WalkerCfg
from veca_marl.sim.hearing import AudioCfg, AudioQuality
from veca_marl.sim.physics import PropCfg
from veca_marl.sim.sense import ArraySpec, Sense
from veca_marl.sim.senses import SENSES, SensesCfg, make_senses, register_sense
from veca_marl.sim.sound import SoundCfg
from veca_marl.sim.touch import TouchCfg, TouchQuality
from veca_marl.sim.vision import Eyes, VisionCfg

NAMES = ("vision", "audio", "proprioception", "touch")
QUALITIES = {
    "default": SensesCfg(),
    "infant eyes, stereo, joints, hands": SensesCfg(
        VisionCfg(infant_age_months=2.0, defocus=True, depth=True, segmentation=True),
        AudioCfg(quality=AudioQuality.stereo, waveform=True),
        ProprioceptionCfg(quality=ProprioceptionQuality.joints),
        TouchCfg(quality=TouchQuality.hands),
    ),
    "one grey eye, mono, vestibular, binary": SensesCfg(
        VisionCfg(eyes=Eyes.monocular, grey=True, blur_deg=1.0, depth=True),
        AudioCfg(quality=AudioQuality.mono, noise_floor_db=-80.0),
        ProprioceptionCfg(quality=ProprioceptionQuality.vestibular),
        TouchCfg(quality=TouchQuality.binary),
    ),
    "coarse touch": SensesCfg(touch=TouchCfg(quality=TouchQuality.coarse)),
}
MAKE_BODY = {
    "walker": lambda name, world: Walker(name, WalkerCfg(), world),
    "humanoid": lambda name, world: Humanoid(name, HumanoidCfg(detail=Detail.mitten), world),
}


class Scenario:
    """Two bodies of one kind, a buzzing ball that falls or not, and a box that falls."""

    def __init__(self, body, cfg=None, still=False):
        mass_kg = 0.0 if still else 0.3
        buzzer = ball("buzzer", 0.1, mass_kg, (0.7, 0.4, 0.6), sound=SoundCfg(level=0.1))
        self.world = empty_world(buzzer, box(position=(0.4, -0.3, 0.5)))
        self.bodies = [MAKE_BODY[body](name, self.world) for name in ("one", "two")]
        self.senses = [
            make_senses(own, NAMES, cfg or SensesCfg(), self.world) for own in self.bodies
        ]
        self.world.freeze()
        self.reset()

    def reset(self, seed=0):
        self.world.reset(np.random.default_rng(seed))
        for index, own in enumerate(self.bodies):
            own.place((0.9 * index, 0.2 * index, 0.0), 3.0 * index)
        self.world.prop("buzzer").place((0.7, 0.4, 0.6))
        for sense in chain(*(senses.values() for senses in self.senses)):
            sense.reset()
        self.world.refresh()

    def step(self, count=1):
        for _ in range(count):
            self.world.step()

    def read(self, bodies=(0, 1), names=NAMES):
        """Copies of what the bodies observe, read in the given order."""
        return {
            (body, name, key): value.copy()
            for body in bodies
            for name in names
            for key, value in self.senses[body][name].read().items()
        }


@pytest.fixture(params=MAKE_BODY)
def body(request):
    return request.param


@pytest.fixture
def stage():
    made = []

    def scenario(*args):
        made.append(Scenario(*args))
        return made[-1]

    yield scenario
    for scenario in made:
        scenario.world.close()


def assert_equal(one, other):
    assert one.keys() == other.keys()
    for key, value in one.items():
        assert value.tobytes() == other[key].tobytes(), key


@pytest.mark.parametrize("cfg", QUALITIES.values(), ids=QUALITIES)
def test_reading_twice_in_one_step_gives_the_same_values(body, cfg, stage):
    scenario = stage(body, cfg)
    for _ in range(4):
        first = scenario.read()
        assert_equal(scenario.read(), first)
        scenario.step()


def test_a_second_read_computes_nothing(body, monkeypatch, stage):
    scenario = stage(body)
    scenario.read()
    for name, sense in scenario.senses[0].items():
        monkeypatch.setattr(sense, "compute", lambda name=name: pytest.fail(f"{name} computed"))
    scenario.read(bodies=[0])


def test_the_order_of_reading_changes_nothing(body, stage):
    forward, backward = stage(body), stage(body)
    for _ in range(4):
        first = forward.read()
        assert_equal(backward.read((1, 0), NAMES[::-1]), first)
        assert_equal(backward.read(), first)
        forward.step()
        backward.step()


def test_a_reset_gives_what_a_new_world_gives(body, stage):
    scenario = stage(body)
    first = scenario.read()
    scenario.step(3)
    scenario.read()
    scenario.reset()
    assert_equal(scenario.read(), first)


def test_values_are_read_only_and_outlive_the_step(body, stage):
    scenario = stage(body)
    values = [sense.read() for sense in scenario.senses[0].values()]
    arrays = {name: array for value in values for name, array in value.items()}
    kept = {name: array.copy() for name, array in arrays.items()}
    for name, array in arrays.items():
        with pytest.raises(ValueError, match="read-only"):
            array[...] = 0
        assert not np.shares_memory(array, kept[name])
    scenario.step(2)
    scenario.read()
    for name, array in arrays.items():
        np.testing.assert_array_equal(array, kept[name])


@pytest.mark.parametrize("name", ["vision", "touch"])
def test_senses_without_memory_do_not_notice_steps_that_were_not_read(body, name, stage):
    every, rare = stage(body), stage(body)
    for _ in range(5):
        every.step()
        expected = every.read(names=[name])
    rare.step(5)
    assert_equal(rare.read(names=[name]), expected)


@pytest.mark.parametrize("quality", AudioQuality)
@pytest.mark.parametrize("left_out", [1, 2, 25])
def test_ears_that_left_out_steps_hear_what_ears_that_did_not_hear(quality, left_out, stage):
    """Exact but for rounding, since neither the walker nor the buzzer moves."""
    audio = AudioCfg(quality=quality, waveform=True)
    every, rare = (stage("walker", SensesCfg(audio=audio), True) for _ in range(2))
    for scenario in (every, rare):
        scenario.read(names=["audio"])
    for _ in range(left_out + 1):
        every.step()
        expected = every.read(names=["audio"])
    rare.step(left_out + 1)
    for steps_later in range(3):
        heard = rare.read(names=["audio"])
        for key, value in heard.items():
            tolerance = 1e-3 if key[2] == "audio" else 1e-5
            np.testing.assert_allclose(value, expected[key], atol=tolerance, err_msg=steps_later)
            assert value.std() > 10 * tolerance
        every.step()
        rare.step()
        expected = every.read(names=["audio"])


def test_acceleration_is_the_mean_over_the_steps_since_the_last_read(stage):
    """A head that gains 0.3 m/s in three steps of 0.04 s, read after all three."""
    scenario = stage("walker")
    walker, sense = scenario.bodies[0], scenario.senses[0]["proprioception"]
    sense.read()
    before = walker.head_motion()[0]
    walker.walk(0.5, 0.0)
    scenario.step(3)
    gained = walker.head_motion()[0] - before
    expected = walker.mount("head").rotation.T @ (gained / 0.12 + np.array([0.0, 0.0, 9.81]))
    felt = sense.read()["proprioception"][sense.parts["head_acceleration"]]
    assert np.linalg.norm(gained) > 0.1
    np.testing.assert_allclose(felt, expected, atol=1e-5)


@dataclass
class SmellCfg:
    present: bool = True
    range_m: float = 2.0


class SmellSense(Sense):
    """Whether the buzzer is near."""

    cfg_type = SmellCfg

    def __init__(self, cfg, body, world):
        super().__init__(world)
        self.cfg, self.body, self.world = cfg, body, world
        self.specs = {"smell": ArraySpec((1,), np.float32)}

    def compute(self):
        away = np.linalg.norm(self.world.prop("buzzer").position - self.body.position)
        return {"smell": np.array([away < self.cfg.range_m], np.float32)}


@pytest.fixture
def smell():
    register_sense("smell")(SmellSense)
    yield
    del SENSES["smell"]


@pytest.mark.usefixtures("smell")
@pytest.mark.parametrize(
    ("extra", "smelt"),
    [({}, 1.0), ({"smell": {"range_m": 0.1}}, 0.0), ({"smell": SmellCfg(range_m=0.1)}, 0.0)],
)
def test_a_further_sense_is_registered_and_configured_in_one_place(extra, smelt, stage):
    scenario = stage("walker")
    cfg = SensesCfg(extra=extra)
    senses = make_senses(scenario.bodies[0], ("smell", "touch"), cfg, scenario.world)
    assert list(senses) == ["smell", "touch"]
    assert senses["smell"].read()["smell"] == [smelt]


def test_a_sense_without_settings_has_its_defaults():
    assert SensesCfg().of("audio") == AudioCfg()
    assert SensesCfg.complete().audio == AudioCfg()
    assert not SensesCfg.complete().unset
    assert SensesCfg(audio=AudioCfg(present=False)).unset == {"vision", "proprioception", "touch"}


@pytest.mark.usefixtures("smell")
@pytest.mark.parametrize(
    ("computed", "named"),
    [
        ({"smell": np.zeros(3, np.float32)}, ("'smell'", "float32(3,)", "float32(1,)")),
        ({"smell": np.zeros(1)}, ("'smell'", "float64(1,)", "float32(1,)")),
        ({"smell": np.array(["a"])}, ("'smell'", "<U1(1,)", "float32(1,)")),
        ({"smell": [0.0]}, ("'smell'", "list", "float32(1,)")),
        ({"smell": np.float32(0.0)}, ("'smell'", "float32", "(1,)")),
        ({"odour": np.zeros(1, np.float32)}, ("'odour'", "'smell'")),
        ({}, ("[]", "'smell'")),
        (None, ("NoneType", "'smell'")),
    ],
)
def test_an_array_that_does_not_fit_its_spec_is_refused_when_it_is_read(
    computed, named, stage, monkeypatch
):
    scenario = stage("walker")
    monkeypatch.setattr(SmellSense, "compute", lambda _: computed)
    cfg = SensesCfg(extra={})
    (sense,) = make_senses(scenario.bodies[0], ("smell",), cfg, scenario.world).values()
    with pytest.raises(ValueError, match=naming("SmellSense", *named)):
        sense.read()


@pytest.mark.usefixtures("smell")
def test_a_further_sense_can_be_absent(stage):
    scenario = stage("walker")
    cfg = SensesCfg(extra={"smell": {"present": False}})
    senses = make_senses(scenario.bodies[0], ("smell", "touch"), cfg, scenario.world)
    assert list(senses) == ["touch"]


@pytest.mark.usefixtures("smell")
def test_errors_of_the_registry_name_the_choices():
    class OtherSense(SmellSense):
        pass

    class Unconditional(SmellSense):
        cfg_type = PropCfg

    with pytest.raises(ValueError, match=naming("'smell'", "SmellSense", "OtherSense")):
        register_sense("smell")(OtherSense)
    with pytest.raises(ValueError, match=naming("'taste'", "audio", "smell")):
        SensesCfg().of("taste")
    with pytest.raises(ValueError, match=naming("senses.extra.smell", "'reach'", "range_m")):
        SensesCfg(extra={"smell": {"reach": 1.0}}).of("smell")
    with pytest.raises(ValueError, match=naming("PropCfg", "'present'")):
        register_sense("taste")(Unconditional)
