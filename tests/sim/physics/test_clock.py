"""Every possible rate of agent steps: sound without gaps and the same bytes twice."""

import numpy as np
import pytest
from composed import compose
from listening import HEAD, SOURCES, STILL, noise, ratio_db, render_still
from walking import ball, empty_world

from veca_marl.sim.hearing import MonoReceiver
from veca_marl.sim.physics import ClockCfg
from veca_marl.sim.physics.clock import CONTROL_RATES_HZ
from veca_marl.sim.sound import SAMPLE_RATE_HZ, SoundCfg


def test_rates_are_the_divisors_of_the_sampling_rate():
    assert len(CONTROL_RATES_HZ) == 54
    assert {1, 10, 15, 18, 21, 25, 30, 50, 245, 294, 22_050} <= set(CONTROL_RATES_HZ)
    assert all(ClockCfg(rate).step_samples * rate == SAMPLE_RATE_HZ for rate in CONTROL_RATES_HZ)


@pytest.mark.parametrize(
    ("name", "value"),
    [("substeps", 10**308), ("solver_iterations", 10**308), ("sleep_s", 1e308)],
)
def test_numbers_that_no_machine_can_step_are_refused(name, value):
    with pytest.raises(ValueError, match=f"^{name}="):
        ClockCfg(**{name: value})


def test_at_every_rate_blocks_of_sound_follow_each_other_without_gaps():
    """The stream of a second, or a tenth of it, does not depend on the length of its blocks."""
    sound = noise(SAMPLE_RATE_HZ)
    expected = render_still([sound], SOURCES[:1], HEAD, "mono", step=882)
    for rate in CONTROL_RATES_HZ:
        step = SAMPLE_RATE_HZ // rate
        steps = rate if rate < 50 else rate // 10
        heard = render_still([sound], SOURCES[:1], HEAD, "mono", step=step, n_steps=steps)
        assert np.abs(heard).max() > 0.01
        assert ratio_db(expected[:, : heard.shape[1]], heard[:, : expected.shape[1]]) > 100.0, rate


def rolling_second(rate_hz):
    """Return the place of a ball that rolls for a second, and its sound as heard meanwhile."""
    toy = ball(position=(0.0, 0.0, 0.1), sound=SoundCfg(), rolling_friction=0.0)
    world = empty_world(toy, clock=ClockCfg(rate_hz, substeps=max(1, 120 // rate_hz)))
    listener = world.sound.add_listener(MonoReceiver())
    world.freeze()
    world.reset(np.random.default_rng(3))
    world.prop("ball").set_velocity((1.0, 0.5, 0.0), (-5.0, 10.0, 0.0))
    heard = []
    for _ in range(rate_hz):
        world.step()
        heard.append(listener.render(STILL))
    place = world.prop("ball").position
    world.close()
    return place, np.concatenate(heard, axis=1)


@pytest.mark.parametrize("rate_hz", [1, 25, 245])
def test_a_world_is_deterministic_and_keeps_time(rate_hz):
    place, heard = rolling_second(rate_hz)
    again, heard_again = rolling_second(rate_hz)
    assert (place.tobytes(), heard.tobytes()) == (again.tobytes(), heard_again.tobytes())
    np.testing.assert_allclose(place[:2], (1.0, 0.5), atol=0.002)
    assert heard.shape[1] == SAMPLE_RATE_HZ
    assert np.abs(heard).max() > 0.0


def test_presets_have_the_step_of_the_paper():
    physics = compose(["+task=KickTheBall", "clock=physics4ms"]).clock
    assert (physics.step_s, physics.substep_s) == pytest.approx((0.04, 0.004))
    agent = compose(["+task=KickTheBall", "clock=agent4ms"]).clock
    assert (agent.step_samples, agent.substep_s) == (90, pytest.approx(1 / 245))
