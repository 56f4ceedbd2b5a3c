import pytest

from tools.fidelity.hearing.doppler import approaching_source, receivers, theory_hz


@pytest.mark.parametrize("speed_mps", [3.0, -3.0])
@pytest.mark.parametrize("quality", ["mono", "stereo", "hrtf"])
def test_direct_sound_and_reflection_have_their_own_doppler_shift(quality, speed_mps):
    """The image source of an approaching source recedes, and that of a receding one approaches."""
    direct, reflection = approaching_source(speed_mps, 2000.0, receivers()[quality])
    assert direct.frequency_hz == pytest.approx(theory_hz(speed_mps, 2000.0), abs=1.0)
    assert reflection.frequency_hz == pytest.approx(theory_hz(-speed_mps, 2000.0), abs=1.0)
    assert max(direct.ripple_db, reflection.ripple_db) < 1.0


def test_a_source_at_rest_is_not_shifted():
    direct, reflection = approaching_source(0.0, 1000.0, receivers()["mono"])
    assert direct.frequency_hz == pytest.approx(1000.0, abs=0.01)
    assert reflection.frequency_hz == pytest.approx(1000.0, abs=0.01)
